"""Scores of one answer against its key, and of a whole set."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from challenge.cases.case import SWITCHES as FIRST
from challenge.cases.switches import Switch
from challenge.second.switches import FAULTS
from challenge.second.world import Fault
from challenge.sets.draw import UNDECIDABLE

SWITCHES: dict[str, Switch | Fault] = {**FIRST, **FAULTS}

# Names without place and oracle of their own: what changes is the noise or the missing points, or
# (a mounting) what the registration takes up before anything is located; a coarse camera, which
# its file states, is the same in the instrument without the effect, and so is its locking.
_PLACELESS = {
    "roughness_level", "anisotropic_lay", "outlier_spikes", "random_dropout", "pose_error",
    "pixel_locking",
}  # fmt: skip
ORACLE_SEES = 8.0
"""Standard deviations from which the held-out recording alone tells an effect from none."""
STRANGE = ("unexplained", "partly_explained")


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """How one answer did; NaN where a figure has no meaning for the case.

    Attributes
    ----------
    reported, offered
        Names of the effects found; those and their alternatives.
    alarm
        Something was found.
    top_1
        The effect with the largest held-out gain is right.
    precision, recall
        Shares, rivals and alternatives counting a half.
    covered, set_size
        The truth is among what was offered; how many names were offered.
    flagged
        The verdict says that physics outside the catalogue is at work.
    left
        What has no name: channel and covariate of each.
    iou, recovered
        Overlap of the located region with the true one; share of the oracle's gain, at most 1.
    """

    reported: tuple[str, ...]
    offered: tuple[str, ...]
    alarm: bool
    top_1: float
    precision: float
    recall: float
    covered: float
    set_size: int
    flagged: bool
    left: tuple[str, ...]
    iou: float
    recovered: float


def has_place(secret: dict[str, Any]) -> bool:
    """Whether what a case hides is in the catalogue and has a place of its own."""
    return secret["kind"] not in ("null", "unknown") and moves_readings(secret)


def moves_readings(secret: dict[str, Any]) -> bool:
    """Whether what a case hides changes the mean of readings beyond what a registration absorbs."""
    return not _PLACELESS & accepted(secret)


def accepted(secret: dict[str, Any]) -> set[str]:
    """Names that are right for what a case hides."""
    return {name for switch in secret["switches"] for name in SWITCHES[switch].accept}


def overlap(one: NDArray[np.bool_], two: NDArray[np.bool_]) -> float:
    """Intersection over union, NaN where both are empty."""
    union = (one | two).sum()
    return float((one & two).sum() / union) if union else float("nan")


def clopper_pearson(hits: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Exact two-sided interval of a share."""
    tail = (1 - level) / 2
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, of - hits + 1))
    high = 1.0 if hits == of else float(beta.ppf(1 - tail, hits + 1, of - hits))
    return low, high


def judge_case(
    secret: dict[str, Any],
    facts: dict[str, Any],
    answer: dict[str, Any] | None,
    located: NDArray[np.bool_] | None,
    region: NDArray[np.bool_] | None,
    gain: float,
) -> Score:
    """Score one answer.

    Parameters
    ----------
    secret, facts
        From the key.
    answer
        diagnosis.json, None where the diagnosis failed.
    located, region
        Mask of the answer and of the truth in the held-out recording.
    gain
        ln(RMS before / RMS after) that the answer reached there.
    """
    effects, left = ((answer or {}).get(key, []) for key in ("effects", "left"))
    ranked = sorted(effects, key=lambda e: -float(e.get("heldout_gain") or 0))
    reported = tuple(str(e["name"]) for e in ranked if e["name"] != "empirical")
    also = {str(a["name"]) for e in ranked for a in e.get("alternatives", [])}
    offered = tuple(dict.fromkeys([*reported, *sorted(also - {"empirical"})]))
    verdict = answer["verdict"] if answer else "none"
    sets = [set(SWITCHES[name].accept) for name in secret["switches"]]
    rivals = {r for name in secret["switches"] for r in SWITCHES[name].rivals}
    if secret["kind"] == "undecidable":
        sets = [{name} for name in UNDECIDABLE[secret["switches"][0]]]
        rivals = set()
    right = set().union(*sets)
    hits = [
        1.0 if accept & set(reported) else 0.5 if accept & set(offered) else 0.0
        for accept in sets
        if accept
    ]
    if secret["kind"] == "undecidable":
        hits = [1.0 if accept & set(offered) else 0.0 for accept in sets]
    worth = [1.0 if n in right else 0.5 if n in rivals else 0.0 for n in reported]
    nan = float("nan")
    known = secret["kind"] not in ("null", "unknown")
    placed = has_place(secret)
    iou = nan
    if region is not None and 0.01 < region.mean() < 0.8 and placed:
        iou = 0.0
        if located is not None and located.shape == region.shape:
            iou = overlap(located, region)
    oracle = float(facts.get("oracle_gain", 0.0))
    return Score(
        reported=reported,
        offered=offered,
        alarm=verdict not in ("match", "none"),
        top_1=float(bool(reported) and reported[0] in right) if known else nan,
        precision=float(np.mean(worth)) if known and worth else nan,
        recall=float(np.mean(hits)) if known and hits else nan,
        covered=float(all(accept & set(offered) for accept in sets)) if known else nan,
        set_size=len(offered),
        flagged=verdict in STRANGE,
        left=tuple(f"{r['channel']} over {r['covariate']}" for r in left),
        iou=iou,
        recovered=float(np.clip(gain / oracle, -1, 1)) if placed and oracle > 0.02 else nan,
    )
