"""Dask over hosts of their own: a far folder, latency between them, a host that is lost."""

import json
import os
import subprocess
import sys

import pytest

from pipeline.batch.run import generate
from pipeline.dataset.checksums import own_files
from pipeline.recipe import Recipe
from tests.support import far_folder, far_network
from tests.support.processes import HOME, wait_for
from tests.support.small_recipe import write_shards

pytest.importorskip("distributed", reason="distributed isn't installed: flawforge[dask]")

LATENCY_S = 0.02  # each way


def spawn(words, log):
    with log.open("w") as said:
        return subprocess.Popen(
            words, cwd=log.parent, stdout=said, stderr=said,
            env={**os.environ, "PYTHONPATH": str(HOME)},
        )  # fmt: skip


@pytest.mark.slow
def test_same_bytes_over_a_slow_line_though_a_host_is_lost(tmp_path):
    why = far_network.missing() or far_folder.missing()
    if why is not None:
        pytest.skip(why)
    recipe = write_shards(tmp_path, specimens=8, scans=2)
    generate(Recipe.load(recipe), tmp_path / "once")
    python, quiet = [sys.executable, "-m"], ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")
    with far_network.far_hosts(5, LATENCY_S) as (server, middle, user, *others), (
        far_folder.far_folder(server, tmp_path / "served", tmp_path / "shared")
    ) as far:
        processes = []
        try:
            log = tmp_path / "scheduler.log"
            address = f"tcp://{middle.address}:8786"
            words = middle.words(*python, "distributed.cli.dask_scheduler", "--host",
                                 middle.address, "--port", "8786", *quiet)  # fmt: skip
            processes.append(spawn(words, log))
            wait_for(log, "Scheduler at", processes[0])
            for host in others:
                log = tmp_path / f"{host.name}.log"
                words = far.words(host, *python, "distributed.cli.dask_worker", address,
                                  "--nthreads", "1", "--no-nanny", *quiet, "--local-directory",
                                  str(tmp_path / host.name))  # fmt: skip
                processes.append(spawn(words, log))
                wait_for(log, "Registered to", processes[-1])
            knock = f"import socket; socket.create_connection(('{middle.address}', 8786)).close()"
            code = f"import time; t = time.monotonic(); {knock}; print(time.monotonic() - t)"
            said = subprocess.run(user.words(sys.executable, "-c", code), check=True,
                                  capture_output=True, text=True)  # fmt: skip
            assert float(said.stdout) >= 2 * LATENCY_S  # there and back
            run = subprocess.Popen(
                far.words(user, *python, "flawforge.cli", "generate", str(recipe), "--out",
                          str(far.path / "out"), "--backend", "dask", "--scheduler", address,
                          "--log-json"),
                cwd=HOME, env={**os.environ, "PYTHONPATH": str(HOME)}, stdout=subprocess.PIPE,
                stderr=subprocess.PIPE, text=True,
            )  # fmt: skip
            assert run.stdout is not None
            shards = 0
            for line in run.stdout:
                shards += json.loads(line)["event"] == "shard"
                if shards == 1 and processes[1].poll() is None:
                    processes[1].kill()
            _, errors = run.communicate(timeout=240)
            assert run.returncode == 0, errors
            assert shards == 8
        finally:
            for process in reversed(processes):
                process.kill()
                process.wait(30)
    for name in own_files(tmp_path / "once"):
        made = tmp_path / "served" / "out" / name
        assert made.read_bytes() == (tmp_path / "once" / name).read_bytes()
