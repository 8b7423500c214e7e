"""Past one machine: Dask over a far folder with workers that are lost, and a far S3 server.

Hosts are network namespaces of this machine with a latency between them: they share its cores and
disk, so the figures show what distance costs, not what more machines give. Needs root, sshfs,
socat, openssh-sftp-server and moto: `python -m benchmarks.cluster --write docs/scaling.md`.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.datasets import batches
from benchmarks.end_to_end import HOME
from benchmarks.page import Machine, fill
from benchmarks.page_datasets import table
from pipeline.batch.backend import THREADS
from pipeline.dataset.checksums import NAME, own_files
from pipeline.dataset.shards import file_sha256
from tests.support import far_folder, far_network
from tests.support.far_network import Host

LATENCY_S = 0.02  # each way
WORKERS = 2
LOST_AFTER = 4  # shards
BUCKET = "scans"
S3_PORT = 5555

MAKE_BUCKET = f"""
import time, boto3
while True:
    try:
        boto3.client("s3").create_bucket(Bucket="{BUCKET}")
        break
    except Exception:
        time.sleep(0.2)
"""
LOOK = """
import json, statistics, sys, time
from pathlib import Path
from files.place import names, place, put
from pipeline.dataset.shards import file_sha256
at, shard = place(sys.argv[1]), Path(sys.argv[2])
sums = {name: file_sha256(at / name) for name in names(at)}
def median(work):
    took = []
    for _ in range(7):
        begin = time.perf_counter()
        work()
        took.append(time.perf_counter() - begin)
    return statistics.median(took)
aside = at / "aside.h5"
times = {"put_s": median(lambda: put(shard, aside)), "read_s": median(lambda: file_sha256(aside))}
print(json.dumps({"sums": sums, **times}))
"""


@dataclass(frozen=True, kw_only=True)
class Here:
    """The machine itself as a host among others."""

    name: str = "here"
    address: str = "127.0.0.1"

    def words(self, *command: str) -> list[str]:
        """Return the words of a command as they are."""
        return [*command]


@dataclass(kw_only=True)
class Figures:
    """What was measured.

    Attributes
    ----------
    what, load
        The dataset, and the load of the machine before the run.
    shards, shard_bytes
        Of the dataset: how many, and the size of the largest one.
    seconds
        By what was done, a figure for each turn.
    others
        By what was done: names of files with other bytes than those of the first dataset.
    objects
        By where the S3 server is: seconds of an upload and of a read of the largest shard.
    """

    what: str
    load: float
    shards: int = 0
    shard_bytes: int = 0
    seconds: dict[str, list[float]] = field(default_factory=dict)
    others: dict[str, list[str]] = field(default_factory=dict)
    objects: dict[str, dict[str, float]] = field(default_factory=dict)

    def note(
        self, name: str, seconds: float, sums: Mapping[str, str], wanted: Mapping[str, str]
    ) -> None:
        """Take the figure of a turn, and the checksums of what was made."""
        others = [one for one in {**sums, **wanted} if sums.get(one) != wanted.get(one)]
        self.seconds.setdefault(name, []).append(seconds)
        self.others.setdefault(name, []).extend(others)
        print(f"{seconds:7.1f} s  {name} {' '.join(others)}", flush=True)


def sums_of(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of a dataset."""
    return {name: file_sha256(folder / name) for name in (*own_files(folder), NAME)}


def python(*words: str | Path) -> list[str]:
    """Return the words that run Python."""
    return [sys.executable, *map(str, words)]


def generate(recipe: Path, out: str | Path, *more: str) -> list[str]:
    """Return the words of `flawforge generate`."""
    return python("-m", "flawforge.cli", "generate", recipe, "--out", out, "--log-json", *more)


def timed(
    words: list[str], more: Mapping[str, str] = {}, at_shard: Callable[[int], None] | None = None
) -> float:
    """Run a command to its end; `at_shard` is called with the number of shards so far."""
    begin = time.perf_counter()
    with tempfile.TemporaryFile("w+") as errors, subprocess.Popen(
        words, cwd=HOME, env=environment(more), stdout=subprocess.PIPE, stderr=errors, text=True
    ) as process:  # fmt: skip
        assert process.stdout is not None
        shards = 0
        for line in process.stdout:
            shards += line.startswith("{") and json.loads(line).get("event") == "shard"
            if at_shard is not None:
                at_shard(shards)
        if process.wait():
            errors.seek(0)
            raise RuntimeError(f"{words}: {errors.read()}")
    return time.perf_counter() - begin


def environment(more: Mapping[str, str] = {}) -> dict[str, str]:
    """Return the environment of the processes."""
    return {**os.environ, **THREADS, "PYTHONPATH": str(HOME), **more}


@contextmanager
def background(log: Path, words: list[str], until: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command beside this one, from the words in its log on that say that it is ready."""
    with log.open("w") as said:
        process = subprocess.Popen(
            words, cwd=log.parent, env=environment(), stdout=said, stderr=said
        )
    try:
        end = time.monotonic() + 60
        while until not in log.read_text():
            if process.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"{words}: {log.read_text()}")
            time.sleep(0.05)
        yield process
    finally:
        process.kill()
        process.wait(30)


Wrap = Callable[..., list[str]]


def dask_s(
    recipe: Path, out: Path, folder: Path, hosts: list[Any], wrap: Wrap,
    lose: Callable[[Any, subprocess.Popen[bytes]], None] | None = None,
) -> float:  # fmt: skip
    """Generate by the workers of a Dask scheduler, which run already; lose the first worker.

    Parameters
    ----------
    hosts
        Of the scheduler, of the command, and of the workers.
    wrap
        Words that run a command on a host, with the dataset's folder.
    """
    middle, user, *others = hosts
    with ExitStack() as stack:
        quiet = ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")
        words = python("-m", "distributed.cli.dask_scheduler", "--host", middle.address, "--port",
                       "8786", *quiet)  # fmt: skip
        stack.enter_context(
            background(folder / "scheduler.log", middle.words(*words), "Scheduler at")
        )
        address = f"tcp://{middle.address}:8786"
        workers = []
        for number, host in enumerate(others):
            words = python("-m", "distributed.cli.dask_worker", address, "--nthreads", "1",
                           "--no-nanny", *quiet, "--local-directory", folder)  # fmt: skip
            log = folder / f"worker{number}.log"
            workers.append(stack.enter_context(background(log, wrap(host, *words), "Registered")))

        def at_shard(shards: int) -> None:
            if lose is not None and shards == LOST_AFTER and workers[0].poll() is None:
                lose(others[0], workers[0])

        words = generate(recipe, out, "--backend", "dask", "--scheduler", address)
        return timed(wrap(user, *words), at_shard=at_shard)


def killed(_host: Host, worker: subprocess.Popen[bytes]) -> None:
    """Kill a worker: its connections are closed by the system."""
    worker.kill()


def cut_off(host: Host, _worker: subprocess.Popen[bytes]) -> None:
    """Cut a host's line, as a power cut does: nobody is told."""
    subprocess.run(host.words("ip", "link", "set", "tun0", "down"), check=True)


def s3_s(recipe: Path, shard: Path, folder: Path, server: Any, user: Any) -> dict[str, Any]:
    """Generate into an S3 server by two jobs, and look at its objects."""
    keys = {
        "AWS_ENDPOINT_URL": f"http://{server.address}:{S3_PORT}", "AWS_ACCESS_KEY_ID": "any",
        "AWS_SECRET_ACCESS_KEY": "any", "AWS_DEFAULT_REGION": "us-east-1",
    }  # fmt: skip
    words = python("-m", "moto.server", "-H", server.address, "-p", str(S3_PORT))
    at = f"s3://{BUCKET}/dataset"
    with background(folder / "moto.log", server.words(*words), "Running on"):
        timed(user.words(*python("-c", MAKE_BUCKET)), keys)
        seconds = timed(user.words(*generate(recipe, at, "--jobs", "2")), keys)
        said = subprocess.run(
            user.words(*python("-c", LOOK, at, shard)), cwd=HOME, env=environment(keys),
            check=True, capture_output=True, text=True,
        )  # fmt: skip
    return {"seconds": seconds, **json.loads(said.stdout)}


LOCAL = "two jobs, a folder of this machine"
DASK_HERE = "two Dask workers on loopback, a folder of this machine"
DASK_FAR = "two Dask workers, shared folder, 20 ms"
KILLED = "the same, one worker killed"
CUT_OFF = "the same, the line of one worker cut"
S3_HERE = "two jobs, S3 on loopback"
S3_FAR = "two jobs, S3, 20 ms"


def turn(recipe: Path, figures: Figures) -> None:
    """Measure everything once."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seconds = timed(generate(recipe, folder / "a", "--jobs", "2"))
        wanted = sums_of(folder / "a")
        figures.note(LOCAL, seconds, wanted, wanted)
        shard = max((folder / "a").glob("*.h5"), key=lambda path: path.stat().st_size)
        figures.shards = len(list((folder / "a").glob("*.h5")))
        figures.shard_bytes = shard.stat().st_size
        here = [Here()] * (2 + WORKERS)
        seconds = dask_s(recipe, folder / "b", folder, here, lambda _, *words: [*words])
        figures.note(DASK_HERE, seconds, sums_of(folder / "b"), wanted)
        for number, (title, lose) in enumerate(
            ((DASK_FAR, None), (KILLED, killed), (CUT_OFF, cut_off))
        ):
            with ExitStack() as stack:
                server, *hosts = stack.enter_context(
                    far_network.far_hosts(3 + WORKERS, LATENCY_S)
                )
                served = folder / f"served{number}"
                far = stack.enter_context(
                    far_folder.far_folder(server, served, folder / "shared")
                )
                seconds = dask_s(recipe, far.path / "out", folder, hosts, far.words, lose)
            figures.note(title, seconds, sums_of(far.folder / "out"), wanted)
        for title, far_s in ((S3_HERE, 0.0), (S3_FAR, LATENCY_S)):
            with ExitStack() as stack:
                hosts = [Here()] * 2
                if far_s:
                    hosts = stack.enter_context(far_network.far_hosts(2, far_s))
                seen = s3_s(recipe, shard, folder, *hosts)
            figures.note(title, seen["seconds"], seen["sums"], wanted)
            figures.objects[title] = {key: seen[key] for key in ("put_s", "read_s")}


def page(figures: Figures) -> str:
    """Lay out the figures."""
    local = statistics.median(figures.seconds[LOCAL])
    lines = []
    for name, seconds in figures.seconds.items():
        middle = statistics.median(seconds)
        each = ", ".join(f"{one:.1f}" for one in seconds)
        same = "all" if not figures.others[name] else f"all but {len(figures.others[name])} files"
        lines.append((name, f"{middle:.1f} s ({each})", f"{middle / local:.2f} ×", same))
    machine = Machine.here()
    objects = "; ".join(
        f"{'20 ms away' if name == S3_FAR else 'on loopback'} {one['put_s']:.2f} s to upload and "
        f"{one['read_s']:.2f} s to read" for name, one in figures.objects.items()
    )  # fmt: skip
    here, far = (statistics.median(figures.seconds[name]) for name in (DASK_HERE, DASK_FAR))
    each_s = WORKERS * (far - here) / figures.shards
    return (
        f"{figures.what}, {figures.shards} shards of up to {figures.shard_bytes / 1e6:.1f} MB; "
        f"{machine.processor}, {machine.cores} cores, load before it {figures.load:.1f}.\n\n"
        + table(("dataset made by", "median (each turn)", "against two jobs", "same bytes"), lines)
        + f"\nThe far folder costs {each_s:.1f} s of a worker for each shard. The largest "
        f"shard as an S3 object: {objects}.\n"
    )


def measure(arguments: argparse.Namespace) -> None:
    """Measure in turns, and keep the figures."""
    for missing in (far_network.missing(), far_folder.missing()):
        if missing:
            raise SystemExit(f"benchmarks.cluster: {missing}")
    with tempfile.TemporaryDirectory() as name:
        what, recipe = list(batches(Path(name)).items())[0 if arguments.small else 1]
        figures = Figures(what=what, load=os.getloadavg()[0])
        for _ in range(arguments.turns):
            turn(recipe, figures)
    arguments.kept.parent.mkdir(parents=True, exist_ok=True)
    arguments.kept.write_text(json.dumps(asdict(figures)))


def main() -> None:
    """Measure, keep, and fill the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="page to fill")
    parser.add_argument("--turns", type=int, default=3, help="0: fill the page with what is kept")
    parser.add_argument("--kept", type=Path, default=HOME / "out" / "bench" / "cluster.json")
    parser.add_argument("--small", action="store_true", help="the quickstart's dataset, for a try")
    arguments = parser.parse_args()
    if arguments.turns:
        measure(arguments)
    text = page(Figures(**json.loads(arguments.kept.read_text())))
    print(text)
    if arguments.write:
        shown = fill(arguments.write.read_text(encoding="utf-8"), {"cluster": text})
        arguments.write.write_text(shown, encoding="utf-8")


if __name__ == "__main__":
    main()
