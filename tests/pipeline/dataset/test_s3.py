"""Datasets on an S3 server of this machine: kills, cut-off uploads, two runs, a lost server."""

import hashlib
import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.batch.run import generate
from pipeline.dataset.checksums import NAME, own_files
from pipeline.recipe import Recipe
from tests.support.s3_server import BUCKET, Server, serving
from tests.support.small_recipe import write_shards

for package, extra in (("s3fs", "flawforge[s3]"), ("upath", "flawforge[s3]"),
                       ("boto3", "moto[server]"), ("moto.server", "moto[server]")):  # fmt: skip
    pytest.importorskip(package, reason=f"{package} isn't installed: {extra}")
pytestmark = pytest.mark.slow


@pytest.fixture
def server() -> Iterator[Server]:
    with serving() as found:
        yield found


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, dict[str, bytes]]:
    """Return a recipe, and its dataset's files as made in a folder."""
    folder = tmp_path_factory.mktemp("folder")
    recipe = write_shards(folder, specimens=6, scans=2)
    generate(Recipe.load(recipe), folder / "out")
    names = (*own_files(folder / "out"), NAME)
    return recipe, {name: (folder / "out" / name).read_bytes() for name in names}


IN_A_FORK = """
import os, sys, flawforge
scans = flawforge.open(sys.argv[1])
first = scans[0]["depth"]
child = os.fork()
if not child:
    assert scans[0]["depth"].shape == first.shape
    os._exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
assert scans[11]["depth"].shape == first.shape
"""


def until_shards(server: Server, process, prefix: str, count: int) -> list[str]:
    """Wait until a run has delivered some shards; return their journals' names."""
    end = time.monotonic() + 120
    while True:
        journals = [name for name in server.objects(prefix) if name.endswith("h5.json")]
        if len(journals) >= count:
            return journals
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_same_bytes_as_in_a_folder_by_two_jobs(server, made):
    recipe, files = made
    out = f"s3://{BUCKET}/a/b"
    # An upload that was cut off is no object: the prefix is empty.
    parts = server.client.create_multipart_upload(Bucket=BUCKET, Key="a/b/shard-00000.h5")
    server.client.upload_part(
        Bucket=BUCKET, Key="a/b/shard-00000.h5", UploadId=parts["UploadId"], PartNumber=1,
        Body=b"half",
    )  # fmt: skip
    code, said, errors = server.run("generate", recipe, "--out", out, "--jobs", "2")
    assert code == 0, errors
    assert f"in {out}" in said
    assert server.objects("a/b") == files
    code, said, errors = server.run("verify", out)
    assert (code, said) == (0, f"{out}: 12 scans in 6 shards, all whole\n"), errors
    reader = server.python("-c", IN_A_FORK, out)
    _, errors = reader.communicate(timeout=60)
    assert reader.returncode == 0, errors


def test_a_killed_run_goes_on_and_leaves_whole_objects_alone(server, made):
    recipe, files = made
    words = ("generate", recipe, "--out", f"s3://{BUCKET}/killed")
    process = server.start(*words)
    until_shards(server, process, "killed", 2)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    left = server.objects("killed")
    journals = [name for name in left if name.endswith("h5.json")]
    assert "dataset.json" not in left
    for name in journals:
        shard = json.loads(left[name].decode().splitlines()[0])
        assert hashlib.sha256(left[shard["shard"]]).hexdigest() == shard["sha256"]
    assert left.items() <= files.items()
    # One of the whole shards is damaged meanwhile: it is made anew, the others are kept.
    hurt = Path(journals[0]).name.removesuffix(".json")
    server.client.put_object(Bucket=BUCKET, Key=f"killed/{hurt}", Body=left[hurt][:-1])
    code, said, errors = server.run(*words, "--log-json")
    assert code == 0, errors
    events = [json.loads(line) for line in said.splitlines()]
    kept = {one["shard"] for one in events if one.get("kept")}
    assert kept == {Path(name).name.removesuffix(".json") for name in journals} - {hurt}
    assert server.objects("killed") == files


def test_of_two_recipes_at_once_one_gets_the_prefix(server, made):
    recipe, files = made
    words = ("generate", recipe, "--out", f"s3://{BUCKET}/two")
    runs = [server.start(*words), server.start(*words, "--seed", "99")]
    outputs = [run.communicate(timeout=240) for run in runs]
    assert sorted(run.returncode for run in runs) == [0, 2], outputs
    loser = next(k for k, run in enumerate(runs) if run.returncode)
    assert "of another recipe" in outputs[loser][1]
    assert set(server.objects("two")) == set(files)


def test_a_server_that_ends_is_one_line(server, made):
    recipe, _ = made
    process = server.start("generate", recipe, "--out", f"s3://{BUCKET}/gone")
    until_shards(server, process, "gone", 1)
    server.moto.stop()
    _, errors = process.communicate(timeout=240)
    assert process.returncode == 2
    assert errors.count("flawforge: ") == 1
    assert "the object store can't be used" in errors
    assert "Traceback" not in errors


def test_a_bucket_that_does_not_exist_is_one_line(server, made):
    for words in (("generate", made[0], "--out"), ("verify",)):
        code, _, errors = server.run(*words, "s3://no-such-bucket/x")
        assert code == 2
        assert errors.count("flawforge: ") == 1
        assert "s3://no-such-bucket/x" in errors
        assert "Traceback" not in errors
