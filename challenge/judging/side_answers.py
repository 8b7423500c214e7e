"""What an answer says beside its names, and the answers of other methods to the same case."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from challenge.judging.probabilities import stated
from challenge.judging.score import SWITCHES, judge_case
from challenge.runs.measure import answers
from challenge.sets.draw import UNDECIDABLE

BOOSTED = "answers-boosted"
"""Folder of a set with the answers of the gradient-boosted classifier."""


def none_of_these(answer: Mapping[str, Any] | None) -> float | None:
    """Probability that no name is right: a number, or an entry that has one."""
    given = (answer or {}).get("none_of_these")
    if isinstance(given, Mapping):
        given = given.get("probability")
    return None if given is None else float(given)


def held(
    true: Mapping[str, Mapping[str, float]], answer: Mapping[str, Any] | None
) -> list[bool]:
    """Whether each stated interval of a true parameter holds it.

    Parameters
    ----------
    true : effect -> parameter -> value
    """
    found = []
    for effect in (answer or {}).get("effects", []):
        for name, value in true.get(effect["name"], {}).items():
            interval = effect.get("parameters", {}).get(name, {})
            low, high = interval.get("low"), interval.get("high")
            if low is not None and high is not None:
                found.append(bool(low <= value <= high))
    return found


def _answer(folder: Path) -> dict[str, Any] | None:
    file = folder / "diagnosis.json"
    return dict(json.loads(file.read_text())) if file.exists() else None


def further(
    out: Path, way: str, name: str, secret: Mapping[str, Any]
) -> dict[str, bool] | None:
    """Whether a further scan decided an undecidable case; None where none was diagnosed.

    Returns
    -------
    dict
        ``right``: the right name is first; ``alone``: and none of its rivals is offered.
    """
    if secret["kind"] != "undecidable" or not (answers(out, way) / name / "run.json").exists():
        return None
    said = _answer(answers(out, way) / name)
    score = judge_case({**secret, "kind": "one"}, {}, said, None, None, 0.0)
    switch = secret["switches"][0]
    rivals = set(UNDECIDABLE[switch]) - set(SWITCHES[switch].accept)
    right = score.top_1 == 1
    return {"right": right, "alone": right and not rivals & set(score.offered)}


def boosted(out: Path, name: str, secret: dict[str, Any]) -> dict[str, Any] | None:
    """Score the classifier's answer; None where it gave none."""
    said = _answer(out / BOOSTED / name)
    if said is None:
        return None
    score = asdict(judge_case(secret, {}, said, None, None, 0.0))
    return {**score, "stated": stated({"secret": secret, "effects": said["effects"]})}
