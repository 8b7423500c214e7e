"""Labelled laser-profilometer scans of flawed parts: the functions for users.

Each function imports its modules when it is called, so that the package imports quickly.
`flawforge.dataset` reads datasets and needs only numpy, h5py and pandas::

    import flawforge

    flawforge.generate("quickstart", "out/quickstart", jobs=2)
    scans = flawforge.open("out/quickstart")
    flawforge.export(scans.folder, "out/coco", "coco", mask="visible")
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from diagnosis.diagnosis import Diagnosis
    from files.errors import RecipeError
    from flawforge.dataset import Dataset, ShardError
    from pipeline.parts.part_error import PartError
    from sensors.datasheet import Datasheet, with_effects
    from sensors.recording import Recording

__all__ = [
    "Datasheet", "PartError", "RecipeError", "Recording", "ShardError", "diagnose", "export",
    "generate", "open", "with_effects",
]  # fmt: skip
_PLACES = {
    "Datasheet": "sensors.datasheet",
    "PartError": "pipeline.parts.part_error",
    "RecipeError": "files.errors",
    "Recording": "sensors.recording",
    "ShardError": "flawforge.dataset",
    "with_effects": "sensors.datasheet",
}
"""Modules of the names that are imported when they are first asked for."""
Paths = str | Path | Sequence[str | Path]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'flawforge' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def generate(
    recipe: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    jobs: int = 1,
    parts: Paths = (),
    sets: Mapping[str, Any] | None = None,
    seed: int | None = None,
) -> "Dataset":
    """Make a labelled dataset from a recipe; a stopped run continues.

    Progress goes to the logger "flawforge.generate".

    Parameters
    ----------
    recipe : path, str or mapping
        A YAML file, "quickstart", or the recipe itself as a mapping.
    out : path or str
        Folder of the dataset, or a prefix of an object store, "s3://bucket/prefix".
    jobs : int
        Processes; the bytes are the same for any number.
    parts : path or sequence of path
        Further folders that the recipe may read from.
    sets : mapping, optional
        Overridden values by dotted key: ``{"motion.yaw_deg": 5}``.
    seed : int, optional
        Overrides the recipe's seed.

    Raises
    ------
    ValueError
        `RecipeError` or `PartError`: one line with the error, its place, and the allowed values.
    """
    import json

    from flawforge.dataset import open as open_dataset
    from pipeline.batch.backend import Backend

    with Backend(jobs=jobs).started() as backend:
        from pipeline.batch.run import generate as make
        from pipeline.dataset.object_store import staged
        from pipeline.recipe import Recipe

        loaded = Recipe.load(
            recipe,
            roots=tuple(_paths(parts)),
            sets=[f"{key}={json.dumps(value)}" for key, value in (sets or {}).items()],
            seed=seed,
        )
        with staged(out) as (store, folder):
            make(loaded, folder, backend=backend, store=store)
    return open_dataset(out)


def open(folder: str | Path, **options: Any) -> "Dataset":  # as the reader's own
    """Open a dataset; for the options see `flawforge.dataset.open`."""
    from flawforge.dataset import open as open_dataset

    return open_dataset(folder, **options)


def export(
    dataset: "str | Path | Dataset",
    out: str | Path,
    to: str,
    *,
    mask: Literal["all", "visible"] | None = None,
    min_pixels: int | None = None,
    image: Literal["relief8", "depth16", "float32"] | None = None,
) -> list[Path]:
    """Write a dataset, or selected scans of one, in the form of another program.

    ``flawforge export --help`` lists the forms and explains the options.

    Parameters
    ----------
    dataset : path, str or Dataset
        Folder of the dataset, or its prefix of an object store, or selected scans of it.
    out : path
        Folder to write.
    to : str
        The form: ``flawforge.export("out/quickstart", "out/coco", "coco")``.

    Returns
    -------
    list of Path
        The files written.
    """
    from pipeline.dataset.export import FORMS
    from pipeline.dataset.export import export as write

    if to not in FORMS and str(out) in FORMS:
        from files.errors import RecipeError

        raise RecipeError(
            "out and to are swapped", where="export", value=(str(out), str(to)),
            allowed=f"export(dataset, out={str(to)!r}, to={str(out)!r})",
        )  # fmt: skip
    folder: str | Path
    if isinstance(dataset, str | Path):
        folder, scans = dataset, None
    else:
        folder, scans = dataset.folder, [str(name) for name in dataset.manifest["scan_id"]]
    return write(folder, out, to, scans, mask=mask, min_pixels=min_pixels, image=image)


def diagnose(
    recordings: Paths,
    part: str | Path,
    sensor: str | Path,
    *,
    out: str | Path | None = None,
    part_unit: str = "mm",
    surface: str | Path | None = None,
    references: Paths = (),
    holdout: Paths = (),
    baselines: Paths = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> "Diagnosis":
    """Find where recordings differ from their simulation, and the effects that explain it.

    Parameters
    ----------
    recordings, references, holdout, baselines : path or sequence of path
        recording.h5 files: to explain, of a flat plate, held out, of the part when the instrument
        was known to be good.
    part : path
        The part's closed mesh.
    sensor, surface : path or str
        YAML files, or presets.
    out : path, optional
        Folder for diagnosis.json, report.html and sensor.yaml.
    part_unit : str
        Unit of the mesh.
    seed : int
        Seed of the bootstrap intervals of the held-out scores; nothing else depends on it.
    progress : function, optional
        Called with a few words at each stage.

    Raises
    ------
    ValueError
        `RecipeError` or `PartError`: one line with the error, its place, and the allowed values.
    """
    from contextlib import nullcontext

    from pipeline.batch.backend import one_thread_each

    one_thread_each()
    from diagnosis.diagnose import diagnose as diagnosis_of
    from diagnosis.prepare import Inputs
    from diagnosis.report.outputs import write_outputs
    from files.output_folder import output_folder
    from pipeline.parts.part import load_part
    from sensors.datasheet import Datasheet
    from sensors.recording import Recording
    from sensors.surface.surface import Surface

    said = progress or (lambda _: None)
    with nullcontext() if out is None else output_folder(Path(out)) as folder:
        said("reading")
        datasheet = Datasheet.load(sensor)  # what is read in no time first
        texture = None if surface is None else Surface.load(surface)
        solid = load_part(Path(part), unit=part_unit)
        given, plates, apart, good = (
            [Recording.load(path) for path in _paths(paths)]
            for paths in (recordings, references, holdout, baselines)
        )
        inputs = Inputs(
            recordings=given, vertices_mm=solid.vertices_mm, faces=solid.faces,
            datasheet=datasheet, surface=texture, references=plates, holdout=apart, baselines=good,
        )  # fmt: skip
        found = diagnosis_of(inputs, seed=seed, progress=said)
        if folder is not None:
            write_outputs(found, folder, part_name=solid.name, progress=said)
    return found


def _paths(given: Paths) -> list[Path]:
    """Return one path or several as a list."""
    return [Path(path) for path in ([given] if isinstance(given, str | Path) else given)]
