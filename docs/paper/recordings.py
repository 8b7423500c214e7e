"""Real recordings: fit on one half of a scan, compare with the other half."""

import base64
import json
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sensors.noise.calibration import Solution, calibrate
from sensors.noise.noise_target import NoiseTarget, distribution, measure, simulate
from sensors.noise.perlin import PerlinField
from sensors.noise.spectrum import decibels
from sensors.recording import repeated_rows
from sensors.surface.form import remove_form
from sensors.surface.roughness import roughness
from sensors.surface.surface import Surface

Floats = NDArray[np.float64]

SHARED = Path(__file__).resolve().parents[3] / "shared" / "real"


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of a real recording without form of its own."""

    key: str
    what: str
    file: str
    rows: tuple[int, int] | None = None
    columns: tuple[int, int] | None = None
    cutoff_mm: float = 2.5
    split: int = 0


REGIONS = (
    Region(
        key="panel",
        what="OCR_3D 42, flat panel (laser triangulation)",
        file="sick/OCR_3D_image_42.json",
        rows=(10, 230),
        columns=(250, 640),
    ),
    Region(
        key="strip",
        what="StripGroove, upper face (laser triangulation)",
        file="sick/StripGroove_image_9.json",
        rows=(40, 450),
        columns=(165, 415),
    ),
    Region(
        key="base",
        what="OCR_3D 34, base beside the panel (laser triangulation)",
        file="sick/OCR_3D_image_34.json",
        rows=(680, 764),
        columns=(20, 640),
    ),
    Region(
        key="x3p",
        what="x3p-2, 83 × 204 µm (topography)",
        file="roughness/x3p-2.x3p",
        cutoff_mm=0.01,
    ),
    Region(
        key="sur", what="sur-2, 2 × 1.7 mm (topography)", file="roughness/sur-2.sur", cutoff_mm=0.25
    ),
    Region(
        key="stylus",
        what="Mitutoyo stylus, one profile of 10 mm",
        file="roughness/mitutoyo_2_profile_x_mm_z_um.csv",
        cutoff_mm=0.8,
        split=1,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What the unseen half says."""

    region: Region
    wanted: NoiseTarget
    solution: Solution
    real: Floats
    errors: Floats
    halves: Floats
    verbatim: Floats
    ks: float
    along_db: Floats
    across_db: Floats
    unseen: Floats
    simulated: list[Floats]


def load(region: Region) -> tuple[Floats, float, float, float]:
    """Return readings, pitches and ΔZ, all mm; repeated rows of a laser scan dropped."""
    path = SHARED / region.file
    if path.suffix == ".json":
        image = json.loads(path.read_text())[0]["data"]
        pixels, size = image["Data"]["Pixels"], image["PixelSize"]
        order = ">" if pixels["endian"] == "big" else "<"
        raw = np.frombuffer(base64.b64decode(pixels["data"]), dtype=order + "u2")
        raw = raw.reshape(image["Data"]["Height"], image["Data"]["Width"])
        heights = np.where(raw == 0, np.nan, raw * size["z"])
        heights = heights[~repeated_rows(heights)]
        pitch_x, pitch_y, step = size["x"], size["y"], size["z"]
    elif path.suffix == ".csv":
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        heights = table[None, :, 1] / 1000.0
        pitch_x = pitch_y = float(np.median(np.diff(table[:, 0])))
        step = 0.0
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SurfaceTopography import open_topography

            topography = open_topography(path).topography().to_unit("mm")
            heights = np.ma.filled(topography.heights().astype(float), np.nan).T
            pitch_x, pitch_y = (float(p) for p in topography.pixel_size)
        step = 0.0
    rows, columns = slice(*(region.rows or (None,))), slice(*(region.columns or (None,)))
    return heights[rows, columns], pitch_x, pitch_y, step


def compare(region: Region) -> Outcome:
    """Fit on the first half, compare with the second."""
    heights, pitch_x, pitch_y, step = load(region)
    first, second = np.array_split(heights, 2, axis=region.split)
    seen, unseen = (
        measure(half, pitch_x, pitch_y, resolution_mm=step, cutoff_mm=region.cutoff_mm)
        for half in (first, second)
    )
    solution = calibrate(seen)

    def draw(field: PerlinField, seeds: int = 10) -> list[Floats]:
        return [
            remove_form(
                simulate(
                    field,
                    unseen,
                    np.random.default_rng([s, 5]),
                    np.random.default_rng([s, 6]),
                ),
                pitch_x,
                region.cutoff_mm,
            )
            for s in range(seeds)
        ]

    wanted = np.array(list(unseen.figures().values()))
    simulated = draw(solution.field, 40 if heights.shape[0] == 1 else 10)
    found = np.mean([roughness(z, pitch_x).values() for z in simulated], axis=0)
    paper = Surface(
        name=region.key,
        **{k: v for k, v in seen.figures().items() if k in ("rpm_mm", "rvm_mm", "pc_per_mm")},
    ).field(verbatim=True, normalised=True)
    verbatim = np.mean([roughness(z, pitch_x).values() for z in draw(paper, 4)], axis=0)
    flat = remove_form(second, pitch_x, region.cutoff_mm)
    along, across = spectra_db(unseen, simulated)
    return Outcome(
        region=region,
        wanted=unseen,
        solution=solution,
        real=wanted,
        errors=100.0 * (found / wanted - 1.0),
        halves=100.0 * (np.array(list(seen.figures().values())) / wanted - 1.0),
        verbatim=100.0 * (verbatim / wanted - 1.0),
        ks=kolmogorov_smirnov(flat, np.concatenate([z.ravel() for z in simulated])),
        along_db=along,
        across_db=across,
        unseen=flat,
        simulated=simulated,
    )


def spectra_db(wanted: NoiseTarget, simulated: list[Floats]) -> tuple[Floats, Floats]:
    """Return simulated against real densities in the bands along and across, dB."""
    parts = [distribution(wanted, z) for z in simulated]
    results = []
    for k, target in ((1, wanted.spectrum_along), (2, wanted.spectrum_across)):
        if target is None:
            results.append(np.empty(0))
        else:
            power = np.mean([part[k] for part in parts], axis=0)
            results.append(decibels(power, np.array(target)))
    return results[0], results[1]


def kolmogorov_smirnov(a: Floats, b: Floats) -> float:
    """Return the largest distance of the two distributions, each without its mean."""
    from scipy.stats import ks_2samp

    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    return float(ks_2samp(a - a.mean(), b - b.mean()).statistic)


def shuffled(outcome: Outcome) -> tuple[float, float]:
    """Return KS and worst spectral error of the unseen half with its own points shuffled."""
    rng = np.random.default_rng(1)
    values = outcome.unseen.copy()
    finite = np.isfinite(values)
    values[finite] = rng.permutation(values[finite])
    along, across = spectra_db(outcome.wanted, [values])
    worst = float(np.max(np.abs(np.concatenate((along, across)))))
    return kolmogorov_smirnov(outcome.unseen, values), worst


def table(outcomes: list[Outcome]) -> list[str]:
    """Return the comparison as Markdown."""
    lines = [
        "| recording | | Ra | Rq | Rp | Rv | Rpm | Rvm | Pc | KS | spectrum along | across |",
        "| --- | --- |" + " ---: |" * 10,
    ]
    for o in outcomes:
        along = f"{np.abs(o.along_db).max():.1f} dB"
        across = f"{np.abs(o.across_db).max():.1f} dB" if o.across_db.size else "one profile"
        rows = (
            ("**simulated, fitted on the first half**", o.errors, f"{o.ks:.3f}", along, across),
            ("first half itself", o.halves, "", "", ""),
            ("equation 9, normalised", o.verbatim, "", "", ""),
        )
        for k, (what, errors, *rest) in enumerate(rows):
            cells = [f"{e:+.1f} %" for e in errors]
            name = o.region.what if k == 0 else ""
            lines.append(f"| {name} | {what} | " + " | ".join(cells + list(rest)) + " |")
    return lines
