"""Datasets in an object store, against an S3 server on this machine: the same bytes, resumed."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.batch.run import generate
from pipeline.dataset.checksums import NAME, own_files
from pipeline.recipe import Recipe
from tests.support.small_recipe import write_shards

pytest.importorskip("s3fs", reason="s3fs isn't installed: flawforge[s3]")
boto3 = pytest.importorskip("boto3", reason="boto3 isn't installed: moto[server]")
threaded = pytest.importorskip("moto.server", reason="moto isn't installed: moto[server]")

HOME = Path(__file__).resolve().parents[3]
BUCKET = "scans"


@dataclass(frozen=True)
class Server:
    """An S3 server, what clients must know of it, and a client."""

    environment: dict[str, str]
    client: object

    def objects(self, prefix: str) -> dict[str, bytes]:
        found = {}
        listed = self.client.list_objects_v2(Bucket=BUCKET, Prefix=f"{prefix}/")
        for one in listed.get("Contents", ()):
            body = self.client.get_object(Bucket=BUCKET, Key=one["Key"])["Body"].read()
            found[one["Key"].removeprefix(f"{prefix}/")] = body
        return found

    def start(self, recipe: Path, out: str, *words: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "flawforge.cli", "generate", str(recipe), "--out", out, *words],
            env={**os.environ, **self.environment, "PYTHONPATH": str(HOME)}, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def run(self, recipe: Path, out: str, *words: str) -> tuple[int, str, str]:
        process = self.start(recipe, out, *words)
        said, errors = process.communicate(timeout=240)
        return process.returncode, said, errors


@pytest.fixture
def server() -> Iterator[Server]:
    moto = threaded.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    moto.start()
    host, port = moto.get_host_and_port()
    environment = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "any",
        "AWS_SECRET_ACCESS_KEY": "any", "AWS_DEFAULT_REGION": "us-east-1",
    }  # fmt: skip
    client = boto3.client(
        "s3", endpoint_url=environment["AWS_ENDPOINT_URL"], aws_access_key_id="any",
        aws_secret_access_key="any", region_name="us-east-1",
    )  # fmt: skip
    client.create_bucket(Bucket=BUCKET)
    yield Server(environment=environment, client=client)
    client.close()
    moto.stop()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, bytes]]:
    """Return a recipe, and its dataset's files as made in a folder."""
    folder = tmp_path_factory.mktemp("folder")
    recipe = write_shards(folder, specimens=6, scans=2)
    generate(Recipe.load(recipe), folder / "out")
    names = (*own_files(folder / "out"), NAME)
    return recipe, {name: (folder / "out" / name).read_bytes() for name in names}


@pytest.mark.slow
def test_the_same_bytes_as_in_a_folder(server, made):
    recipe, files = made
    code, said, errors = server.run(recipe, f"s3://{BUCKET}/a/b", "--jobs", "2")
    assert code == 0, errors
    assert f"in s3://{BUCKET}/a/b" in said
    assert server.objects("a/b") == files


@pytest.mark.slow
def test_a_killed_run_goes_on_and_leaves_whole_objects_alone(server, made):
    recipe, files = made
    out = f"s3://{BUCKET}/killed"
    process = server.start(recipe, out)
    end = time.monotonic() + 120
    while len([name for name in server.objects("killed") if name.endswith("h5.json")]) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    left = server.objects("killed")
    assert "dataset.json" not in left
    journals = [name for name in left if name.endswith("h5.json")]
    for name in journals:
        shard = json.loads(left[name].decode().splitlines()[0])
        assert hashlib.sha256(left[shard["shard"]]).hexdigest() == shard["sha256"]
    assert left.items() <= files.items()
    # One of the whole shards is damaged meanwhile: it is made anew, the others are kept.
    hurt = Path(journals[0]).name.removesuffix(".json")
    server.client.put_object(Bucket=BUCKET, Key=f"killed/{hurt}", Body=left[hurt][:-1])
    code, said, errors = server.run(recipe, out, "--log-json")
    assert code == 0, errors
    events = [json.loads(line) for line in said.splitlines()]
    kept = {one["shard"] for one in events if one.get("kept")}
    assert kept == {Path(name).name.removesuffix(".json") for name in journals} - {hurt}
    assert server.objects("killed") == files


@pytest.mark.slow
def test_wrong_places_are_refused_in_one_line(server, made, tmp_path):
    recipe, _ = made
    server.client.put_object(Bucket=BUCKET, Key="mine/letter.txt", Body=b"x")
    code, _, errors = server.run(recipe, f"s3://{BUCKET}/mine")
    assert code == 2
    assert "the prefix isn't empty and holds no dataset" in errors
    code, _, errors = server.run(recipe, "s3://no-such-bucket/x")
    assert code == 2
    assert errors.count("flawforge: ") == 1
    assert "Traceback" not in errors
    assert server.run(recipe, f"s3://{BUCKET}/taken")[0] == 0
    before = server.objects("taken")
    code, _, errors = server.run(recipe, f"s3://{BUCKET}/taken", "--seed", "99")
    assert code == 2
    assert "of another recipe" in errors
    assert server.objects("taken") == before
