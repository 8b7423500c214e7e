"""Each write, sync, rename and new folder of a command fails once: one line, nothing half written.

A file that stands under its own name has the bytes of an undisturbed run, and `generate` goes on
to all of them.
"""

import errno
import shutil
from collections import Counter
from pathlib import Path

import pytest

from flawforge.cli import main
from pipeline.dataset.checksums import own_files
from tests.support.faulty_files import Faults, failing
from tests.support.instrument_files import plate
from tests.support.small_recipe import write_shards

CODES = (errno.EIO, errno.ENOSPC)


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def answered(code: int, capsys: pytest.CaptureFixture[str], faults: Faults) -> None:
    """Hold a command to one line and exit code 2; a fault may also be none for what is asked."""
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert "an error of ours" not in said, (faults.what, said)
    assert code in (0, 2), said
    assert said.count("flawforge: ") == (1 if code == 2 else 0), said


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    return write_shards(tmp_path_factory.mktemp("recipe"), specimens=2, scans=1, scans_per_shard=1)


@pytest.fixture(scope="module")
def whole(recipe, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "out"
    assert main(["generate", str(recipe), "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_generate_goes_on_after_each_fault(recipe, whole, tmp_path, capsys):
    wanted = {name: (whole / name).read_bytes() for name in own_files(whole)}
    place = tmp_path / "out"
    words = ["generate", str(recipe), "--out", str(place)]
    clean = Faults()
    with failing(clean):
        assert main(words) == 0
    failed: Counter[str] = Counter()
    for number in range(clean.count):
        shutil.rmtree(place)
        capsys.readouterr()
        faults = Faults(number, CODES[number % 2])
        with failing(faults):
            code = main(words)
        answered(code, capsys, faults)
        failed[faults.what] += 1
        assert main(words) == 0
        found = {name: (place / name).read_bytes() for name in own_files(place)}
        assert found == wanted, (number, faults.what)
    assert {"write", "sync", "rename", "new folder"} <= set(failed)


FORMS = ("coco", "yolo", "hf", "webdataset", "png", "tiff", "las", "ply", "mvtec3d", "recording")
COMMANDS = {  # what writes into OUT
    **{form: f"export WHOLE --to {form} --out OUT/e" for form in FORMS},
    "view": "view WHOLE --out OUT/page.html",
    "lock": "verify WHOLE --lock OUT/a.lock --write",
    "preview": "preview WHOLE --out OUT/scan.png",
    "contact sheet": "preview WHOLE --all --out OUT/scans.png",
    "schema": "schema --out OUT/schema.json",
    "import": "import SCAN --as OUT/r.h5 --pitch-x-mm 0.2 --pitch-y-mm 0.2 --no-check"
    " --picture OUT/r.png",
    "roughness": "roughness SCAN --out OUT/s --pitch-x-mm 0.2 --pitch-y-mm 0.2 --no-noise",
    "pod": "pod WHOLE --out OUT/pod.html",
}


SLOW = ("preview", "roughness", "pod")  # many writes of pictures


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in COMMANDS],
)
def test_what_stands_is_whole(name, whole, tmp_path, capsys):
    folder = tmp_path / "out"
    folder.mkdir()
    scan = tmp_path / "scan.csv"
    scan.write_text("\n".join(",".join(f"{v:.4f}" for v in row) for row in plate()))
    places = {"OUT": folder, "WHOLE": whole, "SCAN": scan}
    words = COMMANDS[name].split()
    for key, place in places.items():
        words = [word.replace(key, str(place)) for word in words]
    assert main(words) == 0, capsys.readouterr().err  # fonts and compiled code are cached once
    shutil.rmtree(folder)
    folder.mkdir()
    clean = Faults()
    with failing(clean):
        code = main(words)
    assert code == 0, capsys.readouterr().err
    wanted = contents(folder)
    refused = 0
    for number in range(clean.count):
        shutil.rmtree(folder)
        folder.mkdir()
        capsys.readouterr()
        faults = Faults(number, CODES[number % 2])
        with failing(faults):
            code = main(words)
        answered(code, capsys, faults)
        found = contents(folder)
        assert {key: wanted.get(key) for key in found} == found, (number, faults.what)
        refused += code == 2
        if code == 0:
            assert found == wanted, (number, faults.what)
    assert refused > clean.count // 2
