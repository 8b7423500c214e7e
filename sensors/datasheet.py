"""The datasheet of a laser profilometer: the maker's values, and the effects found."""

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from files.errors import RecipeError, known
from files.plain_data import plain
from files.record import parse, record
from files.whole_file import write_whole
from files.yaml_document import dump_yaml, load_yaml
from quantity import quantity

MOST_AXIS_MM = 5000.0
"""How far the optical axis may lie from the sensor's origin: a field of the longest gantry."""


@record
class Datasheet:
    """Parameters of a laser-triangulation profilometer; names end in the unit.

    Unknown values are None; an effect that requires one names the key. A camera whose side isn't
    stated is simulated on +y. `FOV` is equation 2 of Sensors 2023, 23, 7624.
    """

    name: str
    working_distance_mm: float = quantity(
        "distance from the sensor's origin to the middle of its range", unit="mm", low=0, above=True
    )
    z_range_mm: float = quantity("depth of the working range", unit="mm", low=0, above=True)
    x_fov_mm: float = quantity(
        "length of the laser line at the working distance", unit="mm", low=0, above=True
    )
    points_per_profile: int = quantity("points of a profile", low=2, whole=True)
    z_resolution_um: float = quantity(
        "resolution ΔZ: readings are multiples of it; 0: no rounding", unit="µm", low=0
    )
    profile_rate_hz: float = quantity("profiles per second", unit="Hz", low=0, above=True)
    repeatability_um: float | None = quantity(
        "standard deviation of a repeated reading", unit="µm", low=0, default=None
    )
    travel_speed_mm_s: float = quantity(
        "speed along the path", unit="mm/s", low=0, above=True, default=100.0
    )
    columns: Literal["even_angle", "even_x"] = "even_angle"
    optical_axis_x_mm: float = quantity(
        "x of the optical axis, the origin of the fan, in the sensor frame",
        unit="mm", low=-MOST_AXIS_MM, high=MOST_AXIS_MM, default=0.0,
    )
    triangulation_angle_deg: float | None = quantity(
        "angle between laser and camera at the working distance",
        unit="°", low=0, above=True, high=90, below=True, default=None,
    )
    camera_side: Literal["+y", "-y"] | None = None
    line_width_um: float | None = quantity(
        "width of the laser line", unit="µm", low=0, above=True, default=None
    )
    wavelength_nm: float | None = quantity(
        "wavelength of the laser", unit="nm", low=0, above=True, default=None
    )
    exposure_s: float | None = quantity(
        "time during which a profile is exposed", unit="s", low=0, above=True, default=None
    )
    camera_rows: int | None = quantity(
        "camera rows over the working range", low=2, whole=True, default=None
    )
    effects: tuple[dict[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if self.z_range_mm >= 2 * self.working_distance_mm:
            raise ValueError("z_range_mm below twice working_distance_mm")
        for effect in self.effects:
            if not isinstance(effect.get("name"), str):
                raise ValueError("effects that each have a 'name'")

    @classmethod
    def load(cls, source: str | Path) -> "Datasheet":
        """Read a sensor's YAML file, or a preset by its name.

        Raises
        ------
        RecipeError
            For an unknown file or preset, or a file that is no datasheet.
        """
        return parse(cls, load_yaml(preset_path("presets", source, "sensor")))

    def save(self, path: str | Path) -> None:
        """Write the datasheet in the form that `load` reads."""
        write_whole(path, dump_yaml(plain(self)))

    @property
    def fov_rad(self) -> float:
        """Opening angle of the laser fan, radians."""
        return 2 * math.atan(self.x_fov_mm / (2 * self.working_distance_mm))

    def half_line_mm(self, depth_mm: Any) -> Any:
        """Half the length of the laser line at a depth (a number or an array), mm."""
        if self.columns == "even_x":
            return 0 * depth_mm + self.x_fov_mm / 2
        return depth_mm * self.x_fov_mm / (2 * self.working_distance_mm)

    @property
    def line_middle_mm(self) -> float:
        """Sensor x of the middle of the laser line: the fan's axis, 0 of parallel rays, mm."""
        return self.optical_axis_x_mm if self.columns == "even_angle" else 0.0

    @property
    def depth_min_mm(self) -> float:
        """Smallest depth with a valid return, mm."""
        return self.working_distance_mm - self.z_range_mm / 2

    @property
    def depth_max_mm(self) -> float:
        """Largest depth with a valid return, mm."""
        return self.working_distance_mm + self.z_range_mm / 2

    @property
    def step_mm(self) -> float:
        """Depth resolution ΔZ, mm; 0 where the sensor doesn't quantise."""
        return self.z_resolution_um * 1e-3

    @property
    def camera_sign(self) -> int:
        """κ: +1 with the camera on +y, or on a side that isn't stated, -1 on -y."""
        return -1 if self.camera_side == "-y" else 1

    @property
    def camera_offset_mm(self) -> float:
        """The camera's y in the sensor frame, κ·b with b = working_distance·tan θ, mm."""
        angle_deg = self.require("triangulation_angle_deg")
        return self.camera_sign * self.working_distance_mm * math.tan(math.radians(angle_deg))

    def require(self, key: str) -> float:
        """Return an optional number of the datasheet.

        Raises
        ------
        RecipeError
            Where the file does not state the value.
        """
        value = getattr(self, key)
        if value is None:
            raise RecipeError(
                f"key '{key}' is required by this sensor's effects and not stated",
                where=f"sensor '{self.name}'",
            )
        return float(value)


def preset_path(folder: str, source: str | Path, noun: str) -> Path:
    """Return the file that `source` names: a path that exists, else a preset in `folder`.

    Raises
    ------
    RecipeError
        Where it is neither.
    """
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return path
    presets = {Path(str(p)).stem: Path(str(p)) for p in _preset_files(folder)}
    if str(source) not in presets:
        raise RecipeError(
            f"no such {noun}",
            value=str(source),
            **known(str(source), sorted(presets), more="a .yaml file or one of "),
        )
    return presets[str(source)]


def preset_names(folder: str) -> list[str]:
    """Names of the presets in `folder`, sorted."""
    return sorted(Path(str(p)).stem for p in _preset_files(folder))


def _preset_files(folder: str) -> list[Any]:
    place = resources.files("sensors") / folder
    if not place.is_dir():
        return []
    return [p for p in place.iterdir() if p.name.endswith(".yaml")]


def with_effects(datasheet: Datasheet, effects: tuple[Mapping[str, Any], ...]) -> Datasheet:
    """Return the datasheet with `effects` added, each in place of an entry of its name."""
    from dataclasses import replace

    new = {str(effect["name"]): dict(effect) for effect in effects}
    kept = [new.pop(e["name"], e) for e in datasheet.effects]
    return replace(datasheet, effects=(*kept, *new.values()))
