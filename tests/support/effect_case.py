"""Recordings of a small part that can show one effect, and the workspace of a diagnosis on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from diagnosis.data.patch import cut
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import calibrate
from diagnosis.register.registration import register
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import effect_of
from sensors.effects.effect import Effect
from sensors.recording import Recording
from sensors.surface.reflectance import ReflectanceMap
from tests.support.small_parts import VIEWS, datasheet, part, record

POINTS, PROFILES, PITCH_MM = 100, 72, 0.6
Entry = dict[str, object]


def workspace_of(recordings: Sequence[Recording], scene: Scene, sheet: Datasheet) -> Workspace:
    """Register recordings of a part, their noise calibrated from themselves."""
    laser = Laser.from_datasheet(sheet)
    patches = []
    for k, made in enumerate(recordings):
        valid = np.isfinite(made.depth_mm)
        placed = register(scene, made, laser, datasheet=sheet, valid=valid, sd_mm=0.001)
        patches += cut(k, made, placed, scene, sheet, laser, lateral_mm=0.03)
    noise = calibrate(
        [p.depth_mm - p.plain_mm for p in patches],
        [np.isfinite(p.depth_mm - p.plain_mm) & ~p.edge for p in patches],
        pitch_mm=(0.44, PITCH_MM), missing_share=0.0,
    )  # fmt: skip
    return Workspace.build(patches, replace(noise, tail_share=0.0))


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
        # the true albedo, where there is one, instead of the speckled brightness
        return self.workspace_of([replace(made, intensity=None) for made in self.fitted([])])

    def workspace_of(self, recordings: Sequence[Recording]) -> Workspace:
        """Register recordings, their noise calibrated from themselves."""
        return workspace_of(recordings, self.scene(), self.datasheet())

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
