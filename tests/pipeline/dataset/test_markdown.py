"""Names from files are text on a dataset's card, whatever they hold."""

import yaml

from pipeline.batch.run import generate
from pipeline.dataset.markdown import as_code, as_text
from pipeline.recipe import Recipe
from tests.support.small_recipe import SENSOR, write_shards

EVIL = "x\n# no\n<img src=x onerror=alert(1)> [a](http://b) ```"


def test_names_are_text():
    assert as_text("AT-C5-4090CS30-495, 1.5 mm") == "AT-C5-4090CS30-495, 1.5 mm"
    assert as_text("a <b>\n*c* [d](http://e)") == r"a \<b\> \*c\* \[d\]\(http\://e\)"


def test_a_fence_is_longer_than_what_it_holds():
    assert as_code("a: 1\n", "yaml") == "```yaml\na: 1\n```"
    assert as_code("a\n````\nb", "yaml").splitlines()[0] == "`````yaml"


def test_the_card_of_a_dataset(tmp_path):
    recipe = write_shards(tmp_path, specimens=1, scans=1)
    (tmp_path / "sensor.yaml").write_text(yaml.safe_dump({**SENSOR, "name": EVIL}))
    generate(Recipe.load(recipe), tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text()
    text, _, code = card.partition("````yaml\n")
    assert "\n# no" not in text
    assert r"\<img" in text
    assert text.count("<") == text.count(r"\<")
    assert "](http" not in text
    assert code.count("\n````\n") == 1
