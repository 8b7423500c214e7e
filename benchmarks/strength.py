"""How strong an effect is in the bench's recordings: whitened signal to noise, sqrt(2 x nats).

Nats are those that the true law gains over the plain one on all fitted readings:

- of bulk physics, expected, the pose projected out;
- of what lives on depth edges, where poses are uncertain, those of simulated recordings;
- of a finish, which changes the noise alone, Kullback and Leibler's of two stationary Gaussian
  fields, 1/2 Σ_k [S1/S0 - 1 - ln(S1/S0)] over their spectra (Whittle 1953);
- of a mounting, 1/2 Σ δᵀ C⁻¹ δ over the recordings, C how parts lie by chance.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from benchmarks.relief import MISPLACED, VIEWS, datasheet, part, record
from diagnosis.edges import EDGE_COVARIATES
from diagnosis.noise import NoiseModel, calibrate
from diagnosis.patch import cut
from diagnosis.prediction import predict
from diagnosis.registration import register
from diagnosis.score import CLIP, placements, whitened
from diagnosis.workspace import Model, Workspace
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import effect_of
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.base import Effect
from sensors.effects.pose_error import PoseError
from sensors.effects.roughness_level import RoughnessLevel
from sensors.noise.uncertainty import sigma_mm
from sensors.recording import Recording
from sensors.surface.reflectance import ReflectanceMap
from sensors.typed_yaml import RecipeError

POINTS, PROFILES, PITCH_MM = 100, 72, 0.6
Entry = dict[str, object]


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """An effect of the bench and the recordings that can show it.

    Attributes
    ----------
    name : of the effect
    scaled : its parameter that makes it stronger
    part : which of the bench's
    more : its other parameters
    sheet : what the sensor's file says otherwise
    views : placings of the recordings, the last held out
    starts_s : when each recording starts, on a common clock
    reflectance : what is printed on the part
    plates : whether two scans of a plate without the effect are given
    """

    name: str
    scaled: str
    part: str
    more: Mapping[str, object] = field(default_factory=dict)
    sheet: Mapping[str, Any] = field(default_factory=dict)
    views: Sequence[Mapping[str, object]] = VIEWS
    starts_s: Sequence[float] | None = None
    reflectance: ReflectanceMap | None = None
    plates: bool = False

    @property
    def count(self) -> int:
        """How many recordings are fitted."""
        return len(self.views) - 1

    def scene(self) -> Scene:
        """Return the part with what is printed on it."""
        return part(self.part).finished(self.reflectance)

    def datasheet(self) -> Datasheet:
        """Return the sensor's file."""
        return replace(datasheet(POINTS), **self.sheet)

    def on(self, name: str) -> "Case":
        """Return the same on another part."""
        return replace(self, part=name)

    def record(self, effects: Sequence[Entry], number: int, **more: Any) -> Recording:
        """Take one of the recordings, with effects in it."""
        start = None if self.starts_s is None else self.starts_s[number]
        given = {"profiles": PROFILES, "pitch_mm": PITCH_MM, "start_time_s": start}
        sheet = more.pop("sheet", self.datasheet())
        return record(self.scene(), sheet, effects, **given, **self.views[number], **more)

    def references(self, seed: int) -> list[Recording]:
        """Take the scans of a plate, without any effect."""
        if not self.plates:
            return []
        plate = replace(self, part="plate", reflectance=None)
        return [plate.record([], k, name=f"plate{k}", seed=seed + 50 + k) for k in range(2)]

    def fitted(self, effects: Sequence[Entry]) -> list[Recording]:
        """Take the recordings that strengths are measured with, the same but for the effects."""
        return [self.record(effects, k, name=f"w{k}", seed=900 + k) for k in range(self.count)]

    @cached_property
    def workspace(self) -> Workspace:
        """The fitted recordings with nothing in them."""
        sheet, scene = self.datasheet(), self.scene()
        laser = Laser.from_datasheet(sheet)
        patches = []
        for k, made in enumerate(self.fitted([])):
            valid = np.isfinite(made.depth_mm)
            placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.001)
            # the true print, where there is one, instead of the speckled brightness
            made = replace(made, intensity=None)
            patches += cut(k, made, placed, scene, sheet, laser, lateral_mm=0.03)
        noise = calibrate(
            [p.depth_mm - p.plain_mm for p in patches],
            [np.isfinite(p.depth_mm - p.plain_mm) & ~p.edge for p in patches],
            pitch_mm=(0.44, PITCH_MM), missing_share=0.0, from_reference=False,
        )  # fmt: skip
        return Workspace.build(patches, replace(noise, tail_share=0.0))

    def taken_with(self, ws: Workspace, effect: Effect) -> Workspace:
        """Return the workspace with the recordings taken again with an effect in them."""
        made = self.fitted([effect.to_mapping()])
        patches = tuple(
            replace(p, depth_mm=r.depth_mm) for p, r in zip(ws.patches, made, strict=True)
        )
        return replace(ws, patches=patches)

    def entry(self, scale: float) -> Entry:
        """Build the effect with its parameter so many times its typical departure from none."""
        described = type(effect_of({"name": self.name})).parameter(self.scaled)
        typical, null = described.typical, described.null
        if isinstance(typical, tuple):
            value: object = [scale * v for v in typical]
        else:
            none = float(null) if isinstance(null, int | float) else 0.0
            size = (float(typical) if isinstance(typical, int | float) and typical else 1.0) - none
            value = float(np.clip(none + scale * size, described.low, described.high))
        return {"name": self.name, **self.more, self.scaled: value}


def plain(name: str) -> Case:
    """Return recordings of one of the bench's parts with nothing in them."""
    return Case(name="", scaled="", part=name)


def bench_workspace(name: str) -> Workspace:
    """Return two recordings of one of the bench's parts with nothing in them."""
    return plain(name).workspace


def taken_with(ws: Workspace, name: str, effect: Effect) -> Workspace:
    """Return a part's `bench_workspace` with the recordings taken again with an effect in them."""
    return plain(name).taken_with(ws, effect)


def strength(case: Case, effect: Entry) -> float:
    """Whitened signal to noise of an effect."""
    thing = effect_of(dict(effect))
    if thing.undrawn():
        thing = thing.draw(np.random.default_rng(0))
    if isinstance(thing, PoseError):
        return _mounting_strength(thing, case.count)
    ws = case.workspace
    if isinstance(thing, RoughnessLevel | AnisotropicLay):
        white = sigma_mm(ws.patches[0].view.datasheet)
        nats = sum(finish_nats(thing, ws.noise, p.shape, white) for p in ws.patches)
    elif thing.covariate in EDGE_COVARIATES:
        nats = _simulated_nats(ws, thing, case)
    else:
        nats = _expected_nats(ws, thing)
    return float(np.sqrt(2 * max(nats, 0.0)))


def finish_nats(
    effect: RoughnessLevel | AnisotropicLay,
    noise: NoiseModel,
    shape: tuple[int, int],
    white_mm: float,
) -> float:
    """Nats between a field (n, m) of the noise and the same with a finish, level known.

    Parameters
    ----------
    white_mm : share of the noise that isn't speckle, standard deviation, mm
    """
    share = min((white_mm / noise.sd_mm) ** 2, 0.99)
    before = noise.spectrum(shape)
    if isinstance(effect, AnisotropicLay):
        after = replace(noise, acf=_drawn_out(noise, effect, share)).spectrum(shape)
    else:
        after = effect.amplitude**2 * (before - share) + share
    least = max(share, 1e-3)
    ratio = np.maximum(after, least) / np.maximum(before, least)
    whole = shape[0] * shape[1] / ratio.size
    return 0.5 * whole * float((ratio - 1 - np.log(ratio)).sum())


def _drawn_out(noise: NoiseModel, lay: AnisotropicLay, white: float) -> NDArray[np.float64]:
    """Autocorrelation with the lay's ellipse, its angle taken from the columns on.

    Parameters
    ----------
    white : share of the variance that the lay leaves alone
    """
    ly, lx = noise.lags
    nugget = np.zeros(noise.acf.shape)
    nugget[ly, lx] = white
    rows, columns = np.mgrid[-ly : ly + 1, -lx : lx + 1].astype(np.float64)
    x, y = columns * noise.pitch_x_mm, rows * noise.pitch_y_mm
    turn = math.radians(lay.angle_deg)
    along = (x * math.cos(turn) + y * math.sin(turn)) / math.sqrt(lay.ratio)
    across = (y * math.cos(turn) - x * math.sin(turn)) * math.sqrt(lay.ratio)
    x, y = (
        along * math.cos(turn) - across * math.sin(turn),
        along * math.sin(turn) + across * math.cos(turn),
    )
    places = [y / noise.pitch_y_mm + ly, x / noise.pitch_x_mm + lx]
    return np.asarray(map_coordinates(noise.acf - nugget, places, order=3) + nugget)


def _mounting_strength(effect: PoseError, recordings: int) -> float:
    """Signal to noise of a mounting against how the bench's parts lie by chance."""
    turns = [math.radians(a) for a in (effect.roll_deg, effect.pitch_deg, effect.yaw_deg)]
    ways = [effect.x_mm, effect.y_mm, effect.z_mm]
    off = np.array([*turns, *ways]) / np.repeat(MISPLACED, 3)
    return float(np.sqrt(recordings * (off @ off)))


def _simulated_nats(ws: Workspace, thing: Effect, case: Case) -> float:
    """Nats that the law of an effect gains on the bench's recordings, taken with it."""
    there = case.taken_with(ws, thing)
    plain, true = (there.log_densities(m) for m in (Model(), Model(effects=(thing,))))
    return float(there.block_scores([t - p for t, p in zip(true, plain, strict=True)]).sum())


def _expected_nats(ws: Workspace, thing: Effect) -> float:
    nats = 0.0
    base = ws.predict(Model())
    raw = [whitened(p, q, ws.noise) for p, q in zip(ws.patches, base, strict=True)]
    signals = []
    for patch, plain, state in zip(ws.patches, base, raw, strict=True):
        other = predict(patch.view, (thing,), ws.noise, softness=patch.softness)
        both = plain.seen & other.seen
        # at an edge one reading may be off by millimetres and still counts as one
        most = np.where(patch.edge, CLIP * plain.sd_mm, 0.3)
        change = np.where(both, np.nan_to_num(other.mean_mm) - np.nan_to_num(plain.mean_mm), 0.0)
        signals.append(
            replace(state, innovations=state.whiten(np.clip(change, -most, most)))
        )
        p, q = other.p_missing, plain.p_missing
        nats += float((p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q)))[plain.seen].sum())
        ratio = (other.sd_mm / plain.sd_mm)[both]
        ratio = ratio / np.exp(np.mean(np.log(ratio)))
        nats += float((0.5 * ratio**2 - 0.5 - np.log(ratio)).sum())
        o, b = other.p_outlier[both], plain.p_outlier[both]
        nats += float((o * np.log(o / b) + (1 - o) * np.log((1 - o) / (1 - b))).sum())
    moved = placements(ws.patches, signals, ws.masks())
    for patch, signal in zip(ws.patches, signals, strict=True):
        rest = signal.innovations - signal.columns @ moved[patch.recording]
        nats += 0.5 * float((rest[signal.used] ** 2).sum())
    return nats


def at_strength(case: Case, wanted: float) -> Entry | None:
    """Scale the effect of a case to a signal to noise; None where its bounds end before."""
    low, high = 1e-4, 30.0
    try:
        if strength(case, case.entry(high)) < wanted:
            return None
        for _ in range(14):
            middle = float(np.sqrt(low * high))
            if strength(case, case.entry(middle)) < wanted:
                low = middle
            else:
                high = middle
    except RecipeError:
        return None
    return case.entry(high)
