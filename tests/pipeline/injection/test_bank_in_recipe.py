"""A recipe that draws from a bank: same bytes for any number of workers, one line where wrong."""

import json

import pandas as pd
import pytest

from files.errors import RecipeError
from flawforge.cli import main
from pipeline.batch.backend import Backend
from pipeline.batch.run import generate
from pipeline.recipe import Recipe
from tests.support.reliefs import hollow_and_rim

FLAWS = """\
flaws:
  bank: {path: bank, number: 1, scale: {uniform: [0.8, 1.5]}, mirror: true, bend_deg: 5,
         tiers: {small: {scale: 0.5}, large: {weight: 2, scale: 1.0}}}
motion:"""


def with_bank(recipe_path, flaws=FLAWS):
    folder = recipe_path.parent
    (folder / "bank").mkdir(exist_ok=True)
    hollow_and_rim().reliefs[0].save(folder / "bank" / "hollow.npz")
    text = recipe_path.read_text()
    start, end = text.index("flaws:"), text.index("motion:")
    recipe_path.write_text(text[:start] + flaws + text[end + len("motion:") :])
    return recipe_path


def test_same_bytes_for_any_number_of_workers(recipe_path, tmp_path):
    recipe = Recipe.load(with_bank(recipe_path))
    one = generate(recipe, tmp_path / "one")
    two = generate(recipe, tmp_path / "two", backend=Backend(jobs=2))
    assert one["shards"] == two["shards"]
    assert len(one["files"]["bank/hollow.npz"]) == 64
    assert one["statistics"]["by_class"]["bank"]["seen"] > 0
    flaws = pd.read_parquet(tmp_path / "one" / "flaws.parquet")
    assert set(flaws["source"]) == {"hollow"}
    assert set(flaws["size_mirror"]) <= {0.0, 1.0}
    small, large = (flaws[flaws["tier"] == tier]["size_scale"] for tier in ("small", "large"))
    assert small.empty or small.max() <= 0.75
    assert large.empty or large.min() >= 0.8


def test_another_file_in_the_bank_is_another_dataset(recipe_path, tmp_path):
    path = with_bank(recipe_path)
    generate(Recipe.load(path), tmp_path / "out")
    hollow_and_rim(depth_mm=0.3).reliefs[0].save(path.parent / "bank" / "hollow.npz")
    with pytest.raises(RecipeError):
        generate(Recipe.load(path), tmp_path / "out")


@pytest.mark.parametrize(
    ("bank", "said"),
    [
        ("{number: 1}", "bank.path': None must be the folder of a bank"),
        ("{path: nowhere}", "holds no flaws"),
        ("{path: ../..}", "leads outside the recipe's folder"),
        ("{path: bank, scale: 100}", "bank.scale"),
        ("{path: bank, depth_mm: 1}", "bank.depth_mm': unknown key"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(recipe_path, capsys, bank, said):
    path = with_bank(recipe_path, f"flaws:\n  bank: {bank}\nmotion:")
    assert main(["generate", str(path), "--out", str(path.parent / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_file_that_is_no_flaw_is_named(recipe_path, capsys):
    path = with_bank(recipe_path)
    (path.parent / "bank" / "wrong.npz").write_bytes(b"nothing")
    assert main(["generate", str(path), "--out", str(path.parent / "out")]) == 2
    assert "wrong.npz: isn't a relief of a flaw" in capsys.readouterr().err


def test_the_recipe_that_is_kept_can_be_run_again(recipe_path):
    used = Recipe.load(with_bank(recipe_path)).as_used()
    assert json.loads(json.dumps(used))["flaws"]["bank"]["path"] == "bank"
