"""Pictures of scans: local relief in 8 bits, depth in 16 bits or in floating point."""

import io
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipeline.dataset.export.source import ImageChoice, Labelled, Source
from pipeline.dataset.relief import CUTOFF_MM, local_relief, pitch_mm

FINEST_MM: Final = 1e-4  # step of 16-bit depths where the sensor states none
LARGEST_16: Final = 65535
MIDDLE_8, HALF_8 = 128, 127
TRIAL_SCANS: Final = 32  # from which the noise is estimated


@dataclass(frozen=True, kw_only=True, slots=True)
class Coding:
    """What the numbers of a dataset's pictures mean; the same for all of them.

    depth16: offset_mm + scale_mm * number, 0 = missing. float32: mm, NaN = missing. relief8:
    softening_mm * sinh((number - 128) / scale), 0 = missing: linear within the noise, logarithmic
    above, so that 8 bits hold a scratch and a step of the part (asinh magnitudes; Lupton, Gunn and
    Szalay, AJ 118, 1406, 1999).

    Attributes
    ----------
    kind : str
    scale, offset_mm : float
        scale is mm per number, of relief8 numbers per unit of asinh.
    softening_mm : float
        Of relief8: the noise's standard deviation.
    """

    kind: ImageChoice
    scale: float = 1.0
    offset_mm: float = 0.0
    softening_mm: float = 1.0

    @classmethod
    def of(cls, source: Source) -> "Coding":
        """Choose scale and offset for a dataset."""
        if source.image == "float32":
            return cls(kind="float32")
        sheet = source.datasheet
        step = sheet.step_mm or FINEST_MM
        span = sheet.depth_max_mm - sheet.depth_min_mm
        if source.image == "depth16":
            scale = step * max(1, math.ceil(span / step / (LARGEST_16 - 3)))
            first = math.floor(sheet.depth_min_mm / scale) - 1
            return cls(kind="depth16", scale=scale, offset_mm=first * scale)
        softening = max(_noise_mm(source), step)
        scale = HALF_8 / math.asinh(span / softening)
        return cls(kind="relief8", scale=scale, softening_mm=softening)

    @property
    def suffix(self) -> str:
        """File name's end of a picture."""
        return ".tiff" if self.kind == "float32" else ".png"

    @property
    def facts(self) -> dict[str, Any]:
        """What a reader of the pictures must know, for a JSON file."""
        axes = {"kind": self.kind, "rows": "profiles", "columns": "points"}
        if self.kind == "float32":
            return {**axes, "value_mm": "number", "quantity": "depth", "missing": "NaN"}
        if self.kind == "depth16":
            return {
                **axes, "quantity": "depth", "value_mm": "offset_mm + scale_mm * number",
                "scale_mm": self.scale, "offset_mm": self.offset_mm, "missing": 0,
            }  # fmt: skip
        return {
            **axes,
            "quantity": f"height above the waviness (Gaussian regression filter, {CUTOFF_MM:g} mm)",
            "value_mm": "softening_mm * sinh((number - 128) / scale)",
            "softening_mm": self.softening_mm, "scale": self.scale, "missing": 0,
        }  # fmt: skip

    def array(self, scan: Labelled) -> NDArray[Any]:
        """Return the numbers of a scan's picture: uint8, uint16 or float32."""
        if self.kind == "float32":
            return scan.depth_mm.astype(np.float32)
        if self.kind == "depth16":
            numbers = (scan.depth_mm - self.offset_mm) / self.scale
            return whole(numbers, 1, LARGEST_16).astype(np.uint16)
        relief = local_relief(scan.depth_mm, pitch_mm(scan.arrays))
        numbers = MIDDLE_8 + self.scale * np.arcsinh(relief / self.softening_mm)
        return whole(numbers, MIDDLE_8 - HALF_8, MIDDLE_8 + HALF_8).astype(np.uint8)

    def file(self, scan: Labelled) -> bytes:
        """Return the scan's picture as the bytes of a PNG or TIFF file."""
        return encoded(self.array(scan))


def whole(numbers: NDArray[np.float64], low: int, high: int) -> NDArray[np.int64]:
    """Round numbers to `low` to `high`; NaN becomes 0."""
    known = np.isfinite(numbers)
    found = np.zeros(numbers.shape, dtype=np.int64)
    found[known] = np.clip(np.rint(numbers[known]), low, high).astype(np.int64)
    return found


def encoded(array: NDArray[Any]) -> bytes:
    """Bytes of a PNG (uint8, uint16; grey or RGB) or TIFF (float32) file."""
    from PIL import Image

    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(array))
    image.save(buffer, format="TIFF" if array.dtype == np.float32 else "PNG")
    return buffer.getvalue()


def _noise_mm(source: Source) -> float:
    """Estimate the standard deviation of the noise: a few scans of the first split, mm.

    From the differences of neighbouring points: 1.4826 times their median absolute deviation is
    the standard deviation of a normal distribution (Hampel 1974), of a difference sqrt(2) times
    the reading's.
    """
    table = source.manifest[source.manifest["split"] == next(iter(source.splits))]
    step = max(1, math.ceil(len(table) / TRIAL_SCANS))
    found = []
    for row in table.iloc[::step].to_dict("records"):
        change = np.diff(source.scan(row).depth_mm, axis=1)
        change = change[np.isfinite(change)]
        if change.size:
            deviation = np.median(np.abs(change - np.median(change)))
            found.append(1.4826 * float(deviation) / math.sqrt(2))
    return float(np.median(found)) if found else 0.0
