"""A surface as the sensor sees it: its roughness figures and the noise that reproduces them."""

import math
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le

from sensors.datasheet import preset_path
from sensors.heights import HeightMap
from sensors.perlin import PerlinField
from sensors.typed_yaml import dump_yaml, load_yaml, parse, plain, record

Positive = Annotated[float, Gt(0)]


@record
class Calibration:
    """Parameters of the noise that were solved for a surface's figures (sensors/calibration.py).

    `inputs` names what they were solved for: figures, pitch, uncertainty and method. A surface
    whose figures were changed since then is calibrated anew.
    """

    inputs: str
    cell_x_mm: Positive
    cell_y_mm: Positive
    octaves: Annotated[int, Ge(1)]
    persistence: Annotated[float, Ge(0), Le(1)]
    knots: tuple[float, ...]
    heights_mm: tuple[float, ...]

    def field(self) -> PerlinField:
        """Return the noise in mm."""
        return PerlinField(
            amplitude_mm=1.0,
            cell_x_mm=self.cell_x_mm,
            cell_y_mm=self.cell_y_mm,
            octaves=self.octaves,
            persistence=self.persistence,
            heights=HeightMap(knots=self.knots, values=self.heights_mm),
        )


@record
class Surface:
    """Roughness figures of a surface, profile by profile and averaged (surface.yaml).

    The three that the paper's model needs are required; figures hold at the pitch given (without
    one, at that of the scan).
    """

    name: str
    rpm_mm: Positive
    rvm_mm: Positive
    pc_per_mm: Positive
    ra_mm: Positive | None = None
    rq_mm: Positive | None = None
    rp_mm: Positive | None = None
    rv_mm: Positive | None = None
    pitch_x_mm: Positive | None = None
    pitch_y_mm: Positive | None = None
    source: str | None = None
    calibration: Calibration | None = None

    @classmethod
    def load(cls, source: str | Path) -> "Surface":
        """Read a surface.yaml, or a preset by its name.

        Raises
        ------
        RecipeError
            Where there is no such file or preset, or the file isn't a surface.
        """
        return parse(cls, load_yaml(preset_path("surfaces", source, "surface")))

    def save(self, path: str | Path) -> None:
        """Write the surface in the form that `load` reads, without what isn't known."""
        known = {key: value for key, value in plain(self).items() if value is not None}
        Path(path).write_text(dump_yaml(known), encoding="utf-8")

    def field(self, *, verbatim: bool = False, normalised: bool = False) -> PerlinField:
        """Return the speckle noise of this surface.

        Parameters
        ----------
        verbatim : bool
            The paper's model to the letter (equation 9): amplitude max(Rpm, Rvm), as many control
            points as peaks in both directions, 4 octaves, persistence 0.5, all lattices aligned.
        normalised : bool
            With `verbatim`: read "amplitude" as the reach of one octave, whose largest value
            with unit gradients is sqrt(1/2), so that it is scaled by sqrt(2).
        """
        if verbatim or self.calibration is None:
            return PerlinField(
                amplitude_mm=max(self.rpm_mm, self.rvm_mm) * (math.sqrt(2.0) if normalised else 1),
                cell_x_mm=1.0 / self.pc_per_mm,
                cell_y_mm=1.0 / self.pc_per_mm,
                octaves=4,
                persistence=0.5,
                aligned=True,
            )
        return self.calibration.field()
