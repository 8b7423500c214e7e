"""A scan's valid readings as points, with the colours of their classes."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.dataset.export.source import Labelled

GREY: Final = (178, 186, 196)


def points_mm(scan: Labelled) -> NDArray[np.float64]:
    """Points (profiles, points, 3) in the part frame by the commanded poses, mm; NaN = missing."""
    depth, pose = scan.depth_mm, scan.arrays["pose"]
    x = scan.arrays["ray_x_mm"] + depth * scan.arrays["ray_slope"]
    sensor = np.stack([x, np.zeros_like(x), depth], axis=-1)
    turned = np.einsum("nij,nmj->nmi", pose[:, :3, :3], sensor)
    return np.asarray(turned + pose[:, None, :3, 3])


def class_colours(classes: dict[int, str]) -> NDArray[np.uint8]:
    """Table (256, 3) of the previews' colours by class; what has none is grey."""
    from pipeline.preview.annotation import colour_of

    table = np.full((256, 3), GREY, dtype=np.uint8)
    for number, name in classes.items():
        table[number] = tuple(bytes.fromhex(colour_of(name).removeprefix("#")))
    return table
