"""A surface in the sensor's readings: roughness figures, and the noise that reproduces them."""

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path

from files.errors import RecipeError
from files.plain_data import plain
from files.record import parse, record
from files.whole_file import write_whole
from files.yaml_document import dump_yaml, load_yaml
from quantity import quantity
from sensors.datasheet import preset_path
from sensors.noise.calibration import METHOD, Solution, calibrate
from sensors.noise.heights import HeightMap
from sensors.noise.measured_field import MeasuredField
from sensors.noise.noise_target import NoiseTarget
from sensors.noise.perlin import PerlinField
from sensors.noise.speckle import Speckle
from sensors.surface.roughness import FIGURES


@record
class Calibration:
    """Parameters of the noise that were solved for a surface's figures (`calibration`).

    `inputs` identifies figures, pitch, window and method of the solution. A surface with changed
    figures is calibrated again. `worst_error` is the largest residual relative error of a figure.
    """

    inputs: str
    worst_error: float = quantity("largest residual relative error of a figure", low=0)
    z_resolution_um: float = quantity("resolution ΔZ of the solution", unit="µm", low=0)
    repeatability_um: float = quantity(
        "repeatability of the solution", unit="µm", low=0, default=0.0
    )
    cutoff_mm: float | None = quantity(
        "cut-off wavelength of the profile filter", unit="mm", low=0, above=True, default=None
    )
    cell_x_mm: float = quantity(
        "cell of the noise along the laser line", unit="mm", low=0, above=True
    )
    cell_y_mm: float = quantity("cell of the noise along the travel", unit="mm", low=0, above=True)
    octaves: int = quantity("octaves of the noise", low=1, whole=True)
    persistence: float = quantity("amplitude ratio of successive octaves", low=0, high=1)
    knots: tuple[float, ...]
    heights_mm: tuple[float, ...]

    def __post_init__(self) -> None:
        HeightMap(knots=self.knots, values=self.heights_mm)

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
class MeasuredNoise:
    """Autocorrelation and heights of a recorded plate's noise (`measured`).

    `correlation` holds at lags of whole steps; rows are lags along the travel, 1 is in the middle.
    """

    step_x_mm: float = quantity(
        "step of the correlation's lags along the laser line", unit="mm", low=0, above=True
    )
    step_y_mm: float = quantity(
        "step of the correlation's lags along the travel", unit="mm", low=0, above=True
    )
    correlation: tuple[tuple[float, ...], ...]
    knots: tuple[float, ...]
    heights_mm: tuple[float, ...]

    def __post_init__(self) -> None:
        self.field()

    @classmethod
    def of(cls, field: MeasuredField) -> "MeasuredNoise":
        """Keep a field, rounded as files hold it."""
        assert field.heights is not None
        return cls(
            step_x_mm=float(f"{field.cell_x_mm:.6g}"), step_y_mm=float(f"{field.cell_y_mm:.6g}"),
            correlation=field.correlation, knots=field.heights.knots,
            heights_mm=field.heights.values,
        )  # fmt: skip

    def field(self) -> MeasuredField:
        """Return the noise in mm."""
        return MeasuredField(
            amplitude_mm=1.0, cell_x_mm=self.step_x_mm, cell_y_mm=self.step_y_mm,
            correlation=self.correlation,
            heights=HeightMap(knots=self.knots, values=self.heights_mm),
        )  # fmt: skip


@record
class Surface:
    """Roughness figures of a surface, profile by profile and averaged (surface.yaml).

    The three that the paper's model needs are required. Figures hold at the pitch given (without
    one, at that of the scan) and in windows of `profiles` by `points_per_profile` (the paper's,
    100 by 501, where none is given). Where a plate's noise was `measured`, the speckle has its
    autocorrelation and heights, and the figures only describe it.
    """

    name: str
    ra_mm: float | None = quantity(
        "Ra, mean deviation from the mean line", unit="mm", low=0, above=True, default=None
    )
    rq_mm: float | None = quantity(
        "Rq, root mean square deviation", unit="mm", low=0, above=True, default=None
    )
    rp_mm: float | None = quantity(
        "Rp, highest peak", unit="mm", low=0, above=True, default=None
    )
    rv_mm: float | None = quantity(
        "Rv, deepest valley", unit="mm", low=0, above=True, default=None
    )
    rpm_mm: float = quantity("Rpm, mean of the ten highest readings", unit="mm", low=0, above=True)
    rvm_mm: float = quantity("Rvm, mean of the ten lowest readings", unit="mm", low=0, above=True)
    pc_per_mm: float = quantity("Pc, peaks per mm", unit="1/mm", low=0, above=True)
    pitch_x_mm: float | None = quantity(
        "pitch of the points at which the figures hold",
        unit="mm", low=0, above=True, default=None,
    )
    pitch_y_mm: float | None = quantity(
        "pitch of the profiles at which the figures hold",
        unit="mm", low=0, above=True, default=None,
    )
    points_per_profile: int | None = quantity(
        "points of the windows in which the figures hold", low=16, whole=True, default=None
    )
    profiles: int | None = quantity(
        "profiles of the windows in which the figures hold", low=1, whole=True, default=None
    )
    source: str | None = None
    calibration: Calibration | None = None
    measured: MeasuredNoise | None = None

    @classmethod
    def load(cls, source: str | Path) -> "Surface":
        """Read a surface.yaml, or a preset by its name.

        Raises
        ------
        RecipeError
            For an unknown file or preset, or a file that is no surface.
        """
        return parse(cls, load_yaml(preset_path("surfaces", source, "surface")))

    def save(self, path: str | Path) -> None:
        """Write the surface in the form that `load` reads, without unknown values."""
        write_whole(path, dump_yaml(_without_none(plain(self))))

    @property
    def is_calibrated(self) -> bool:
        """Whether the noise is a measured one, or its calibration was solved for these figures."""
        if self.measured is not None:
            return True
        return self.calibration is not None and self.calibration.inputs == self._inputs()

    def ready(
        self,
        pitch_x_mm: float | None = None,
        pitch_y_mm: float | None = None,
        *,
        z_resolution_um: float = 3.8,
        repeatability_um: float = 0.0,
    ) -> "Surface":
        """Return this surface with a calibration for its figures; solve it where necessary.

        Parameters
        ----------
        pitch_x_mm, pitch_y_mm : float, optional
            The scan's pitch, used where the surface states none.
        z_resolution_um, repeatability_um : float
            The sensor's, by which the simulated readings are blurred and rounded (equation 10).

        Raises
        ------
        RecipeError
            Without a pitch, or where no noise at that pitch has these figures.
        """
        surface = replace(
            self,
            pitch_x_mm=self.pitch_x_mm or pitch_x_mm,
            pitch_y_mm=self.pitch_y_mm or pitch_y_mm or self.pitch_x_mm or pitch_x_mm,
        )
        if surface.is_calibrated:
            return surface
        where = f"surface '{self.name}'"
        if surface.pitch_x_mm is None or surface.pitch_y_mm is None:
            raise RecipeError("figures refer to a pitch; key 'pitch_x_mm' is missing", where=where)
        try:
            solution = calibrate(
                NoiseTarget(
                    **{name: getattr(surface, name) for name in FIGURES},
                    pitch_x_mm=surface.pitch_x_mm,
                    pitch_y_mm=surface.pitch_y_mm,
                    points=surface.points_per_profile or 501,
                    profiles=surface.profiles or 100,
                    resolution_mm=z_resolution_um / 1000.0,
                    repeatability_mm=repeatability_um / 1000.0,
                )
            )
        except ValueError as error:
            raise RecipeError(str(error), where=where) from None
        return surface.with_solution(solution, z_resolution_um, repeatability_um)

    def with_solution(
        self,
        solution: Solution,
        z_resolution_um: float,
        repeatability_um: float = 0.0,
        cutoff_mm: float | None = None,
    ) -> "Surface":
        """Return this surface with the noise that was solved for it."""
        noise = solution.field
        assert noise.heights is not None
        calibration = Calibration(
            inputs=self._inputs(),
            worst_error=float(f"{solution.worst_error:.2g}"),
            z_resolution_um=z_resolution_um,
            repeatability_um=repeatability_um,
            cutoff_mm=cutoff_mm,
            cell_x_mm=float(f"{noise.cell_x_mm:.6g}"),
            cell_y_mm=float(f"{noise.cell_y_mm:.6g}"),
            octaves=noise.octaves,
            persistence=float(f"{noise.persistence:.6g}"),
            knots=noise.heights.knots,
            heights_mm=tuple(float(f"{h:.6g}") for h in noise.heights.values),
        )
        return replace(self, calibration=calibration)

    def _inputs(self) -> str:
        values = {name: getattr(self, name) for name in FIGURES}
        values |= {"pitch_x_mm": self.pitch_x_mm, "pitch_y_mm": self.pitch_y_mm}
        rounded = {k: None if v is None else float(f"{v:.7g}") for k, v in values.items()}
        window = [self.profiles or 100, self.points_per_profile or 501]
        text = json.dumps([METHOD, rounded, window], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def field(self, *, verbatim: bool = False, normalised: bool = False) -> Speckle:
        """Return the speckle noise of this surface: measured, or calibrated unless `verbatim`.

        Without a stored calibration the method solves one, which takes seconds: call `ready` once
        before generating many scans.

        Parameters
        ----------
        verbatim : bool
            The paper's model to the letter (equation 9): amplitude max(Rpm, Rvm), as many control
            points as peaks in both directions, 4 octaves, persistence 0.5, all lattices aligned.
        normalised : bool
            With `verbatim`: read "amplitude" as the reach of one octave, whose largest value
            with unit gradients is sqrt(1/2), so that it is scaled by sqrt(2).
        """
        if verbatim:
            return PerlinField(
                amplitude_mm=max(self.rpm_mm, self.rvm_mm) * (math.sqrt(2.0) if normalised else 1),
                cell_x_mm=1.0 / self.pc_per_mm,
                cell_y_mm=1.0 / self.pc_per_mm,
                octaves=4,
                persistence=0.5,
                aligned=True,
            )
        if self.measured is not None:
            return self.measured.field()
        calibration = self.ready().calibration
        assert calibration is not None
        return calibration.field()


def _without_none(data: object) -> object:
    if isinstance(data, dict):
        return {key: _without_none(value) for key, value in data.items() if value is not None}
    return data
