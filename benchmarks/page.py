"""The page of the benchmarks, section by section: ratios first, then tables and the plot of growth.

docs/benchmarks.md has marks where each section's own run is filled in.
"""

import importlib.metadata
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.casting import GrowthRow, Row
from benchmarks.end_to_end import SCANS, ScanCost
from benchmarks.page_datasets import (
    aims,
    cost_model,
    dask,
    datasets_section,
    datasets_table,
    hundred_million,
    jobs_section,
    table,
)
from benchmarks.results import Section
from benchmarks.waits import Carving, Packing

PEERS = ("embreex", "trimesh", "Open3D", "VTK", "Embree, refined")
LIBRARIES = ("numpy", "numba", "h5py", "embreex", "trimesh", "open3d", "vtk")
MOST_TRIANGLES = 600_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Machine:
    """What ran the benchmarks."""

    processor: str
    cores: int
    versions: dict[str, str]

    @classmethod
    def here(cls) -> "Machine":
        """Look at this machine."""
        processor = platform.processor() or platform.machine()
        names = Path("/proc/cpuinfo")
        if names.exists():
            lines = [x for x in names.read_text().splitlines() if x.startswith("model name")]
            processor = lines[0].split(":", 1)[1].strip() if lines else processor
        versions = {"python": platform.python_version()}
        for name in LIBRARIES:
            try:
                versions[name] = importlib.metadata.version(name)
            except importlib.metadata.PackageNotFoundError:
                continue
        return cls(processor=processor, cores=os.cpu_count() or 1, versions=versions)


def blocks(found: Mapping[str, Section]) -> dict[str, str]:
    """Return what docs/benchmarks.md shows of each section that was measured."""
    write = {
        "scans": _scans_section, "waits": _waits_section, "jobs": jobs_section,
        "datasets": datasets_section,
        "casting": _casting_section, "growth": _growth_section, "noise": _noise_section,
    }  # fmt: skip
    return {name: _ran(section) + "\n" + write[name](section) for name, section in found.items()}


def _ran(section: Section) -> str:
    """Say what ran a section."""
    machine = Machine(**section.machine)
    versions = ", ".join(f"{name} {version}" for name, version in machine.versions.items())
    return (
        f"One run of {section.seconds / 60:.1f} min, load of the machine before it "
        f"{section.load:.1f}; {machine.processor}, {machine.cores} cores, one thread a process; "
        f"{versions}.\n"
    )


def _scans_section(section: Section) -> str:
    scans: list[ScanCost] = section.facts["scans"]
    full = max(scans, key=lambda cost: cost.profiles * cost.points)
    small = min(scans, key=lambda cost: cost.profiles * cost.points)
    rate: float = section.facts["copied_bytes_per_s"]
    stored: float = section.facts["stored_bytes_per_s"]
    lines = [
        (f"labelled scan, {size.profiles} × {size.points}, processor",
         f"{size.processor_s:.3f} s", aim)
        for size, aim in ((small, "0.035 s"), (full, "0.55 s"))
    ]  # fmt: skip
    lines += [
        ("the larger, clock", f"{full.wall_s:.2f} s", "0.55 s"),
        ("peak memory of that process", f"{full.peak_bytes / 2**30:.2f} GiB", "0.6 GiB"),
        (f"against copying its readings in memory once ({rate / 1e9:.1f} GB/s)",
         f"{full.processor_s * rate / (8 * full.profiles * full.points):.0f} ×", ""),
        (f"of the disk's own time for its bytes ({stored / 1e6:.0f} MB/s with sync)",
         f"{full.processor_s * stored / full.disk_bytes:.1f} ×", ""),
    ]  # fmt: skip
    said = (
        f"The car door with 7 flaws ({full.triangles:,} triangles). Cutting the flaws into the door"
        f", {full.specimen_s:.1f} s, is done once for all scans of a specimen and not counted.\n\n"
    )
    model = (
        "\nA million scans, eight of each flawed door. Core-hours are processor time of one core "
        "like this one's; memory is what each job needs.\n\n"
    )
    return (
        aims(lines) + said + _scans(scans) + model + cost_model(scans)
        + "\n" + hundred_million(scans, section.facts["plan"])
    )  # fmt: skip


def _waits_section(section: Section) -> str:
    carving: list[Carving] = section.facts["carving"]
    packing: list[Packing] = section.facts["packing"]
    waits = [(row.what, row.measured, row.aim) for row in section.facts["uses"]]
    slowest = max(carving, key=lambda row: row.all_s)
    waits.insert(0, (f"seven flaws into {slowest.part}", f"{slowest.all_s:.2f} s", "0.3 s"))
    cut = table(
        ("seven flaws", "triangles", "drawn and carved", "carving", "whole solids : seams",
         "whole part : seams"),
        [
            (row.part, f"{row.triangles:,}", f"{row.all_s:.3f} s", f"{row.seams_s:.3f} s",
             f"{row.local_s / row.seams_s:.2f} ×", f"{row.whole_s / row.seams_s:.2f} ×")
            for row in carving
        ],
    )  # fmt: skip
    zlib = {row.image: row for row in packing if row.way == "zlib"}
    packed = table(
        ("image of 1000 × 4096", "compression", "zlib : written", "zlib : read", "size : zlib's"),
        [
            (row.image, row.way, f"{zlib[row.image].write_s / row.write_s:.1f} ×",
             f"{zlib[row.image].read_s / row.read_s:.1f} ×", f"{row.share:.2f}")
            for row in packing if row.way != "zlib"
        ],
    )  # fmt: skip
    return (
        aims(waits)
        + "Seconds are processor time. *Carving* is the part's booleans alone, of the same cutters "
        "both ways.\n\n" + cut + "\n" + packed
    )


def _casting_section(section: Section) -> str:
    casting: list[Row] = section.facts["casting"]
    sweeps = [row for row in casting if row.caster == "sweep"]
    small = [row.ratio for row in sweeps if row.triangles <= MOST_TRIANGLES]
    absent = "".join(
        f"\n{name}: skipped, the file is missing.\n" for name in section.facts["absent"]
    )
    lines = [("sweep against embreex, slowest mesh", f"{min(small):.0f} ×", "10 ×")]
    return aims(lines) + _casting(casting) + absent


def _growth_section(section: Section) -> str:
    facts = section.facts
    steps = [row.per_doubling for row in facts["triangles"][1:]]
    per_point = [cost.processor_s / (cost.profiles * cost.points) for cost in facts["points"]]
    lines = [
        ("cast's time per doubling of triangles, worst", f"{max(steps):.2f} ×", "1.3 ×"),
        (
            "labelled scan's time per doubling of triangles, worst",
            f"{max(_per_doubling(facts['scanned'])):.2f} ×",
            "1.3 ×",
        ),
        (
            "time per point, largest against smallest scan",
            f"{per_point[-1] / per_point[0]:.2f} ×",
            "1 ×",
        ),
    ]
    return aims(lines) + _growth(facts["triangles"], facts["scanned"], facts["points"])


def _noise_section(section: Section) -> str:
    noise: dict[str, float] = section.facts["noise"]
    return table(("field", "s"), [(name, f"{value:.2f}") for name, value in noise.items()])


def _casting(casting: Sequence[Row]) -> str:
    meshes = dict.fromkeys((row.mesh, row.triangles) for row in casting)
    lines, notes = [], []
    for mesh in meshes:
        by = {row.caster: row for row in casting if (row.mesh, row.triangles) == mesh}
        sweep = by["sweep"]
        ratios = [
            f"{sweep.rays_per_s / by[name].rays_per_s:.1f} ×" if by[name].rays else "–"
            for name in PEERS
        ]
        lines.append((mesh[0], f"{mesh[1]:,}", *ratios, f"{sweep.rays_per_s / 1e6:.0f}"))
        notes += [f"{row.caster} {row.note}" for row in by.values() if not row.rays]
    head = ("mesh", "triangles", *(f"sweep : {name}" for name in PEERS), "sweep, Mrays/s")
    said = table(
        ("caster", *(f"Mrays/s on {name}" for name, _ in meshes)),
        [
            (name, *(_rate(casting, mesh, name) for mesh in meshes))
            for name in ("sweep", *PEERS)
        ],
    )
    noted = "".join(f"\n{note}.\n" for note in dict.fromkeys(notes))
    return table(head, lines) + "\n" + said + noted


def _rate(casting: Sequence[Row], mesh: tuple[str, int], caster: str) -> str:
    (row,) = (r for r in casting if (r.mesh, r.triangles) == mesh and r.caster == caster)
    return f"{row.rays_per_s / 1e6:.2f}" if row.rays else "–"


def _scans(scans: Sequence[ScanCost]) -> str:
    sizes = [f"{cost.profiles} × {cost.points}" for cost in scans]
    lines = [
        (text, *(
            f"{cost.stages_s[key]:.3f} s, {cost.stages_s[key] / cost.wall_s:.0%}" for cost in scans
        ))
        for key, text in SCANS.items()
    ]
    lines += [
        ("**all, clock**", *(f"**{cost.wall_s:.3f} s**" for cost in scans)),
        ("all, processor", *(f"{cost.processor_s:.3f} s" for cost in scans)),
        ("points a second, clock", *(
            f"{cost.profiles * cost.points / cost.wall_s / 1e6:.1f} M" for cost in scans
        )),
        ("bytes per point on disk, all labels", *(
            f"{cost.disk_bytes / (cost.profiles * cost.points):.2f}" for cost in scans
        )),
        ("peak memory", *(f"{cost.peak_bytes / 2**30:.2f} GiB" for cost in scans)),
    ]  # fmt: skip
    return table(("stage", *sizes), lines)


def _per_doubling(scanned: Sequence[ScanCost]) -> list[float]:
    """How much longer each scan takes than the one before, for each doubling of triangles."""
    return [
        (b.processor_s / a.processor_s) ** (1 / math.log2(b.triangles / a.triangles))
        for a, b in pairwise(scanned)
    ]


def _growth(
    grown: Sequence[GrowthRow], of_triangles: Sequence[ScanCost], of_points: Sequence[ScanCost]
) -> str:
    def steps(values: Iterable[float]) -> list[str]:
        return ["", *(f"{value:.2f} ×" for value in values)]

    cast = table(
        ("triangles, 2000 × 4096 points", "cast, processor s", "per doubling"),
        [
            (f"{row.triangles:,}", f"{row.seconds:.3f}", step)
            for row, step in zip(
                grown, steps(row.per_doubling for row in grown[1:]), strict=True
            )
        ],
    )  # fmt: skip
    scanned = table(
        ("triangles, labelled scan of the door", "processor s", "per doubling"),
        [
            (f"{cost.triangles:,}", f"{cost.processor_s:.3f}", step)
            for cost, step in zip(
                of_triangles, steps(_per_doubling(of_triangles)), strict=True
            )
        ],
    )
    points = table(
        ("points, labelled scan of the door", "processor s", "ns per point"),
        [
            (
                f"{cost.profiles * cost.points:,}",
                f"{cost.processor_s:.3f}",
                f"{cost.processor_s / (cost.profiles * cost.points) * 1e9:.0f}",
            )
            for cost in of_points
        ],
    )
    return "\n".join((cast, scanned, points))


def fill(text: str, blocks: Mapping[str, str]) -> str:
    """Put what was measured between a page's marks `<!-- measured: name -->` and `<!-- end -->`.

    Raises
    ------
    ValueError
        Where the page has no such marks.
    """
    for name, content in blocks.items():
        start, end = f"<!-- measured: {name} -->\n", "<!-- end -->"
        before, found, rest = text.partition(start)
        old, closed, after = rest.partition(end)
        if not found or not closed:
            raise ValueError(f"no marks for '{name}'")
        text = f"{before}{start}\n{content}\n{closed}{after}"
    return text


def scaling(found: Mapping[str, Section]) -> dict[str, str]:
    """Return what docs/scaling.md shows of the measurements, by the names of its marks."""
    shown = {}
    if "scans" in found:
        scans: list[ScanCost] = found["scans"].facts["scans"]
        spoken = [
            f"{cost.peak_bytes / 2**30:.2f} GiB for {cost.profiles} × {cost.points} points"
            for cost in scans
        ]
        full = max(scans, key=lambda cost: cost.profiles * cost.points)
        shown["memory"] = (
            f"Measured with a car door of {full.triangles:,} triangles: "
            + ", ".join(spoken) + ".\n"
        )  # fmt: skip
        shown["cost"] = (
            f"Cutting seven flaws into the door takes {full.specimen_s:.1f} s.\n\n"
            + cost_model(scans)
            + "\n" + hundred_million(scans, found["scans"].facts["plan"])
        )
    if "datasets" in found:
        section = found["datasets"]
        shown["datasets"] = datasets_table(section.facts["datasets"]) + "\n" + dask(section)
    return shown


def plot(path: Path, section: Section) -> None:
    """Draw time against triangles at fixed points, and against points on a fixed mesh."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    triangles, scanned, points = (section.facts[k] for k in ("triangles", "scanned", "points"))
    count = [row.triangles for row in triangles]
    left.loglog(count, [row.seconds for row in triangles], "o-", label="cast, wavy sheet")
    left.loglog(
        [cost.triangles for cost in scanned], [cost.processor_s for cost in scanned], "s-",
        label="labelled scan, car door",
    )  # fmt: skip
    limit = [triangles[0].seconds * 1.3**k for k in range(len(triangles))]
    left.loglog(count, limit, "--", color="0.5", label="1.3 × per doubling")
    left.set(xlabel="triangles", ylabel="processor seconds", title="8.2 million points")
    size = [cost.profiles * cost.points for cost in points]
    right.loglog(size, [cost.processor_s for cost in points], "o-", label="labelled scan, measured")
    line = [points[-1].processor_s * n / size[-1] for n in size]
    right.loglog(size, line, "--", color="0.5", label="linear")
    right.set(xlabel="points", ylabel="processor seconds", title="Labelled scan of the car door")
    for axes in (left, right):
        axes.grid(visible=True, which="both", alpha=0.2)
        axes.legend()
    figure.savefig(path, dpi=110)
