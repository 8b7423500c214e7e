"""The gallery runs offline in a browser, trusts no name, shows a page at a time."""

import base64
import html
import io
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import flawforge.dataset
from files.errors import RecipeError
from flawforge.cli import main
from pipeline.gallery.page import write_gallery

EVIL = "</script><img src=x onerror=alert(1)>"


def data_of(page: str) -> dict:
    block = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert block is not None
    return json.loads(block[1])


def dom(path: Path, tmp_path: Path) -> str:
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium here to open the page with")
    run = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~",
         f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", path.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return run.stdout


@pytest.fixture(scope="module")
def page(small_dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gallery") / "view.html"
    assert write_gallery(small_dataset, path) == 4
    return path


def test_the_page_holds_what_the_dataset_holds(page: Path, small_dataset: Path) -> None:
    scans = flawforge.dataset.open(small_dataset)
    shown = data_of(page.read_text())["scans"]
    assert [one["id"] for one in shown] == list(scans.manifest["scan_id"])
    for one in shown:
        scan = scans[one["id"]]
        assert {f["number"] for f in one["flaws"]} == {*np.unique(scan["instance"])} - {0}
        for flaw in one["flaws"]:
            assert flaw["pixels"] == (scan["instance"] == flaw["number"]).sum()
        raw = base64.b64decode(one["labels"].partition(",")[2])
        with Image.open(io.BytesIO(raw)) as labels:
            assert labels.size == (one["width"], one["height"])
            assert np.asarray(labels)[..., 3].any()


def test_nothing_is_loaded_from_elsewhere(page: Path) -> None:
    text = page.read_text()
    assert "default-src 'none'" in text
    code = text[: text.index('id="data">')] + text[text.rindex("<script>") :]
    assert not re.search(r"https?:|//[a-z]|import|fetch", code)
    for scan in data_of(text)["scans"]:
        assert scan["relief"].startswith("data:image/webp;base64,")


def test_a_second_run_gives_the_same_page(page: Path, small_dataset: Path, tmp_path: Path) -> None:
    write_gallery(small_dataset, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == page.read_bytes()


@pytest.mark.slow
def test_chromium_shows_it_from_a_file(page: Path, tmp_path: Path) -> None:
    seen = dom(page, tmp_path)
    assert seen.count("<figure") == 4
    assert ">4 of 4</output>" in seen
    assert ">page 1 of 1</output>" in seen
    assert "<td>dent</td>" in seen
    assert seen.count('<option value="train">') == 1


@pytest.mark.slow
def test_chromium_shows_sixty_of_many(page: Path, tmp_path: Path) -> None:
    text = page.read_text()
    data = data_of(text)
    many = json.dumps({**data, "scans": data["scans"] * 50}).replace("<", "\\u003c")
    block = text.index('id="data">') + len('id="data">')
    end = text.index("</script>", block)
    path = tmp_path / "many.html"
    path.write_text(text[:block] + many + text[end:])
    seen = dom(path, tmp_path)
    assert seen.count("<figure") == 60
    assert ">page 1 of 4</output>" in seen


@pytest.mark.slow
def test_names_are_text(small_dataset: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(small_dataset, folder)
    facts = json.loads((folder / "dataset.json").read_text())
    (folder / "dataset.json").write_text(json.dumps({**facts, "name": EVIL}))
    table = pd.read_parquet(folder / "manifest.parquet")
    table["part"] = EVIL  # a slash may lead out of the dataset: such a table isn't read
    table.to_parquet(folder / "manifest.parquet")
    with pytest.raises(RecipeError, match="isn't a plain name"):
        write_gallery(folder, tmp_path / "view.html")
    part = EVIL.replace("/", "")
    table["part"] = part
    table.to_parquet(folder / "manifest.parquet")
    write_gallery(folder, tmp_path / "view.html")
    seen = dom(tmp_path / "view.html", tmp_path)
    assert "<img src=" not in re.sub(r'<img class="\w+" src="data:[^"]*"', "", seen)
    assert html.escape(EVIL, quote=False) in seen
    assert html.escape(part, quote=False) in seen
    assert seen.count("<figure") == 4


def test_the_commands(
    small_dataset: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(small_dataset)]) == 0
    assert capsys.readouterr().out == f"{small_dataset.name}.html: 4 scans\n"
    assert (tmp_path / f"{small_dataset.name}.html").is_file()
    assert main(["view", str(small_dataset), "--out", str(tmp_path / "v.html")]) == 0
    assert "v.html: 4 scans" in capsys.readouterr().out
    assert main(["view", str(small_dataset), "--out", "v.pdf"]) == 2
    error = capsys.readouterr().err
    assert "--out: not an HTML file name, got 'v.pdf'; allowed: NAME.html" in error
    sheet = tmp_path / "sheet.png"
    assert main(["preview", str(small_dataset), "--all", "--out", str(sheet)]) == 0
    with Image.open(sheet) as image:
        assert min(image.size) > 200
    assert main(["preview", "quickstart", "--all", "--out", str(sheet)]) == 2
    assert "--all requires a dataset" in capsys.readouterr().err
