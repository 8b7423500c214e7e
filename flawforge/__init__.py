"""Labelled laser-profilometer scans of flawed parts: all that a user imports or types.

As thin as the commands, and as quick to import: what a function needs is loaded when it is called.
`flawforge.dataset` reads datasets and needs numpy, h5py and pandas alone::

    import flawforge

    flawforge.generate("quickstart", "out/quickstart", jobs=2)
    scans = flawforge.open("out/quickstart")
    flawforge.export(scans.folder, "out/coco", "coco", mask="visible")
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from diagnosis.diagnose import Diagnosis
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
    """Make a labelled dataset from a recipe; go on where a run was stopped.

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
        Values in place of the recipe's, by dotted key: ``{"motion.yaw_deg": 5}``.
    seed : int, optional
        In place of the recipe's.

    Raises
    ------
    ValueError
        `RecipeError` or `PartError`: one line that says what is wrong, where, and what is allowed.
    """
    import json

    from flawforge.dataset import open as open_dataset
    from pipeline.batch.backend import Backend

    with Backend(jobs=jobs).started() as backend:
        from pipeline.batch.run import generate as make
        from pipeline.recipe import Recipe

        loaded = Recipe.load(
            recipe,
            roots=tuple(Path(folder) for folder in parts),
            sets=[f"{key}={json.dumps(value)}" for key, value in (sets or {}).items()],
            seed=seed,
        )
        make(loaded, Path(out), backend=backend)
    return open_dataset(out)


def open(folder: str | Path, **options: Any) -> "Dataset":  # as the reader's own
    """Open a dataset; `flawforge.dataset.open` says what the options are."""
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
    """Write a dataset, or the scans chosen of one, in the form that another program opens.

    `pipeline.dataset.export.export` says what the options are, and ``flawforge export --help``
    which forms there are.

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
    seed: int = 0,
) -> "Diagnosis":
    """Say where recordings differ from their simulation, and which physics explains it.

    Parameters
    ----------
    recordings, references, holdout : sequence of path
        recording.h5 files: to explain, of a flat plate, for judging alone.
    part : path
        The part's closed mesh.
    sensor, surface : path or str
        YAML files, or presets.
    out : path, optional
        Folder for diagnosis.json, report.html and sensor.yaml.
    part_unit : str
        Unit of the mesh.
    seed : int
        Of the null's draws.
    """
    from pipeline.batch.backend import one_thread_each

    one_thread_each()
    from diagnosis.diagnose import diagnose as explain
    from diagnosis.outputs import write_outputs
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
        seed=seed,
    )
    if out is not None:
        write_outputs(found, Path(out), part_name=solid.name)
    return found
