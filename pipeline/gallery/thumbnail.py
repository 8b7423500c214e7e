"""Small pictures of scans: noisy local relief, and the labels in the colours of their kinds."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pipeline.dataset.export.cloud import class_colours
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.source import Labelled
from pipeline.dataset.relief import pitch_mm

if TYPE_CHECKING:
    from PIL.Image import Image

CLEAR: Final = 0.45  # of the colour over labels below the noise
STRONG: Final = 0.8


@dataclass(frozen=True, kw_only=True, slots=True)
class Thumbnail:
    """Relief (grey) and labels (colour with transparency) of one scan, square pixels."""

    relief: "Image"
    labels: "Image"

    def together(self) -> "Image":
        """Return the labels laid over the relief."""
        from PIL import Image

        return Image.alpha_composite(self.relief.convert("RGBA"), self.labels).convert("RGB")


def thumbnail(
    scan: Labelled, coding: Coding, classes: dict[int, str], longest_px: int
) -> Thumbnail:
    """Draw a scan as it lies: profiles from top to bottom, lengths true."""
    from PIL import Image

    size = _size(scan, longest_px)
    colours = np.zeros((*scan.mask.shape, 4), dtype=np.uint8)
    colours[..., :3] = class_colours(classes)[scan.mask]
    visible = scan.arrays["mask_visible"] > 0
    colours[..., 3] = np.where(scan.mask > 0, np.where(visible, STRONG, CLEAR) * 255, 0)
    return Thumbnail(
        relief=Image.fromarray(coding.array(scan)).resize(size, Image.Resampling.BOX),
        labels=_largest(colours, size),
    )


def _size(scan: Labelled, longest_px: int) -> tuple[int, int]:
    """Return width and height in pixels, not larger than the scan's own."""
    along_path, along_line = pitch_mm(scan.arrays)
    height, width = scan.mask.shape
    tall, wide = height * max(along_path, 1e-9), width * max(along_line, 1e-9)
    scale = min(longest_px, max(height, width)) / max(tall, wide)
    return max(1, round(wide * scale)), max(1, round(tall * scale))


def _largest(colours: NDArray[Any], size: tuple[int, int]) -> "Image":
    """Shrink labels so that a flaw of a few points is still seen: the clearest point counts."""
    from PIL import Image

    height, width = colours.shape[:2]
    factor = max(1, height // size[1]), max(1, width // size[0])
    rows, columns = height // factor[0], width // factor[1]
    crop = colours[: rows * factor[0], : columns * factor[1]]
    blocks = crop.reshape(rows, factor[0], columns, factor[1], 4).swapaxes(1, 2)
    blocks = blocks.reshape(rows, columns, -1, 4)
    best = blocks[..., 3].argmax(axis=2)
    picked = np.take_along_axis(blocks, best[..., None, None], axis=2)[:, :, 0]
    return Image.fromarray(np.ascontiguousarray(picked)).resize(size, Image.Resampling.NEAREST)
