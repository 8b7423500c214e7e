"""The recipe: read from YAML and checked before any work."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from annotated_types import Len
from pydantic import PlainValidator

from defects.flaw_bank import FlawBank
from files.errors import RecipeError
from files.plain_data import plain
from files.record import parse, record
from files.yaml_document import Document
from pipeline.dataset.compression import Compression
from pipeline.injection.flawplan import FlawPlan
from pipeline.motion.limits import Motion
from pipeline.parts.builtin import FACET_UM
from pipeline.recipe_checks import check_camera, check_compression, check_motion, check_points
from pipeline.recipe_paths import resolve
from pipeline.recipe_source import read_source
from quantity import declared, quantity
from sensors.datasheet import Datasheet, with_effects
from sensors.line.brightness import Brightness
from sensors.model import SensorModel
from sensors.surface.reflectance import ReflectanceMap
from sensors.surface.surface import Surface

MOST_COUNT = 1_000_000
MOST_SCANS = 10_000_000  # of an entry of `parts:`
NO_FLAWS = FlawPlan(kinds=())
T = TypeVar("T")
Flaws = Annotated[FlawPlan, PlainValidator(FlawPlan.from_mapping)]


@record
class PartEntry:
    """One line of `parts:`: a built-in by name, or mesh files by path or glob."""

    builtin: Literal["bearing_cap", "car_door", "steel_plate", "welded_plate"] | None = None
    path: str | None = None
    name: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    facet_um: float | None = declared(FACET_UM, default=None)
    unit: Literal["mm", "cm", "m", "um", "inch"] = "mm"
    thicken_mm: float | None = None
    specimens: int | None = quantity(
        "specimens of this part; the recipe's where left out",
        low=1, high=MOST_COUNT, whole=True, default=None,
    )
    scans: int | None = quantity(
        "scans of each specimen; the recipe's where left out",
        low=1, high=MOST_COUNT, whole=True, default=None,
    )
    surface: str | None = None
    flaws: Flaws | None = None
    motion: Motion | None = None

    def __post_init__(self) -> None:
        if (self.builtin is None) == (self.path is None):
            raise ValueError("either 'builtin' or 'path'")
        if self.path is not None and (self.parameters or self.facet_um is not None):
            raise ValueError("'parameters' and 'facet_um' only with 'builtin'")
        if self.builtin is not None and (self.unit != "mm" or self.thicken_mm is not None):
            raise ValueError("'unit' and 'thicken_mm' only with 'path'")


@record
class RecipeFile:
    """A recipe as its YAML file states it; docs/recipe.md has an example."""

    name: str
    seed: int = quantity("same recipe, same seed, same bytes", low=0, whole=True)
    sensor: str
    parts: Annotated[tuple[PartEntry, ...], Len(1)]
    profiles: int = quantity("profiles of a scan", low=2, high=MOST_COUNT, whole=True)
    points: int | None = quantity(
        "points of a profile; the sensor's where left out",
        low=2, high=100_000, whole=True, default=None,
    )
    triangulation_angle_deg: float | None = quantity(
        "angle between laser and camera where the sensor's file doesn't state it; the camera sees "
        "no point in a shadow then",
        unit="°", low=0, above=True, high=90, below=True, default=None,
    )
    surface: str | None = None
    reflectance: ReflectanceMap | None = None
    intensity: Brightness | None = None
    flaws: Flaws | None = None
    motion: Motion = field(default_factory=Motion)
    specimens: int = quantity(
        "specimens of each part, each with flaws of its own",
        low=1, high=MOST_COUNT, whole=True, default=1,
    )
    good_specimens: int = quantity(
        "further specimens of each part, without flaws",
        low=0, high=MOST_COUNT, whole=True, default=0,
    )
    scans: int = quantity(
        "scans of each specimen, each on a path of its own",
        low=1, high=MOST_COUNT, whole=True, default=1,
    )
    splits: dict[str, float] = quantity(
        "share of each split; together 1",
        low=0, above=True, default_factory=lambda: {"train": 1.0},
    )
    split_by: Literal["part", "specimen", "scan"] | None = None
    visible_at: float = quantity(
        "standard deviations of the noise above which a flaw's deviation is visible",
        low=0, default=3.0,
    )
    detectable_at: float = quantity(
        "signal-to-noise ratio of a filter matched to a flaw above which the flaw is detectable",
        low=0, default=5.0,
        source="A. Rose, J. Opt. Soc. Am. 38 (1948) 196: threshold ratio 5",
    )
    scans_per_shard: int | None = quantity(
        "scans of a shard; chosen by the number of scans where left out",
        low=1, high=MOST_COUNT, whole=True, default=None,
    )
    points_on_disk: bool = False
    compression: Compression = "deflate"

    def __post_init__(self) -> None:
        for key, name in (("name", self.name), *(("splits", split) for split in self.splits)):
            if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
                raise ValueError(f"{key}: {name!r} must be of letters, digits, '.', '_' and '-'")
        if abs(sum(self.splits.values()) - 1) > 1e-6:
            raise ValueError(
                f"splits: the shares must add up to 1, not {sum(self.splits.values()):g}"
            )
        for entry in self.parts:
            specimens = (entry.specimens or self.specimens) + self.good_specimens
            scans = specimens * (entry.scans or self.scans)
            if scans > MOST_SCANS:
                raise ValueError(f"scans: {scans} of one part, must be {MOST_SCANS} at most")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Recipe:
    """A checked recipe with the files that it names read in.

    Attributes
    ----------
    file : RecipeFile
        The recipe's own keys.
    sensor : SensorModel
        The sensor: its datasheet and effects.
    surfaces : mapping
        Every surface that the recipe names, by that name.
    document : Document
        Where each key stands, for messages.
    roots : tuple of Path
        Folders that mesh files may come from: the recipe's own first.
    reflectance : ReflectanceMap or None
        Brightness of the parts, its picture's path resolved.
    banks : mapping
        Every bank of real flaws that the recipe names, by its folder as it is spelled.
    """

    file: RecipeFile
    sensor: SensorModel
    surfaces: Mapping[str, Surface]
    document: Document
    roots: tuple[Path, ...]
    reflectance: ReflectanceMap | None = None
    banks: Mapping[str, FlawBank] = field(default_factory=dict)

    @classmethod
    def load(
        cls,
        source: str | Path | Mapping[str, Any],
        *,
        roots: tuple[Path, ...] = (),
        sets: Sequence[str] = (),
        seed: int | None = None,
    ) -> "Recipe":
        """Read a recipe and the sensor and surfaces that it names.

        Parameters
        ----------
        source
            The YAML file, the name of a recipe that flawforge brings, or a mapping.
        roots
            Further folders that the recipe may read from; without them, its own alone.
        sets, seed
            Values in place of the recipe's, see `pipeline.recipe_source`.

        Raises
        ------
        RecipeError
            For the first thing that is wrong, with its line.
        """
        document, own = read_source(source, sets, seed)
        file = parse(RecipeFile, document)
        for root in roots:
            if not root.is_dir():
                raise RecipeError("no such folder", where="--parts", value=str(root))
        folders = (*own, *(root.resolve() for root in roots))
        sensor = _named(SensorModel.load, file.sensor, folders, document.where(("sensor",)))
        if file.triangulation_angle_deg is not None:
            sensor = _with_angle(sensor, file.triangulation_angle_deg)
        check_compression(file, document)
        check_camera(file, sensor.datasheet, document)
        check_points(file, sensor.datasheet, document)
        for motion, at in _motions(file):
            found = _found(motion, folders, document.where((*at, "path")))
            check_motion(found, sensor.datasheet, file.profiles, document.where(at))
        return cls(
            file=file,
            sensor=sensor,
            surfaces=_surfaces(file, folders, document),
            document=document,
            roots=folders,
            reflectance=_reflectance(file, folders, document),
            banks=_banks(file, folders, document),
        )

    @property
    def datasheet(self) -> Datasheet:
        """Datasheet of the sensor."""
        return self.sensor.datasheet

    @property
    def points(self) -> int:
        """Points in a profile."""
        return self.file.points or self.datasheet.points_per_profile

    def motion_of(self, entry: PartEntry) -> Motion:
        """Return the limits of a part's paths: its own entry's, else the recipe's."""
        return _found(entry.motion or self.file.motion, self.roots, "motion.path")

    def specimens_of(self, entry: PartEntry) -> int:
        """Return the number of specimens of a part, good ones among them."""
        return (entry.specimens or self.file.specimens) + self.file.good_specimens

    def flaws_of(self, entry: PartEntry, specimen: int = 0) -> FlawPlan:
        """Return the flaws wanted in a specimen: its part's, else the recipe's; good ones last.

        Numbers beyond the last specimen start again with flawed ones.
        """
        if specimen % self.specimens_of(entry) >= (entry.specimens or self.file.specimens):
            return NO_FLAWS
        return (entry.flaws or self.file.flaws or NO_FLAWS).with_banks(self.banks)

    def ready(self) -> "Recipe":
        """Return the recipe with the noise of its surfaces solved, once for all scans.

        Where a surface states no pitch, its figures hold at the scans': the points' distance at
        the working distance, and the path per profile at the sensor's speed.
        """
        sheet = self.datasheet
        surfaces = {
            name: surface.ready(
                sheet.x_fov_mm / self.points,
                sheet.travel_speed_mm_s / sheet.profile_rate_hz,
                z_resolution_um=sheet.z_resolution_um,
                repeatability_um=sheet.repeatability_um or 0.0,
            )
            for name, surface in self.surfaces.items()
        }
        return replace(self, surfaces=surfaces)

    def as_used(self) -> dict[str, Any]:
        """Return plain data with all values of the recipe and of the files that it names."""
        used: dict[str, Any] = plain(self.file)
        used["sensor"] = plain(self.datasheet)
        used["surfaces"] = {name: plain(surface) for name, surface in self.surfaces.items()}
        used["points"] = self.points
        # flaws as the recipe spells them, so that what is kept can be run again
        given = self.document.data
        used["flaws"] = given.get("flaws")
        for entry, said in zip(used["parts"], given["parts"], strict=True):
            entry["flaws"] = said.get("flaws")
        return used


def _with_angle(sensor: SensorModel, angle_deg: float) -> SensorModel:
    """Return the sensor with the camera at an angle, and the shadows that follow from it."""
    sheet = replace(sensor.datasheet, triangulation_angle_deg=angle_deg)
    if all(effect["name"] != "camera_occlusion" for effect in sheet.effects):
        sheet = with_effects(sheet, ({"name": "camera_occlusion"},))
    return SensorModel(sheet)


def _found(motion: Motion, folders: tuple[Path, ...], where: str) -> Motion:
    """Return the motion with the place of its file of poses, if it has one."""
    if not isinstance(motion.path, str):
        return motion
    return replace(motion, path=str(resolve(motion.path, folders, where)))


def _banks(
    file: RecipeFile, folders: tuple[Path, ...], document: Document
) -> dict[str, FlawBank]:
    """Read every bank that a recipe names."""
    named = [(file.flaws, ("flaws", "bank", "path"))] + [
        (entry.flaws, ("parts", k, "flaws", "bank", "path")) for k, entry in enumerate(file.parts)
    ]
    found: dict[str, FlawBank] = {}
    for plan, at in named:
        for name in plan.paths() if plan is not None else ():
            where = document.where(at)
            place = resolve(name, folders, where)
            files = tuple(sorted(path.resolve() for path in place.glob("*.npz")))
            if not files:
                raise RecipeError(
                    "holds no flaws", where=where, value=name,
                    allowed="a folder of .npz files made by 'flawforge flaw extract'",
                )  # fmt: skip
            for path in files:
                resolve(str(path), folders, where)
            try:
                found[name] = FlawBank.load(files)
            except (ValueError, OSError) as error:
                raise RecipeError(str(error), where=where, value=name) from None
    return found


def _motions(file: RecipeFile) -> Iterator[tuple[Motion, tuple[str | int, ...]]]:
    """Yield the limits of all paths, the recipe's and its parts', each with its place."""
    yield file.motion, ("motion",)
    for k, entry in enumerate(file.parts):
        if entry.motion is not None:
            yield entry.motion, ("parts", k, "motion")


def _surfaces(
    file: RecipeFile, folders: tuple[Path, ...], document: Document
) -> dict[str, Surface]:
    """Read every surface that a recipe names."""
    where_of = {
        entry.surface: document.where(("parts", index, "surface"))
        for index, entry in enumerate(file.parts)
    }
    where_of[file.surface] = document.where(("surface",))
    return {
        name: _named(Surface.load, name, folders, where_of[name])
        for name in sorted(name for name in where_of if name is not None)
    }


def _reflectance(
    file: RecipeFile, folders: tuple[Path, ...], document: Document
) -> ReflectanceMap | None:
    """Return the parts' brightness with the place of its picture, if it has one."""
    reflectance = file.reflectance
    if reflectance is None or reflectance.picture is None:
        return reflectance
    where = document.where(("reflectance", "picture", "path"))
    place = resolve(reflectance.picture.path, folders, where)
    return replace(reflectance, picture=replace(reflectance.picture, path=str(place)))


def _named(
    load: Callable[[str], T], name: str, folders: tuple[Path, ...], where: str
) -> T:
    """Load what the recipe names at `where`, a preset or a file, or raise where it is absent."""
    source = _inside(name, folders, where)
    try:
        return load(source)
    except RecipeError as error:
        if Path(source).is_file():  # the error is in there, with its own line
            raise
        raise RecipeError(str(error), where=where) from None


def _inside(name: str, roots: tuple[Path, ...], where: str) -> str:
    """Resolve a preset's name (kept) or a file's path against the folders that may be read."""
    if Path(name).suffix not in (".yaml", ".yml"):
        return name
    return str(resolve(name, roots, where))
