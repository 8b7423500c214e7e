"""`challenge baseline`: a gradient-boosted classifier, trained on the calibration population."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from challenge.baseline.features import features
from challenge.judging.score import SWITCHES
from challenge.judging.side_answers import BOOSTED
from challenge.sets.sealed import commitments_of, write_whole

MATCH = "match"
"""Class of recordings that the nominal model explains."""
OFFERED = 0.1
"""Probability from which a name is offered beside the first."""
TREES = {"max_iter": 80, "learning_rate": 0.1, "min_samples_leaf": 3, "max_leaf_nodes": 8}
"""Of the library's classifier; chosen before any set was judged, never searched over."""


def baseline(out: Path, train: Path) -> int:
    """Answer every case of a set by a classifier trained on an opened population.

    Parameters
    ----------
    out
        Folder of the sealed set; gets ``answers-boosted/``.
    train
        Folder that `challenge calibrate` made.

    Raises
    ------
    ValueError
        Where the population or the library is missing.
    """
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
    except ImportError as error:
        raise ValueError(
            "challenge baseline needs scikit-learn: pip install 'flawforge[payoff]'"
        ) from error
    population = train / "population.json"
    if not population.exists():
        raise ValueError(f"{train} has no population.json: finish `challenge calibrate` first")
    plan = json.loads(population.read_text())
    rows, labels = [], []
    for name in plan["sets"]:
        secret = json.loads((train / name / "truth.json").read_text())["secret"]
        labels.append(SWITCHES[secret["switches"][0]].accept[0] if secret["switches"] else MATCH)
        rows.append(_kept(train / name, train / name / "features.json"))
    # figures that the population lacks (it has no baselines) can't be learnt from
    names = sorted(n for n in set(rows[0]).union(*rows)
                   if len({r[n] for r in rows if np.isfinite(r.get(n, np.nan))}) > 1)  # fmt: skip
    trees = HistGradientBoostingClassifier(early_stopping=False, random_state=0, **TREES)
    trees.fit(_table(rows, names), labels)
    for case in sorted(commitments_of(out)["cases"]):
        seen = _kept(out / "cases" / case, out / BOOSTED / case / "features.json")
        chances = trees.predict_proba(_table([seen], names))[0]
        said = answer_of(dict(zip(trees.classes_, map(float, chances), strict=True)))
        said["trained_on"] = plan["name"]
        write_whole(out / BOOSTED / case / "diagnosis.json", json.dumps(said, indent=1).encode())
    print(f"answered by a classifier trained on {len(labels)} sets of {plan['name']}", flush=True)
    return 0


def _kept(folder: Path, file: Path) -> dict[str, float]:
    """Figures of a case, from the file where they were computed before."""
    if file.exists():
        kept: dict[str, float] = json.loads(file.read_text())
        return kept
    found = features(folder)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, json.dumps(found).encode())
    return found


def _table(rows: list[dict[str, float]], names: list[str]) -> Any:
    return np.array([[row.get(name, np.nan) for name in names] for row in rows])


def answer_of(chances: dict[str, float]) -> dict[str, Any]:
    """Write class probabilities in the form of diagnosis.json."""
    first = max(chances, key=lambda name: chances[name])
    named = {n: p for n, p in chances.items() if n != MATCH}
    if first == MATCH:
        return {"verdict": MATCH, "effects": []}
    others = sorted((n for n in named if n != first and named[n] >= OFFERED), key=named.__getitem__)
    return {
        "verdict": "explained",
        "effects": [
            {"name": first, "probability": named[first], "heldout_gain": named[first],
             "alternatives": [{"name": n, "probability": named[n]} for n in reversed(others)]},
        ],
    }  # fmt: skip
