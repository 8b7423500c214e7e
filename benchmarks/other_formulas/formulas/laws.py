"""The catalogue's own laws, with known parameters: coverage of intervals.

The law gives means, sizes and probabilities; noise, files and instrument are the bench's own.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.other_formulas.formulas.base import Apply, Formula, shared
from benchmarks.other_formulas.shot import Shot
from sensors.effects import effect_of
from sensors.model import SensorModel, scan_with
from sensors.view.view import View

Parameters = Callable[[float, int], dict[str, float]]
"""``parameters(size, seed)``: what the law's parameters truly are."""


def _sign(seed: int) -> float:
    return float(shared(seed).choice([-1, 1]))


def _between(seed: int, low: float, high: float) -> float:
    return float(shared(seed, 8).uniform(low, high))


LAWS: dict[str, Parameters] = {
    "line_bow": lambda size, seed: {"sag_um": 20 * size * _sign(seed)},
    "lens_distortion": lambda size, seed: {"tilt_um": 0.0, "cubic_um": 20 * size * _sign(seed)},
    "range_scale": lambda size, seed: {"error_ppm": 2000 * size * _sign(seed)},
    "incidence_bias": lambda size, seed: {
        "signed_um": 10 * size * _sign(seed), "squared_um": 10 * size * _sign(seed + 1),
    },
    "volume_scattering": lambda size, _: {"depth_um": 100 * size},
    "stage_vibration": lambda size, seed: {
        "amplitude_um": 5 * size, "frequency_hz": _between(seed, 8.0, 40.0),
    },
    "travel_ripple": lambda size, seed: {
        "amplitude_um": 30 * size, "period_mm": _between(seed, 3.0, 6.0),
    },
    "random_dropout": lambda size, _: {"share": min(0.03 * size, 0.5)},
    "outlier_spikes": lambda size, _: {"share": min(0.004 * size, 0.1), "width_um": 400.0},
    "incidence_noise": lambda size, _: {"exponent": min(1.0 * size, 4.0)},
}  # fmt: skip
PARTS = ("hills", "freeform", "barrel")


def true_parameters(name: str, size: float, seed: int) -> dict[str, float]:
    """Parameters of a law's case, as a diagnosis would state them."""
    return LAWS[name.removeprefix("law of ")](size, seed)


def _applied(effect: str) -> Apply:
    def apply(shot: Shot, size: float, seed: int) -> Shot:
        entry: dict[str, Any] = {"name": effect, **LAWS[effect](size, seed)}
        scan, sheet = shot.view.scan, shot.view.instrument.sheet
        view = View(
            shot.view.scene, SensorModel(sheet), scan.true_poses, scan.time_s,
            laser=shot.view.laser, start_time_s=scan.start_s,
        )  # fmt: skip

        def rng_of(_stream: str) -> np.random.Generator:
            return shared(seed, 12, shot.index)

        thing = effect_of(entry)
        effects = (thing.draw(rng_of("")),) if thing.undrawn() else (thing,)
        law = scan_with(view, None, effects, rng_of)[1]
        lost = 1 - (1 - np.asarray(shot.p_missing)) * (1 - np.asarray(law.p_missing))
        made = replace(
            shot, mean=shot.mean + law.mean_mm - shot.view.depth, p_missing=lost,
            scale=shot.scale * np.asarray(law.speckle_gain),
        )  # fmt: skip
        if np.any(np.asarray(law.p_outlier) > 0):
            width = law.outlier_sd_mm

            def sizes(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
                return np.asarray(np.max(width) * rng.standard_normal(shape))

            made = replace(made, p_outlier=law.p_outlier, outlier=sizes)
        return made

    return apply


FORMULAS = tuple(
    Formula(name=f"law of {name}", effect=name, apply=_applied(name), parts=PARTS) for name in LAWS
)
