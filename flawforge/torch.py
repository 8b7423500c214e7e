"""Datasets and endless simulation for PyTorch: float32 inputs without NaN, int64 targets.

::

    from flawforge.torch import Scans, Stream

    train = Scans("out/quickstart", "train")
    inputs, target = train[0]                 # (2, H, W) relief in mm and validity; (H, W)
    endless = Stream("quickstart", seed=1)    # the same pairs, simulated on the fly
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

try:
    import torch
    from torch.utils.data import Dataset as TorchDataset
    from torch.utils.data import IterableDataset, get_worker_info
except ImportError as error:
    raise ImportError(
        "flawforge.torch needs PyTorch: pip install 'flawforge[torch]'", name=error.name
    ) from None

import flawforge.dataset
from pipeline.batch.stream import ScanStream
from pipeline.dataset.relief import local_relief, pitch_mm
from pipeline.recipe import Recipe
from pipeline.scan.labelled_scan import CLASS_NAMES, Scan

Input = Literal["relief", "depth", "points"]
Target = Literal["mask", "mask_visible", "instance"]
Pair = tuple[torch.Tensor, torch.Tensor]
Transform = Callable[[torch.Tensor, torch.Tensor], Pair]
IGNORED: Final = 255  # what torchvision's segmentation datasets use
FIELDS: Final = ("depth", "pose", "ray_x_mm", "ray_slope")
NUMBER_OF_CLASSES: Final = max(CLASS_NAMES) + 1


class Scans(TorchDataset[Pair]):
    """The scans of a dataset as pairs of input and target.

    Parameters
    ----------
    folder : path
        The dataset.
    split : str, optional
        Name of the split; all by default.
    input : {"relief", "depth", "points"}
        relief: (2, H, W), height above the waviness in mm and validity; depth: (2, H, W), depth
        minus the scan's median in mm and validity; points: (4, H, W), x, y, z in the part frame
        in mm and validity. Missing readings are 0 in all channels.
    target : {"mask", "mask_visible", "instance"}
        Class or number of the flaw at each point, 0 = none.
    ignore_index : int
        Target of missing readings.
    transform : callable, optional
        Takes and returns both tensors.
    """

    def __init__(
        self,
        folder: str | Path,
        split: str | None = None,
        *,
        input: Input = "relief",  # the word users know
        target: Target = "mask",
        ignore_index: int = IGNORED,
        transform: Transform | None = None,
    ) -> None:
        scans = flawforge.dataset.open(folder, fields=(*FIELDS, target))
        self.scans = scans if split is None else scans.split(split)
        self._make = _Pairs(input, target, ignore_index, transform)

    def __len__(self) -> int:
        return len(self.scans)

    def __getitem__(self, number: int) -> Pair:
        return self._make(self.scans[number])

    def class_weights(self) -> torch.Tensor:
        """Weights of the classes for a loss, the inverse of their share of the points.

        Computed from the manifest and the table of flaws, without reading a scan. An absent class
        has weight 0. The mean weight of a point is 1.
        """
        counts = np.zeros(NUMBER_OF_CLASSES)
        column = "pixels_visible" if self._make.target == "mask_visible" else "pixels"
        flaws = self.scans.flaws
        for number, pixels in zip(flaws["class_id"], flaws[column], strict=True):
            counts[int(number)] += pixels
        first = self.scans[0][FIELDS[0]] if len(self) else np.empty(0)
        counts[0] = first.size * len(self) - counts.sum()
        there = counts > 0
        weights = np.zeros(NUMBER_OF_CLASSES)
        weights[there] = counts.sum() / (there.sum() * counts[there])
        return torch.as_tensor(weights, dtype=torch.float32)


class Stream(IterableDataset[Pair]):
    """Scans of a recipe simulated on the fly, without end.

    Each worker of a loader and each rank simulates different specimens, so no scan repeats. The
    number of a scan determines its content: the same recipe, seed and `start` give the same scans.

    Parameters
    ----------
    recipe : path, str or mapping
        As of `flawforge.generate`.
    seed : int, optional
        Overrides the recipe's seed.
    start : int
        Number of the first scan; the number to continue from after a stop.
    rank, world_size : int, optional
        Rank and number of the training processes; those of torch.distributed where it runs.
    parts : sequence of path
        Further folders that the recipe may read from.
    input, target, ignore_index, transform
        As of `Scans`.
    """

    def __init__(
        self,
        recipe: str | Path | Mapping[str, Any],
        seed: int | None = None,
        *,
        start: int = 0,
        rank: int | None = None,
        world_size: int | None = None,
        parts: Sequence[str | Path] = (),
        input: Input = "relief",  # as of Scans
        target: Target = "mask",
        ignore_index: int = IGNORED,
        transform: Transform | None = None,
    ) -> None:
        roots = tuple(Path(folder) for folder in parts)
        self._stream = ScanStream(Recipe.load(recipe, roots=roots, seed=seed))
        self._start = start
        together = torch.distributed.is_available() and torch.distributed.is_initialized()
        self._rank = rank if rank is not None else torch.distributed.get_rank() if together else 0
        self._ranks = world_size or (torch.distributed.get_world_size() if together else 1)
        self._make = _Pairs(input, target, ignore_index, transform)

    def __iter__(self) -> Iterator[Pair]:
        return (pair for _, pair in self.numbered())

    def numbered(self) -> Iterator[tuple[int, Pair]]:
        """Simulate this worker's scans, each with its number."""
        worker = get_worker_info()
        workers, mine = (worker.num_workers, worker.id) if worker is not None else (1, 0)
        share, shares = self._rank * workers + mine, self._ranks * workers
        for number, scan in self._stream.scans(self._start, share, shares):
            yield number, self._make(_arrays(scan))


class _Pairs:
    """Turns a scan's arrays into input and target."""

    def __init__(
        self, kind: Input, target: Target, ignore_index: int, transform: Transform | None
    ) -> None:
        for value, allowed in ((kind, get_args(Input)), (target, get_args(Target))):
            if value not in allowed:
                raise ValueError(f"{value!r}; allowed: {', '.join(allowed)}")
        self.kind, self.target = kind, target
        self._ignore_index, self._transform = ignore_index, transform

    def __call__(self, scan: Mapping[str, Any]) -> Pair:
        depth = np.asarray(scan["depth"], dtype=np.float64)
        valid = np.isfinite(depth)
        channels = (*self._channels(scan, depth, valid), valid)
        inputs = np.zeros((len(channels), *depth.shape), dtype=np.float32)
        for filled, channel in zip(inputs, channels, strict=True):
            np.copyto(filled, channel, where=valid, casting="same_kind")
        target = np.where(valid, scan[self.target], np.int64(self._ignore_index))
        pair = torch.from_numpy(inputs), torch.from_numpy(target)
        return self._transform(*pair) if self._transform else pair

    def _channels(
        self, scan: Mapping[str, Any], depth: NDArray[Any], valid: NDArray[Any]
    ) -> list[NDArray[Any]]:
        if self.kind == "relief":
            return [local_relief(depth, pitch_mm(scan))]
        if self.kind == "depth":
            return [depth - (np.median(depth[valid]) if valid.any() else 0.0)]
        x = scan["ray_x_mm"] + depth * scan["ray_slope"]
        local = np.stack([x, np.zeros_like(x), depth], axis=-1)
        pose = scan["pose"]
        cloud = np.einsum("nij,nmj->nmi", pose[:, :3, :3], local) + pose[:, None, :3, 3]
        return list(np.moveaxis(cloud, -1, 0))


def _arrays(scan: Scan) -> dict[str, Any]:
    """Return a simulated scan under the names of a shard's arrays."""
    return {
        "depth": scan.depth_mm,
        "pose": scan.poses,
        "ray_x_mm": scan.laser.x_mm,
        "ray_slope": scan.laser.slope_x,
        "mask": scan.mask,
        "mask_visible": scan.mask_visible,
        "instance": scan.instance,
    }
