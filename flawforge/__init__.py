"""Labelled laser-profilometer scans of flawed parts: the functions for users.

Each function imports its modules when it is called, so that the package imports quickly.
`flawforge.dataset` reads datasets and needs only numpy, h5py and pandas::

    import flawforge

    flawforge.generate("quickstart", "out/quickstart", jobs=2)
    scans = flawforge.open("out/quickstart")
    flawforge.export(scans.folder, "out/coco", "coco", mask="visible")
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from diagnosis.diagnosis import Diagnosis
    from flawforge.dataset import Dataset

__all__ = ["diagnose", "export", "generate", "open"]


def generate(
    recipe: str | Path | Mapping[str, Any],
    out: str | Path,
    *,
    jobs: int = 1,
    parts: Sequence[str | Path] = (),
    sets: Mapping[str, Any] | None = None,
    seed: int | None = None,
) -> "Dataset":
    """Make a labelled dataset from a recipe; a stopped run continues.

    Progress goes to the logger "flawforge.generate".

    Parameters
    ----------
    recipe : path, str or mapping
        A YAML file, "quickstart", or the recipe itself as a mapping.
    out : path
        Folder of the dataset.
    jobs : int
        Processes; the bytes are the same for any number.
    parts : sequence of path
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
        from files.errors import RecipeError
        from pipeline.batch.run import generate as make
        from pipeline.dataset.object_store import is_url
        from pipeline.recipe import Recipe

        loaded = Recipe.load(
            recipe,
            roots=tuple(Path(folder) for folder in parts),
            sets=[f"{key}={json.dumps(value)}" for key, value in (sets or {}).items()],
            seed=seed,
        )
        if is_url(str(out)):
            raise RecipeError(
                "the reader of datasets needs a folder", where="out", value=out,
                allowed="a folder; flawforge generate --out takes object stores",
            )  # fmt: skip
        make(loaded, Path(out), backend=backend)
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

    Returns
    -------
    list of Path
        The files written.
    """
    from pipeline.dataset.export import export as write

    folder: str | Path
    if isinstance(dataset, str | Path):
        folder, scans = dataset, None
    else:
        folder, scans = dataset.folder, [str(name) for name in dataset.manifest["scan_id"]]
    return write(folder, out, to, scans, mask=mask, min_pixels=min_pixels, image=image)


def diagnose(
    recordings: Sequence[str | Path],
    part: str | Path,
    sensor: str | Path,
    *,
    out: str | Path | None = None,
    part_unit: str = "mm",
    surface: str | Path | None = None,
    references: Sequence[str | Path] = (),
    holdout: Sequence[str | Path] = (),
    baselines: Sequence[str | Path] = (),
    seed: int = 0,
) -> "Diagnosis":
    """Find where recordings differ from their simulation, and the effects that explain it.

    Parameters
    ----------
    recordings, references, holdout, baselines : sequence of path
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
    """
    from pipeline.batch.backend import one_thread_each

    one_thread_each()
    from diagnosis.diagnose import diagnose as explain
    from diagnosis.report.outputs import write_outputs
    from pipeline.parts.part import load_part
    from sensors.datasheet import Datasheet
    from sensors.recording import Recording
    from sensors.surface.surface import Surface

    solid = load_part(Path(part), unit=part_unit)
    found = explain(
        [Recording.load(path) for path in recordings],
        solid.vertices_mm,
        solid.faces,
        Datasheet.load(sensor),
        surface=None if surface is None else Surface.load(surface),
        references=[Recording.load(path) for path in references],
        holdout=[Recording.load(path) for path in holdout],
        baselines=[Recording.load(path) for path in baselines],
        seed=seed,
    )
    if out is not None:
        write_outputs(found, Path(out), part_name=solid.name)
    return found
