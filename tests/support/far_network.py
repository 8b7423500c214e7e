"""Hosts of their own on this machine: network namespaces joined by a hub that delays packets.

Each namespace has one tunnel device, whose other end this process holds; a thread passes packets
on after the latency. That is the kernel's own TCP over a slow line, with no module that a kernel
may lack.
"""

import ctypes
import fcntl
import heapq
import itertools
import os
import select
import shutil
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000  # linux/if_tun.h
CLONE_NEWNET = 0x40000000  # linux/sched.h


@dataclass(frozen=True)
class Host:
    """A namespace and its address."""

    name: str
    address: str

    def words(self, *command: str) -> list[str]:
        """Return the words that run a command on this host."""
        return ["ip", "netns", "exec", self.name, *command]


def missing() -> str | None:
    """Return why this machine can't have such hosts; None: it can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if shutil.which("ip") is None:
        return "network namespaces need the command ip"
    if not Path("/dev/net/tun").exists():
        return "network namespaces need /dev/net/tun"
    made = subprocess.run(["ip", "netns", "add", "ff-probe"], capture_output=True, check=False)
    subprocess.run(["ip", "netns", "del", "ff-probe"], capture_output=True, check=False)
    return "network namespaces can't be made here" if made.returncode else None


@contextmanager
def far_hosts(count: int, latency_s: float) -> Iterator[list[Host]]:
    """Make hosts that reach each other with a latency each way."""
    hosts = [Host(f"ff-{os.getpid()}-{k}", f"10.91.7.{k + 1}") for k in range(count)]
    with ExitStack() as stack:
        tunnels = {}
        for host in hosts:
            subprocess.run(["ip", "netns", "add", host.name], check=True)
            stack.callback(_end, host)
            tunnel = _tunnel(host)
            stack.callback(os.close, tunnel)
            tunnels[host.address] = tunnel
            for line in ("link set lo up", f"addr add {host.address}/24 dev tun0",
                         "link set tun0 up"):  # fmt: skip
                subprocess.run(host.words("ip", *line.split()), check=True)
        stop = threading.Event()
        hub = threading.Thread(target=_pass_on, args=(tunnels, latency_s, stop))
        hub.start()
        stack.callback(hub.join)
        stack.callback(stop.set)
        yield hosts


def _end(host: Host) -> None:
    """Remove a host with all its processes: mounts over a cut line hold theirs."""
    left = subprocess.run(["ip", "netns", "pids", host.name], capture_output=True, check=False)
    for number in left.stdout.split():
        with suppress(ProcessLookupError):
            os.kill(int(number), signal.SIGKILL)
    subprocess.run(["ip", "netns", "del", host.name], check=False)


def _tunnel(host: Host) -> int:
    """Open a tunnel device in a host's namespace, from a thread that enters it for good."""
    found: list[int] = []

    def enter() -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        with Path(f"/var/run/netns/{host.name}").open() as space:
            if libc.setns(space.fileno(), CLONE_NEWNET):
                return
        tunnel = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(tunnel, TUNSETIFF, struct.pack("16sH", b"tun0", IFF_TUN | IFF_NO_PI))
        found.append(tunnel)

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    return found[0]


def _pass_on(tunnels: dict[str, int], latency_s: float, stop: threading.Event) -> None:
    """Pass packets on, each a latency after it came."""
    waiting: list[tuple[float, int, int, bytes]] = []
    number = itertools.count()
    while not stop.is_set():
        rest = waiting[0][0] - time.monotonic() if waiting else 0.05
        for tunnel in select.select(list(tunnels.values()), [], [], min(max(rest, 0.0), 0.05))[0]:
            packet = os.read(tunnel, 65536)
            if packet[0] >> 4 != 4:
                continue
            to = tunnels.get(".".join(map(str, packet[16:20])))
            if to is not None:
                due = time.monotonic() + latency_s
                heapq.heappush(waiting, (due, next(number), to, packet))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, to, packet = heapq.heappop(waiting)
            with suppress(OSError):  # the line of the host is cut
                os.write(to, packet)
