"""A folder of one host that others mount over the slow line: SFTP over TCP, by sshfs.

Each process mounts the folder in a namespace of its own and lies in a process namespace of its own,
so that the mount ends with the process, however it ends. There is no encryption; sshfs caches as it
does by default, names and attributes for up to 20 s.
"""

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.support.far_network import Host

SERVERS = ("/usr/lib/openssh/sftp-server", "/usr/libexec/openssh/sftp-server")
PORT = 2222
MOUNT = (
    'sshfs -o "directport=$1" "$2:$3" "$4" && cd / && shift 4 && exec "$@"'
)


@dataclass(frozen=True)
class FarFolder:
    """A folder served by a host, and the path under which other hosts mount it."""

    server: Host
    folder: Path
    path: Path

    def words(self, host: Host, *command: str) -> list[str]:
        """Return the words that run a command on a host with the folder mounted."""
        return host.words(
            "unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c",
            MOUNT, "sh", str(PORT), self.server.address, str(self.folder), str(self.path), *command,
        )  # fmt: skip


def missing() -> str | None:
    """Return why this machine can't have such a folder; None: it can."""
    for command in ("sshfs", "socat", "unshare"):
        if shutil.which(command) is None:
            return f"a far folder needs the command {command}"
    if not any(Path(server).exists() for server in SERVERS):
        return "a far folder needs openssh-sftp-server"
    return None if Path("/dev/fuse").exists() else "a far folder needs /dev/fuse"


@contextmanager
def far_folder(server: Host, folder: Path, path: Path) -> Iterator[FarFolder]:
    """Serve a folder on a host; others see it under `path`."""
    for needed in (folder, path):
        needed.mkdir(parents=True, exist_ok=True)
    program = next(one for one in SERVERS if Path(one).exists())
    process = subprocess.Popen(
        server.words("socat", f"TCP-LISTEN:{PORT},bind={server.address},fork,reuseaddr,nodelay",
                     f"EXEC:{program}"),
        start_new_session=True,  # a group of its own, with a process for each connection
    )  # fmt: skip
    try:
        time.sleep(0.5)
        assert process.poll() is None, "socat ended"
        yield FarFolder(server=server, folder=folder, path=path)
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(30)
