"""The page of the benchmarks: tables with the ratios first, and the plot of growth."""

import importlib.metadata
import math
import os
import platform
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.casting import Row
from benchmarks.end_to_end import SCANS, BatchCost, ScanCost
from benchmarks.results import SECTIONS, Results

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


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Lay out a Markdown table, first column to the left, the others to the right."""
    rule = [":---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, rule, *lines)) + "\n"


def write(found: Results) -> str:
    """Return the page's text."""
    full = max(found.scans, key=lambda cost: cost.profiles * cost.points)
    machine = Machine(**found.machine)
    versions = ", ".join(f"{name} {version}" for name, version in machine.versions.items())
    runs = ", ".join(
        f"{name} {found.seconds[name] / 60:.1f} min ({found.load[name]:.1f})" for name in SECTIONS
    )
    parts = [
        "# Benchmarks\n",
        "Made by `make bench`; every number on this page is the command's, and those of a table "
        f"are of one run. {machine.processor}, {machine.cores} cores, one thread a process; "
        f"{versions}. Sections (load of the machine before each): {runs}.\n",
        "Figures are medians over repeats within the run. *Clock* is elapsed time; *processor* is "
        "the processor time of one core, which depends less on other work on the machine.\n",
        "## In short\n",
        _in_short(full, found),
        "## Casting, side by side\n",
        "How many times faster the sweep is than each peer, on the same mesh in the same run "
        "(processor time, 2000 profiles of 4096 points; slow peers get every 20th profile, VTK "
        "20,000 rays). The sweep computes in double precision; embreex, Open3D and trimesh "
        "search in single precision. *Embree, refined* is this package's own caster for curved "
        "paths, with the sweep's results.\n",
        _casting(found.casting),
        *(f"{name}: skipped, the file is missing.\n" for name in found.absent),
        "## A labelled scan\n",
        "Flawed and clean cast, camera's shadows, noise, masks, checksum, compression and "
        "writing; the car door with 7 flaws "
        f"({full.triangles:,} triangles). Cutting the flaws into the door, "
        f"{full.specimen_s:.1f} s, is done once for all scans of a specimen and not counted.\n",
        _scans(found.scans),
        "## Datasets with 1 and 2 jobs\n",
        "The whole command, start-up and specimens included, in turns. *Limit* is the speed-up of "
        "two independent runs of 1 job each over one such run: cores share caches, memory and "
        "other work.\n",
        _datasets(found.datasets),
        _dask(found),
        "## Cost of a million scans\n",
        "From the figures above, eight scans of each flawed door. Core-hours are processor time "
        "of one core like this one's; memory is what each job needs.\n",
        _cost_model(found.scans),
        "## Growth\n",
        "![time against points and triangles](pictures/growth.png)\n",
        "A profile cuts about √(2T) triangles of a sheet of T: where these cuts are most of a cast,"
        " it takes 1.41 × as long per doubling, however fast each of them is.\n",
        _growth(found),
        "## Noise\n",
        "Perlin noise on 2000 × 4096 points, one core:\n",
        table(("field", "s"), [(name, f"{value:.2f}") for name, value in found.noise.items()]),
    ]
    return "\n".join(parts)


def _in_short(full: ScanCost, found: Results) -> str:
    sweeps = [row for row in found.casting if row.caster == "sweep"]
    small = [row.ratio for row in sweeps if row.triangles <= MOST_TRIANGLES]
    steps = [row.per_doubling for row in found.triangles[1:]]
    per_point = [cost.processor_s / (cost.profiles * cost.points) for cost in found.points]
    lines = [
        ("sweep against embreex, slowest mesh", f"{min(small):.0f} ×", "10 ×"),
        ("labelled scan, 2000 × 4096, clock", f"{full.wall_s:.2f} s", "2.5 s"),
        ("the same, processor", f"{full.processor_s:.2f} s", "2.5 s"),
        ("peak memory of that process", f"{full.peak_bytes / 2**30:.2f} GiB", "1.2 GiB"),
        *(
            (
                f"2 jobs against 1, best of {len(batch.ratios)}: {batch.name}",
                f"{max(batch.ratios):.2f} × of {max(batch.limits):.2f}",
                "1.8 ×",
            )
            for batch in found.datasets[1:]
        ),
        ("cast's time per doubling of triangles, worst", f"{max(steps):.2f} ×", "1.3 ×"),
        (
            "labelled scan's time per doubling of triangles, worst",
            f"{max(_per_doubling(found.scanned)):.2f} ×",
            "1.3 ×",
        ),
        (
            "time per point, largest against smallest scan",
            f"{per_point[-1] / per_point[0]:.2f} ×",
            "1 ×",
        ),
    ]
    return table(("", "measured", "aim"), lines)


def _middle(values: Sequence[float]) -> float:
    return statistics.median(values)


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
    text = table(head, lines)
    said = table(
        ("caster", *(f"Mrays/s on {name}" for name, _ in meshes)),
        [
            (name, *(_rate(casting, mesh, name) for mesh in meshes))
            for name in ("sweep", *PEERS)
        ],
    )
    return text + "\n" + said + "".join(f"\n{note}.\n" for note in dict.fromkeys(notes))


def _rate(casting: Sequence[Row], mesh: tuple[str, int], caster: str) -> str:
    (row,) = (r for r in casting if (r.mesh, r.triangles) == mesh and r.caster == caster)
    return f"{row.rays_per_s / 1e6:.2f}" if row.rays else "–"


def _scans(scans: Sequence[ScanCost]) -> str:
    sizes = [f"{cost.profiles} × {cost.points}" for cost in scans]
    lines = [
        (text, *(f"{cost.stages_s[key]:.3f} s" for cost in scans)) for key, text in SCANS.items()
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


def _datasets(datasets: Sequence[BatchCost]) -> str:
    lines = []
    for batch in datasets:
        one, two = (_middle(batch.seconds[jobs]) for jobs in (1, 2))
        ratios = ", ".join(f"{ratio:.2f}" for ratio in batch.ratios)
        lines.append(
            (
                batch.name, f"{_middle(batch.ratios):.2f} × ({ratios})",
                f"{_middle(batch.limits):.2f} ×", f"{one:.1f} s",
                f"{two:.1f} s", f"{60 / one:.1f}", f"{60 / two:.1f}",
                f"{batch.disk_bytes / 1e6:.1f} MB",
            )
        )  # fmt: skip
    head = (
        "dataset", "2 jobs against 1 (each turn)", "limit", "1 job", "2 jobs",
        "a minute, 1 job", "a minute, 2 jobs", "on disk",
    )  # fmt: skip
    return table(head, lines)


SCANS_PER_SPECIMEN = 8


def _cost_model(scans: Sequence[ScanCost]) -> str:
    lines = []
    for cost in scans:
        shared_s = cost.specimen_s / SCANS_PER_SPECIMEN
        each_s = cost.processor_s + shared_s
        lines.append(
            (
                f"{cost.profiles} × {cost.points}",
                f"{cost.processor_s:.2f} s + {shared_s:.2f} s",
                f"{3600 / each_s:,.0f}",
                f"{cost.disk_bytes / 1e6:.2f} MB",
                f"{each_s * 1e6 / 3600:,.0f}",
                f"{cost.disk_bytes * 1e6 / 1e12:.2f} TB",
                f"{cost.peak_bytes / 2**30:.2f} GiB",
            )
        )
    head = (
        "scan", "scan + its share of the specimen", "scans a core-hour", "on disk",
        "core-hours for a million", "disk for a million", "memory a job",
    )  # fmt: skip
    return table(head, lines)


def _per_doubling(scanned: Sequence[ScanCost]) -> list[float]:
    """How much longer each scan takes than the one before, for each doubling of triangles."""
    return [
        (b.processor_s / a.processor_s) ** (1 / math.log2(b.triangles / a.triangles))
        for a, b in pairwise(scanned)
    ]


def _growth(found: Results) -> str:
    def steps(values: Iterable[float]) -> list[str]:
        return ["", *(f"{value:.2f} ×" for value in values)]

    cast = table(
        ("triangles, 2000 × 4096 points", "cast, processor s", "per doubling"),
        [
            (f"{row.triangles:,}", f"{row.seconds:.3f}", step)
            for row, step in zip(
                found.triangles, steps(row.per_doubling for row in found.triangles[1:]),
                strict=True,
            )
        ],
    )  # fmt: skip
    scanned = table(
        ("triangles, labelled scan of the door", "processor s", "per doubling"),
        [
            (f"{cost.triangles:,}", f"{cost.processor_s:.3f}", step)
            for cost, step in zip(
                found.scanned, steps(_per_doubling(found.scanned)), strict=True
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
            for cost in found.points
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


def scaling(found: Results) -> dict[str, str]:
    """Return what docs/scaling.md shows of the measurements, by the names of its marks."""
    spoken = [
        f"{cost.peak_bytes / 2**30:.2f} GiB for {cost.profiles} × {cost.points} points"
        for cost in found.scans
    ]
    full = max(found.scans, key=lambda cost: cost.profiles * cost.points)
    return {
        "memory": f"Measured with a car door of {full.triangles:,} triangles: "
        + ", ".join(spoken) + ".\n",
        "datasets": _datasets(found.datasets) + ("\n" + _dask(found)),
        "cost": f"Cutting seven flaws into the door takes {full.specimen_s:.1f} s.\n\n"
        + _cost_model(found.scans),
    }  # fmt: skip


def _dask(found: Results) -> str:
    if found.dask_s is None:
        return "Dask isn't installed: skipped.\n"
    name = found.datasets[1].name
    return f"Two Dask workers on this machine: {name}, in {found.dask_s:.1f} s.\n"


def plot(path: Path, found: Results) -> None:
    """Draw time against triangles at fixed points, and against points on a fixed mesh."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    triangles, scanned, points = found.triangles, found.scanned, found.points
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
