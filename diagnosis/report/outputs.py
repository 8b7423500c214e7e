"""What a diagnosis leaves behind: diagnosis.json, mismatch.h5, sensor.yaml, report.html."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from diagnosis.data.albedo import AlbedoPattern
from diagnosis.diagnosis import Diagnosis
from diagnosis.settings import SETTINGS
from files.hdf5_output import created
from files.plain_data import plain
from files.whole_file import write_whole
from sensors.effects import CATALOGUE

FORMAT = "profilometer-diagnosis"


def write_outputs(
    result: Diagnosis,
    folder: Path,
    *,
    part_name: str = "part",
    progress: Callable[[str], None] = lambda _: None,
) -> None:
    """Write the four files into a folder, which is made where it isn't there.

    An albedo pattern that biases readings is written as well, for a recipe.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(plain(as_json(result)), indent=1, ensure_ascii=False)
    write_whole(folder / "diagnosis.json", text + "\n")
    result.datasheet.save(folder / "sensor.yaml")
    with created(folder / "mismatch.h5") as file:
        file.attrs["format"] = "profilometer-mismatch"
        file.attrs["version"] = 1
        for maps in result.maps:
            group = file.create_group(maps.name)
            for key in ("mask", "score", "simulated", "explained"):
                group.create_dataset(
                    key, data=getattr(maps, key), compression="gzip", compression_opts=4
                )
    pattern = result.fit_patches[0].view.scene.reflectance
    biased = any(CATALOGUE[e.name].on_albedo for e in result.effects)
    if biased and isinstance(pattern, AlbedoPattern):
        pattern.save(folder)
    progress("writing the report")
    from diagnosis.report.page import write_report

    write_report(result, folder / "report.html", part_name=part_name)


def as_json(result: Diagnosis) -> dict[str, object]:
    """Return the content of diagnosis.json."""
    rng = np.random.default_rng(result.seed)
    return {
        "format": FORMAT,
        "version": 1,
        "verdict": result.verdict,
        "effects": [
            {
                "name": e.name,
                "statement": e.statement,
                "parameters": {
                    k: estimate.as_json() for k, estimate in e.parameters.items()
                },
                "heldout_gain": e.heldout_gain,
                "covariate": e.covariate,
                "frame": e.frame,
                "probability": e.probability,
                "none_of_these": e.none_of_these,
                "alternatives": [
                    {"name": n, "heldout_gain": g, "probability": p}
                    for n, g, p in e.alternatives
                ],
                "doubt": e.doubt,
            }
            for e in result.effects
        ],
        "none_of_these": result.none_of_these,
        "next_measurements": [m.as_json() for m in result.next_measurements],
        "mismatch": {
            "share_of_points": result.share_of_points,
            "regions": [r.as_json() for r in result.regions],
        },
        "left": [r.as_json() for r in result.left],
        "usual": [r.as_json() for r in result.usual],
        "heldout": {"before": result.before.as_json(rng), "after": result.after.as_json(rng)},
        "recordings": {
            "fitted": list(result.fitted),
            "held_out": list(result.held),
            "baselines": list(result.baselines),
        },
        "assumed": dict(result.assumed),
        "calibration_population": result.population,
        "settings": SETTINGS.as_json(),
        "notes": list(result.notes),
    }
