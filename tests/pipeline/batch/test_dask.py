"""Workers of a Dask scheduler: the same bytes, also when one of them is killed."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from files.errors import RecipeError
from pipeline.batch.cluster import cluster
from pipeline.dataset.manifest import versions
from pipeline.dataset.shards import file_sha256
from tests.support.processes import HOME, wait_for

pytest.importorskip("distributed", reason="distributed isn't installed: flawforge[dask]")

OUTPUTS = ("shard-*.h5", "manifest.*", "flaws.*", "dataset.json")


def checksums(folder: Path) -> dict[str, str]:
    files = sorted(path for pattern in OUTPUTS for path in folder.glob(pattern))
    return {path.name: file_sha256(path) for path in files}


def spawn(log: Path, module: str, *words: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(HOME)}
    with log.open("w") as said:
        return subprocess.Popen(
            [sys.executable, "-m", module, *words],
            cwd=log.parent,
            env=environment,
            stdout=said,
            stderr=said,
        )


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    port = free_port()
    log = tmp_path / "scheduler.log"
    process = spawn(
        log, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port),
        "--no-dashboard", "--dashboard-address", "127.0.0.1:0",
    )  # fmt: skip
    wait_for(log, "Scheduler at", process)
    yield f"tcp://127.0.0.1:{port}"
    process.terminate()
    process.wait(30)


@pytest.fixture
def workers(scheduler: str, tmp_path: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    logs = [tmp_path / f"worker-{i}.log" for i in range(2)]
    processes = [
        spawn(
            log, "distributed.cli.dask_worker", scheduler, "--nthreads", "1", "--no-nanny",
            "--no-dashboard", "--dashboard-address", "127.0.0.1:0",
            "--local-directory", str(tmp_path / log.stem),
        )
        for log in logs
    ]  # fmt: skip
    for log, process in zip(logs, processes, strict=True):
        wait_for(log, "Registered to", process)
    yield processes
    for process in processes:
        process.terminate()
        process.wait(30)


def started(recipe: Path, out: Path, scheduler: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [
            sys.executable, "-m", "flawforge.cli", "generate", recipe, "--out", out,
            "--backend", "dask", "--scheduler", scheduler, "--log-json",
        ],
        cwd=HOME,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_same_bytes_though_a_worker_is_killed(once, recipe_path, tmp_path, scheduler, workers):
    out = tmp_path / "shared"
    run = started(recipe_path, out, scheduler)
    assert run.stdout is not None
    events = []
    for line in run.stdout:
        events.append(json.loads(line))
        if events[-1]["event"] == "shard" and workers[0].poll() is None:
            workers[0].send_signal(signal.SIGKILL)  # both are at work: six shards, two workers
            workers[0].wait(30)
            before = len([one for one in events if one["event"] == "shard"])
    _, errors = run.communicate(timeout=120)
    assert run.returncode == 0, errors
    assert before < 6
    assert [one["event"] for one in events].count("shard") == 6
    assert checksums(out) == checksums(once)
    assert not list(out.glob(".*.part"))


@pytest.mark.slow
def test_a_lost_scheduler_is_one_line(recipe_path, tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "3s")
    port, quiet = free_port(), ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")
    log = tmp_path / "scheduler.log"
    scheduler = spawn(log, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port",
                      str(port), *quiet)  # fmt: skip
    wait_for(log, "Scheduler at", scheduler)
    log, address = tmp_path / "worker.log", f"tcp://127.0.0.1:{port}"
    worker = spawn(log, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
                   *quiet, "--local-directory", str(tmp_path / "w"))  # fmt: skip
    try:
        wait_for(log, "Registered to", worker)
        run = started(recipe_path, tmp_path / "out", address)
        assert run.stdout is not None
        for line in run.stdout:
            if json.loads(line)["event"] == "plan":
                scheduler.kill()
        _, errors = run.communicate(timeout=120)
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait(30)
    assert run.returncode == 2
    assert "the Dask scheduler was lost" in errors
    assert len(errors.strip().splitlines()) == 1, errors


def test_a_worker_with_other_versions_is_refused(recipe_path, tmp_path, scheduler):
    fake = tmp_path / "elsewhere"
    (fake / "manifold3d-0.1.dist-info").mkdir(parents=True)
    (fake / "manifold3d-0.1.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: manifold3d\nVersion: 0.1\n"
    )
    log = tmp_path / "worker.log"
    code = (
        f"import sys; sys.path[:0] = [{str(fake)!r}, {str(HOME)!r}]\n"
        "from distributed.cli.dask_worker import main\n"
        f"main([{scheduler!r}, '--nthreads', '1', '--no-nanny', '--no-dashboard',"
        f" '--dashboard-address', '127.0.0.1:0', '--local-directory', {str(tmp_path / 'w')!r}])"
    )
    (tmp_path / "other_worker.py").write_text(code)
    process = spawn(log, "other_worker")
    try:
        wait_for(log, "Registered to", process)
        run = started(recipe_path, tmp_path / "out", scheduler)
        _, errors = run.communicate(timeout=60)
    finally:
        process.terminate()
        process.wait(30)
    assert run.returncode == 2
    assert "manifold3d 0.1 instead of" in errors
    assert len(errors.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_no_scheduler_gives_one_line(recipe_path, tmp_path):
    run = started(recipe_path, tmp_path / "out", f"tcp://127.0.0.1:{free_port()}")
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 2, errors
    assert "no Dask scheduler answers (" in errors
    assert len(errors.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("address", ["localhost", "nonsense://here:1", "tcp://127.0.0.1:99999"])
def test_what_is_no_address_is_said(address):
    with pytest.raises(RecipeError, match="no Dask scheduler answers"):
        cluster(address, versions()).__enter__()


def test_without_distributed_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RecipeError, match=r"pip install 'flawforge\[dask\]'"):
        cluster("tcp://127.0.0.1:1", versions()).__enter__()
