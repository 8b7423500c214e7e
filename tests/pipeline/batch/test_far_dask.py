"""Dask over hosts of their own, with latency between them and a host that is lost."""

import json
import os
import signal
import subprocess
import sys

import pytest

from pipeline.batch.run import generate
from pipeline.dataset.checksums import own_files
from pipeline.recipe import Recipe
from tests.support.far_network import far_hosts, missing
from tests.support.processes import HOME, wait_for
from tests.support.small_recipe import write_shards

pytest.importorskip("distributed", reason="distributed isn't installed: flawforge[dask]")

LATENCY_S = 0.02  # each way


def spawn(host, log, module, *words):
    with log.open("w") as said:
        return subprocess.Popen(
            host.words(sys.executable, "-m", module, *words), cwd=log.parent, stdout=said,
            stderr=said, env={**os.environ, "PYTHONPATH": str(HOME)},
        )  # fmt: skip


@pytest.mark.slow
def test_same_bytes_over_a_slow_line_though_a_host_is_lost(tmp_path):
    if (why := missing()) is not None:
        pytest.skip(why)
    recipe = write_shards(tmp_path, specimens=8, scans=2)
    generate(Recipe.load(recipe), tmp_path / "once")
    with far_hosts(4, LATENCY_S) as (middle, user, *others):
        processes = []
        try:
            log = tmp_path / "scheduler.log"
            address = f"tcp://{middle.address}:8786"
            processes.append(
                spawn(middle, log, "distributed.cli.dask_scheduler", "--host", middle.address,
                      "--port", "8786", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
            )  # fmt: skip
            wait_for(log, "Scheduler at", processes[0])
            for host in others:
                log = tmp_path / f"{host.name}.log"
                processes.append(
                    spawn(host, log, "distributed.cli.dask_worker", address, "--nthreads", "1",
                          "--no-nanny", "--no-dashboard", "--dashboard-address", "127.0.0.1:0",
                          "--local-directory", str(tmp_path / host.name))
                )  # fmt: skip
                wait_for(log, "Registered to", processes[-1])
            knock = f"import socket; socket.create_connection(('{middle.address}', 8786)).close()"
            code = f"import time; t = time.monotonic(); {knock}; print(time.monotonic() - t)"
            said = subprocess.run(user.words(sys.executable, "-c", code), check=True,
                                  capture_output=True, text=True)  # fmt: skip
            assert float(said.stdout) >= 2 * LATENCY_S  # there and back
            out = tmp_path / "shared"
            run = subprocess.Popen(
                user.words(sys.executable, "-m", "flawforge.cli", "generate", str(recipe), "--out",
                           str(out), "--backend", "dask", "--scheduler", address, "--log-json"),
                cwd=HOME, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            )  # fmt: skip
            assert run.stdout is not None
            shards = 0
            for line in run.stdout:
                shards += json.loads(line)["event"] == "shard"
                if shards == 1 and processes[1].poll() is None:
                    processes[1].send_signal(signal.SIGKILL)
            _, errors = run.communicate(timeout=240)
            assert run.returncode == 0, errors
            assert shards == 8
        finally:
            for process in reversed(processes):
                process.terminate()
            for process in processes:
                process.wait(30)
    for name in own_files(tmp_path / "once"):
        assert (out / name).read_bytes() == (tmp_path / "once" / name).read_bytes()
