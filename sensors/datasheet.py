"""The datasheet of a laser profilometer: what its maker states, and the effects found on it."""

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Lt

from sensors.typed_yaml import RecipeError, dump_yaml, load_yaml, parse, plain, record

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]


@record
class Datasheet:
    """Parameters of a laser-triangulation profilometer, in the units their names say.

    What a maker doesn't state is None; an effect that needs it says so. `FOV` is equation 2 of
    Sensors 2023, 23, 7624.
    """

    name: str
    working_distance_mm: Positive
    z_range_mm: Positive
    x_fov_mm: Positive
    points_per_profile: Annotated[int, Ge(2)]
    z_resolution_um: NotNegative
    profile_rate_hz: Positive
    repeatability_um: NotNegative | None = None
    travel_speed_mm_s: Positive = 100.0
    columns: Literal["even_angle", "even_x"] = "even_angle"
    triangulation_angle_deg: Annotated[float, Gt(0), Lt(90)] | None = None
    camera_side: Literal["+y", "-y"] = "+y"
    line_width_um: Positive | None = None
    wavelength_nm: Positive | None = None
    exposure_s: Positive | None = None
    camera_rows: Annotated[int, Ge(2)] | None = None
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
            Where there is no such file or preset, or the file isn't a datasheet.
        """
        return parse(cls, load_yaml(preset_path("presets", source, "sensor")))

    def save(self, path: str | Path) -> None:
        """Write the datasheet in the form that `load` reads."""
        Path(path).write_text(dump_yaml(plain(self)), encoding="utf-8")

    @property
    def fov_rad(self) -> float:
        """Opening angle of the laser fan, radians."""
        return 2 * math.atan(self.x_fov_mm / (2 * self.working_distance_mm))

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
        """κ: +1 with the camera on +y, -1 on -y."""
        return 1 if self.camera_side == "+y" else -1

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
            Where the file leaves it out.
        """
        value = getattr(self, key)
        if value is None:
            raise RecipeError(
                f"key '{key}' is needed by this sensor's effects and isn't stated",
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
            allowed="a .yaml file or one of " + ", ".join(sorted(presets)),
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
