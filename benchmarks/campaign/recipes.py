"""Mutated recipes, sensors and surfaces: each is answered in one line, or makes its few scans."""

from pathlib import Path

import numpy as np
import yaml

from benchmarks.campaign.sandbox import Outcome, run
from tests.support.mutation import LINES, of_bytes, of_data
from tests.support.small_recipe import RECIPE, SENSOR, SURFACE


def case(folder: Path, rng: np.random.Generator) -> Outcome:
    """Mutate one of the three files and generate."""
    files = {"recipe.yaml": RECIPE, "sensor.yaml": SENSOR, "surface.yaml": SURFACE}
    for name, data in files.items():
        (folder / name).write_text(yaml.safe_dump(data, sort_keys=False))
    name = str(rng.choice(["recipe.yaml"] * 4 + ["sensor.yaml", "surface.yaml"]))
    path = folder / name
    way = rng.uniform()
    if way < 0.6:
        text = yaml.dump(of_data(files[name], rng), sort_keys=False, allow_unicode=True)
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
    elif way < 0.9:
        path.write_bytes(of_bytes(path.read_bytes(), rng))
    else:
        line = LINES[int(rng.integers(len(LINES)))]
        before = path.read_text()
        path.write_text(line + before if rng.uniform() < 0.5 else before + line)
    return run(["generate", "recipe.yaml", "--out", "out"], folder)
