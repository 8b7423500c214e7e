"""A study: the flaws that scans show, whether each was found, and the curve of each kind."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from pipeline.dataset.tables import read_table
from pipeline.dataset.verify import read_dataset
from pipeline.pod.curve import Curve, Floats, NotEstimable
from pipeline.pod.hit_miss import HitMiss, Link
from pipeline.pod.signal_response import SignalResponse

if TYPE_CHECKING:
    import pandas as pd

BUILT_IN_FLOOR: Final = 1.0
"""Responses of the built-in detector are in standard deviations of the noise."""

ALL: Final = "all kinds"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Group:
    """The flaws of one kind.

    Attributes
    ----------
    name : str
    size : (n,) array
        In the unit of the column.
    hit : (n,) bool
    response : (n,) array or None
        NaN where the detector gave none.
    flaws : int
        Distinct flaws; a flaw that several scans show counts in each.
    curves : dict
        By method, "hit/miss" or "signal response": the curve, or why there is none.
    """

    name: str
    size: Floats
    hit: NDArray[np.bool_]
    response: Floats | None
    flaws: int
    curves: dict[str, Curve | str]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Study:
    """What was studied, and the groups: all kinds first, then each."""

    detector: str
    size_column: str
    threshold: float | None
    link: Link
    split: str | None
    left_out: int
    groups: tuple[Group, ...]


def make_study(
    folder: Path,
    *,
    predictions: Path | None = None,
    size: str = "depth_mm",
    threshold: float | None = None,
    split: str | None = None,
    link: Link = "logit",
) -> Study:
    """Fit the curves of a dataset's flaws.

    Parameters
    ----------
    folder
        The dataset.
    predictions
        Parquet with `scan_id`, `instance` and either `detected` or `response`; flaws without a
        row were missed. Without it, the dataset's own matched filter is studied, which knows each
        flaw's place and shape: what no detector on the same readings surpasses but one that whitens
        the noise.
    size
        Column of the flaws' table; `length_mm` stands for `size_length_mm`.
    threshold
        Response from which a flaw is found; the recipe's `detectable_at` for the built-in detector.
    split
        One split's scans alone.
    link
        Of the hit/miss curves.

    Raises
    ------
    RecipeError
        Where a file or a column is wrong.
    """
    shown = _shown(read_table(folder / "flaws.parquet"), split)
    column = _size_column(shown, size)
    if predictions is None:
        used = read_dataset(folder)["recipe"]
        threshold = float(used["detectable_at"]) if threshold is None else threshold
        response: Floats | None = shown["response"].to_numpy(dtype=np.float64)
        hit = shown["response"].to_numpy() >= threshold
        floor, detector = BUILT_IN_FLOOR, "matched filter (built in)"
    else:
        hit, response, floor = _predicted(shown, predictions, threshold)
        detector = predictions.name
    sizes = shown[column].to_numpy(dtype=np.float64)
    usable = sizes > 0
    groups = []
    for name in [ALL, *sorted(shown["kind"].unique())]:
        mine = usable & (np.ones(len(shown), bool) if name == ALL else shown["kind"] == name)
        if not mine.any():
            continue
        own = None if response is None else response[mine]
        distinct = shown.loc[mine, ["specimen", "instance"]].drop_duplicates()
        groups.append(
            Group(
                name=name, size=sizes[mine], hit=hit[mine], response=own, flaws=len(distinct),
                curves=_curves(sizes[mine], hit[mine], own, link, threshold, floor),
            )  # fmt: skip
        )
    return Study(
        detector=detector, size_column=column, threshold=threshold, link=link, split=split,
        left_out=int((~usable).sum()), groups=tuple(groups),
    )  # fmt: skip


def _shown(flaws: "pd.DataFrame", split: str | None) -> "pd.DataFrame":
    """Rows of the flaws that a scan of the split shows."""
    if split is not None:
        known = sorted(flaws["split"].unique())
        if split not in known:
            raise RecipeError(
                "no such split", where="--split", value=split, allowed=", ".join(known)
            )
        flaws = flaws[flaws["split"] == split]
    return flaws[flaws["pixels"] > 0].reset_index(drop=True)


def _size_column(shown: "pd.DataFrame", size: str) -> str:
    """Name of the column that holds a size."""
    from pandas.api.types import is_numeric_dtype

    column = size if size in shown else f"size_{size}"
    if column not in shown or not is_numeric_dtype(shown[column]):
        allowed = [str(name) for name in shown if str(name).endswith("_mm")]
        raise RecipeError("no such size", where="--size", value=size, allowed=", ".join(allowed))
    return column


def _curves(
    size: Floats,
    hit: NDArray[np.bool_],
    response: Floats | None,
    link: Link,
    threshold: float | None,
    floor: float,
) -> dict[str, Curve | str]:
    """Fit both curves to the flaws of a group, or say why one can't be."""
    curves: dict[str, Curve | str] = {
        "hit/miss": _try(lambda: HitMiss.fit(size, hit, link))
    }
    if response is not None and threshold is not None:
        curves["signal response"] = _try(
            lambda: SignalResponse.fit(size, response, threshold=threshold, floor=floor)
        )
    return curves


def _try(fit: Any) -> Curve | str:
    try:
        curve: Curve = fit()
        return curve
    except NotEstimable as error:
        return str(error)


def _predicted(
    shown: Any, path: Path, threshold: float | None
) -> tuple[NDArray[np.bool_], Floats | None, float]:
    """Return hits, responses and their floor of a detector's own table."""
    given = read_table(path)
    if not {"scan_id", "instance"} <= {*given.columns}:
        raise RecipeError(
            "columns are missing", where=path, value=", ".join(given.columns),
            allowed="scan_id, instance, and detected or response",
        )  # fmt: skip
    by = "response" if "response" in given else "detected"
    if by not in given:
        raise RecipeError("neither 'detected' nor 'response'", where=path)
    if by == "response" and threshold is None:
        raise RecipeError("responses need a threshold", where=path, allowed="--threshold NUMBER")
    if given.duplicated(["scan_id", "instance"]).any():
        raise RecipeError("a flaw of a scan has two rows", where=path)
    joined = shown[["scan_id", "instance"]].merge(
        given[["scan_id", "instance", by]], on=["scan_id", "instance"], how="left"
    )
    values = joined[by].to_numpy(dtype=np.float64, na_value=np.nan)
    if not np.isfinite(values).any():
        raise RecipeError("no row names a flaw that the scans show", where=path)
    if by == "detected":
        return values > 0, None, 0.0
    positive = values[values > 0]
    if not positive.size or not threshold or threshold <= 0:
        raise RecipeError("responses and --threshold must be above 0", where=path)
    return values >= threshold, values, float(positive.min()) * 0.999
