"""One world's trial: render, seal the test, diagnose, simulate, train, open the test, score."""

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases.seeds import child, number
from challenge.payoff import convolutional, second_worlds, segmenter, worlds
from challenge.payoff.family import Family, Ready
from challenge.payoff.gap import TRAINED_ON
from challenge.payoff.precision import tally_flaws, tally_points
from challenge.payoff.simulate import flawforge, generate, write_artwork, write_parts
from challenge.payoff.specimens import Specimen
from challenge.runs.run import command
from challenge.sets.sealed import write_whole

STRANGER = ("a.h5", "b.h5", "c.h5", "plate-1.h5", "plate-2.h5", "part.stl", "sensor.yaml")


@dataclass(frozen=True, kw_only=True, slots=True)
class Effort:
    """How much is made.

    Attributes
    ----------
    training, test
        Specimens of each world.
    seeds
        Segmenters trained on each set; every one draws half of the specimens.
    """

    training: int = 16
    test: int = 10
    seeds: int = 4


FAMILIES: dict[str, Family] = {"first": worlds, "second": second_worlds}
SIMULATED = {
    "plain": ("sensor.yaml", "surface.yaml"),
    "noise": ("sensor.yaml", "noise.yaml"),
    "diagnosed": ("diagnosed.yaml", "surface.yaml"),
    "both": ("diagnosed.yaml", "noise.yaml"),
}
"""Sensor and surface of each simulated set."""


Labelled = tuple[NDArray[np.float32], NDArray[np.int16]]


@dataclass(frozen=True, kw_only=True, slots=True)
class Segmenter:
    """How a segmenter describes a scan, learns, and how suspicious it finds each point."""

    describe: Callable[[NDArray[np.floating]], NDArray[np.float32]]
    train: Callable[[list[Labelled], np.random.Generator], Any]
    suspicion: Callable[[Any, NDArray[np.float32]], NDArray[np.float32]]


SEGMENTERS = {
    "boosted": Segmenter(
        describe=segmenter.features, train=segmenter.train, suspicion=segmenter.suspicion
    ),
    "convolutional": Segmenter(
        describe=convolutional.inputs, train=convolutional.train,
        suspicion=convolutional.suspicion,
    ),
}  # fmt: skip
SMALL = Effort(training=4, test=3, seeds=2)


def render(family: str, name: str, seed: int, effort: Effort, out: Path) -> dict[str, str]:
    """Render a world's recordings and seal the test; returns the digests of the sealed files."""
    folder = out / name
    sealed = folder / "sealed"
    done = folder / "commitment.json"
    if not done.exists():
        sealed.mkdir(parents=True, exist_ok=True)
        of = FAMILIES[family]
        world = of.ready(name, seed)
        of.write_stranger(world, folder / "stranger")
        for k in range(effort.training):
            _keep(folder / "training" / f"{k:03d}.npz", of, world, "train", k)
        digests = {}
        for k in range(effort.test):
            file = sealed / f"{k:03d}.npz"
            _keep(file, of, world, "test", k)
            digests[file.name] = hashlib.sha256(file.read_bytes()).hexdigest()
        write_whole(done, json.dumps(digests, indent=1).encode())
        print(f"{name}: rendered, test sealed", flush=True)
    return dict(json.loads(done.read_text()))


def _keep(file: Path, of: Family, world: Ready, purpose: str, k: int) -> None:
    made = of.specimen(world, purpose, k)
    file.parent.mkdir(exist_ok=True)
    np.savez(
        file, depth=of.scan(world, purpose, k, made), instance=made.instance,
        flaws=np.array(json.dumps([[f.kind, f.size] for f in made.flaws])),
    )  # fmt: skip


def diagnose(folder: Path, baselines: Sequence[str] = ()) -> None:
    """Measure the accepted noise and diagnose the stranger's recordings, as a stranger would.

    The noise of the plate is measured twice: Perlin noise with its figures (``surface.yaml``), and
    a field with its autocorrelation (``noise.yaml``).

    Where there is no answer, the plain sensor stays in place of a diagnosed one.
    """
    there = folder / "diagnose"
    if not (there / "surface.yaml").exists():
        there.mkdir(exist_ok=True)
        for file in (*STRANGER, *(f"{name}.h5" for name in baselines)):
            shutil.copyfile(folder / "stranger" / file, there / file)
        flawforge(["roughness", "plate-1.h5", "--cutoff-mm", "2.5", "--sensor", "sensor.yaml",
                   "--out", "roughness"], there)  # fmt: skip
        flawforge(["roughness", "plate-1.h5", "--speckle", "measured", "--sensor", "sensor.yaml",
                   "--out", "noise"], there)  # fmt: skip
        shutil.copyfile(there / "noise" / "surface.yaml", there / "noise.yaml")
        shutil.copyfile(there / "roughness" / "surface.yaml", there / "surface.yaml")
    if not (there / "answer.json").exists():
        words = command(["a.h5", "b.h5", "c.h5"], ["plate-1.h5", "plate-2.h5"],
                        [f"{name}.h5" for name in baselines])  # fmt: skip
        try:
            flawforge(words[words.index("diagnose") :], there)
            found = json.loads((there / "diagnosis" / "diagnosis.json").read_text())
            answer = {"verdict": found["verdict"], "effects": [e["name"] for e in found["effects"]]}
            shutil.copyfile(there / "diagnosis" / "sensor.yaml", there / "diagnosed.yaml")
        except ValueError as error:
            answer = {"verdict": "no answer", "effects": [], "said": str(error)}
            shutil.copyfile(there / "sensor.yaml", there / "diagnosed.yaml")
        write_whole(there / "answer.json", json.dumps(answer).encode())


def simulate(
    of: Family, world: Ready, made: list[Specimen], folder: Path
) -> dict[str, list[Any]]:
    """Simulate the training specimens with each sensor and surface."""
    there = folder / "simulated"
    write_parts(there / "parts", made)
    for file in {name for pair in SIMULATED.values() for name in pair}:
        shutil.copyfile(folder / "diagnose" / file, there / file)
    artwork, pattern = None, of.pattern(world)
    if pattern is not None:
        artwork = "artwork.png"
        write_artwork(there / artwork, pattern)
    return {
        # one seed: sets that share sensor and surface are equal
        name: generate(there, name, made, seed=number(world.secret.seed, "simulated"),
                       sensor=sensor, surface=surface, columns=of.columns(world), artwork=artwork)
        for name, (sensor, surface) in SIMULATED.items()
    }  # fmt: skip


def fit(
    kind: str, described: dict[str, list[Labelled]], seed: int, effort: Effort
) -> dict[tuple[str, str, int], Any]:
    """Train a segmenter on each set: same specimens, same draws, same seed for all sets."""
    models = {}
    for turn in range(effort.seeds):
        half = child(seed, "half", str(turn)).permutation(effort.training)
        half = np.sort(half[: max(effort.training // 2, 1)])
        for name, scans in described.items():
            rng = child(seed, "segmenter", str(turn))
            models[kind, name, turn] = SEGMENTERS[kind].train([scans[k] for k in half], rng)
    return models


def score(
    models: dict[tuple[str, str, int], Any], folder: Path, digests: dict[str, str]
) -> dict[str, Any]:
    """Open the sealed recordings, check them, and score every segmenter on each.

    Returns
    -------
    dict
        ``points`` and ``flaws``: segmenter, set and seed -> a Tally for each recording; ``seen``:
        kind and size of every flaw in sight; ``shown``: the first recording, for the picture.

    Raises
    ------
    ValueError
        Where a sealed file isn't the one committed to.
    """
    found: dict[str, Any] = {"points": {}, "flaws": {}, "seen": [], "shown": None}
    for file_name, digest in sorted(digests.items()):
        file = folder / "sealed" / file_name
        if hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            raise ValueError(f"{file}: isn't the recording that was sealed")
        with np.load(file) as kept:
            depth, instance = kept["depth"], kept["instance"]
            flaws = tuple((str(k), str(s)) for k, s in json.loads(str(kept["flaws"])))
        described = {kind: each.describe(depth) for kind, each in SEGMENTERS.items()}
        found["seen"] += [flaw for k, flaw in enumerate(flaws) if (instance == k + 1).any()]
        shown = {}
        for key, model in models.items():
            points = SEGMENTERS[key[0]].suspicion(model, described[key[0]])
            found["points"].setdefault(key, []).append(tally_points(points, instance, flaws))
            found["flaws"].setdefault(key, []).append(tally_flaws(points, instance, flaws))
            if key[2] == 0:
                shown["/".join(key[:2])] = points
        if found["shown"] is None:
            found["shown"] = {"depth": depth, "instance": instance, **shown}
    return found


def run_world(family: str, name: str, seed: int, effort: Effort, out: Path) -> Path:
    """Run one world's trial and keep its tallies; continues where it was stopped."""
    folder = out / name
    kept = folder / "tallies.npz"
    if kept.exists():
        return kept
    import threadpoolctl

    segmenter.booster()  # loaded before its threads are limited
    convolutional.one_thread()
    of = FAMILIES[family]
    with threadpoolctl.threadpool_limits(1):
        digests = render(family, name, seed, effort, out)
        diagnose(folder, of.BASELINES)
        answer = json.loads((folder / "diagnose" / "answer.json").read_text())
        print(f"{name}: {answer['verdict']} ({', '.join(answer['effects']) or '-'})", flush=True)
        world = of.ready(name, seed)
        made = [of.specimen(world, "train", k) for k in range(effort.training)]
        sets = simulate(of, world, made, folder)
        print(f"{name}: simulated", flush=True)
        sets["instrument"] = []
        for k, each in enumerate(made):
            with np.load(folder / "training" / f"{k:03d}.npz") as file:
                assert np.array_equal(file["instance"], each.instance)
                sets["instrument"].append(file["depth"])
        models: dict[tuple[str, str, int], Any] = {}
        for kind, method in SEGMENTERS.items():
            described = {
                key: [
                    (method.describe(d), m.instance) for d, m in zip(sets[key], made, strict=True)
                ]
                for key in TRAINED_ON
            }
            models |= fit(kind, described, world.secret.seed, effort)
            print(f"{name}: {kind} segmenters trained", flush=True)
        found = score(models, folder, digests)
    _store(kept, found)
    print(f"{name}: scored", flush=True)
    return kept


def _store(file: Path, found: dict[str, Any]) -> None:
    arrays: dict[str, Any] = {f"shown/{k}": v for k, v in found["shown"].items()}
    arrays["seen"] = np.array(found["seen"])
    for what in ("points", "flaws"):
        for (kind, name, turn), tallies in found[what].items():
            for field in ("hits", "false", "missed"):
                stack = np.stack([getattr(t, field) for t in tallies]).astype(np.int32)
                arrays[f"{kind}/{what}/{name}/{turn}/{field}"] = stack
    aside = file.with_suffix(".part.npz")
    np.savez_compressed(aside, **arrays)
    aside.replace(file)
