"""`challenge judge`: open the keys, check the seals, score every answer."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from challenge.baseline.shuffle import SHUFFLED
from challenge.cases.case import RECORDINGS
from challenge.cases.parameters import true_parameters
from challenge.cases.truth import levelled
from challenge.judging.regions import Mask, drawn_again
from challenge.judging.score import Score, judge_case
from challenge.judging.side_answers import boosted, further, held, none_of_these
from challenge.runs.measure import WAYS
from challenge.sets.populations import VALIDATION, needs_aggregate
from challenge.sets.sealed import commitment, commitments_of


def population_of(out: Path) -> str:
    """Name of the population that a set belongs to."""
    return str(commitments_of(out).get("population", VALIDATION.name))


def judge(out: Path, *, partial: bool = False, aggregate: bool = False) -> dict[str, Any]:
    """Score a set.

    Parameters
    ----------
    partial
        Score the cases answered so far. They are a random draw: cases are sealed, and answered,
        in a random order.
    aggregate
        Keep no case: nothing but the caller's figures leaves the set.

    Returns
    -------
    dict
        ``seed``, ``protocol``, ``sealed`` (how many), and for each case its secret, facts, run,
        answer and score.

    Raises
    ------
    ValueError
        When a seal is broken or the set is not complete, or where a set of a test population is
        to be judged case by case.
    """
    public = commitments_of(out)
    population = population_of(out)
    if needs_aggregate(population) and not aggregate:
        raise ValueError(f"{out} is a test set: it is judged with --aggregate only")
    cases: dict[str, Any] = {}
    again = drawn_again(out)
    for name, listed in sorted(public["cases"].items()):
        key = (out / "keys" / f"{name}.key.json").read_bytes()
        kept = json.loads((out / "keys" / f"{name}.seal.json").read_text())
        if commitment(kept["nonce"], key) != listed["commitment"]:
            raise ValueError(f"{name}: the key is not the one that was committed")
        for file, digest in listed["files"].items():
            found = hashlib.sha256((out / "cases" / name / file).read_bytes()).hexdigest()
            if found != digest:
                raise ValueError(f"{name}/{file} is not the file that was sealed")
        opened = json.loads(key)
        record_file = out / "answers" / name / "run.json"
        if not record_file.exists() and partial:
            continue
        if not record_file.exists():
            raise ValueError(f"{name} has no answer yet: run `challenge run` first")
        record = json.loads(record_file.read_text())
        cases[name] = _case(out, name, opened, record, again.get(name))
    master = json.loads((out / "keys" / "master.json").read_text())
    result = {
        "seed": master["seed"], "family": master.get("family", "first"), "population": population,
        "protocol": public["protocol"], "sealed": len(public["cases"]), "cases": cases,
    }  # fmt: skip
    if not aggregate:
        (out / "scores.json").write_text(json.dumps(result, indent=1))
    return result


def _case(
    out: Path,
    name: str,
    opened: dict[str, Any],
    record: dict[str, Any],
    again: tuple[Mask, Mask] | None = None,
) -> dict[str, Any]:
    secret, facts = opened["secret"], opened["facts"]
    folder = out / "answers" / name
    answer = None
    if record["code"] == 0:
        answer = json.loads((folder / "diagnosis.json").read_text())
    sealed = region = located = fair = other = None
    gain, free, posed = 0.0, 0.0, 0.0
    maps_file = out / "keys" / f"{name}.npz"
    if maps_file.exists():
        if hashlib.sha256(maps_file.read_bytes()).hexdigest() != facts["maps_sha256"]:
            raise ValueError(f"{name}: the maps are not the committed ones")
        maps = np.load(maps_file)
        sealed = region = maps["region"]
        fair = maps["fair"]
    if again is not None:
        region, other = again
    if answer is not None and (folder / "mismatch.h5").exists():
        last = RECORDINGS[secret["recordings"] - 1]
        located, gain, free, posed = compare(
            out / "cases" / name, folder / "mismatch.h5", last, facts, fair
        )
    score: Score = judge_case(secret, facts, answer, located, region, gain)

    def recovered(gained: float) -> float:
        return judge_case(secret, facts, answer, located, region, gained).recovered

    def fits(place: Mask | None, true: Mask | None) -> float:
        return judge_case(secret, facts, answer, place, true, gain).iou

    return {
        "secret": secret,
        "facts": {k: v for k, v in facts.items() if k != "switched"},
        "switched": facts.get("switched", {}),
        "run": record,
        "verdict": answer["verdict"] if answer else "none",
        "effects": answer["effects"] if answer else [],
        "none_of_these": none_of_these(answer),
        "score": asdict(score),
        "intervals": held(true_parameters(facts, tuple(secret["switches"])), answer),
        "further": {way: further(out, way, name, secret) for way in WAYS},
        "boosted": boosted(out, name, secret),
        "sealed_iou": fits(located, sealed) if again else float("nan"),
        "ceiling": fits(other, region) if again else float("nan"),
        "free_form_recovered": recovered(free),
        "pose_recovered": recovered(posed),
        "shuffled": _shuffled(out, name, secret, facts, region, fair),
    }


def _shuffled(
    out: Path,
    name: str,
    secret: dict[str, Any],
    facts: dict[str, Any],
    region: NDArray[np.bool_] | None,
    fair: NDArray[np.bool_] | None,
) -> dict[str, Any] | None:
    """Score the answer to the shuffled recordings where there is one, on the true recording."""
    folder = out / SHUFFLED / name
    if not (folder / "diagnosis.json").exists():
        return None
    answer = json.loads((folder / "diagnosis.json").read_text())
    located, gain = None, 0.0
    if (folder / "mismatch.h5").exists():
        last = RECORDINGS[secret["recordings"] - 1]
        located, gain, _, _ = compare(
            out / "cases" / name, folder / "mismatch.h5", last, facts, fair
        )
    return asdict(judge_case(secret, facts, answer, located, region, gain))


def compare(
    case: Path,
    mismatch: Path,
    last: str,
    facts: dict[str, Any],
    fair: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.bool_], float, float, float]:
    """Read what the answer says about the held-out recording.

    Returns
    -------
    located : (n, m) bool
    gain : float
        ln(RMS of measured - simulated over RMS of measured - explained), clipped at 10 σ.
    free : float
        The same for the baseline: a smooth surface over the sensor's frame, fitted to the
        other recordings' residuals without any physics.
    posed : float
        The same for the baseline that refits the held-out recording's own place once more.
    """
    cut = 1e-2 * float(facts.get("noise_um", 15.0))
    with h5py.File(mismatch) as found:
        group = found[last]
        located = np.asarray(group["mask"], bool)
        simulated = np.asarray(group["simulated"], float)
        explained = np.asarray(group["explained"], float)
        with h5py.File(case / f"{last}.h5") as recording:
            depth = np.asarray(recording["depth"], float)
        use = np.isfinite(depth) & np.isfinite(simulated)
        if fair is not None and fair.shape == use.shape:
            use &= fair
        before = _rms(depth - simulated, use, cut)
        after = _rms(depth - np.where(np.isfinite(explained), explained, simulated), use, cut)
        rests = []
        for other in found:
            if other != last and (case / f"{other}.h5").exists():
                with h5py.File(case / f"{other}.h5") as recording:
                    rest = np.asarray(recording["depth"], float)
                rests.append(rest - np.asarray(found[other]["simulated"], float))
    free = before
    if rests:
        free = _rms(depth - simulated - _smooth(rests, depth.shape, cut), use, cut)
    posed = _rms(levelled(depth - simulated, use, simulated), use, cut)

    def gain(left: float) -> float:
        return float(np.log((before + 1e-9) / (left + 1e-9)))

    return located, gain(after), gain(free), gain(posed)


def _rms(rest: NDArray[np.float64], use: NDArray[np.bool_], cut: float) -> float:
    return float(np.sqrt(np.mean(np.clip(rest[use], -cut, cut) ** 2))) if use.any() else 0.0


def _smooth(
    rests: list[NDArray[np.float64]], shape: tuple[int, ...], cut: float
) -> NDArray[np.float64]:
    """Polynomial of degree 5 over column and profile through other recordings' residuals."""

    def design(rows: int, columns: int) -> NDArray[np.float64]:
        v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
        basis = np.polynomial.legendre.legvander2d(v, u, [5, 5])
        return np.asarray(basis.reshape(rows, columns, -1), np.float64)

    basis, target = [], []
    for rest in rests:
        use = np.isfinite(rest) & (np.abs(rest) < cut)
        basis.append(design(*rest.shape)[use])
        target.append(rest[use])
    found = np.linalg.lstsq(np.concatenate(basis), np.concatenate(target), rcond=None)[0]
    return np.asarray(design(shape[0], shape[1]) @ found)
