"""The benchmarks' page on whole datasets: jobs, costs, and what large numbers of scans take."""

import statistics
from collections.abc import Iterable, Sequence

from benchmarks.datasets import MANY_JOBS, BatchCost, JobCost, PlanCost
from benchmarks.end_to_end import ScanCost
from benchmarks.results import Section
from pipeline.batch.plan import MOST_PER_SHARD


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Lay out a Markdown table, first column to the left, the others to the right."""
    rule = [":---", *["---:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, rule, *lines)) + "\n"


def aims(lines: Sequence[Sequence[str]]) -> str:
    """Lay out what was measured beside its aim."""
    return table(("", "measured", "aim"), lines) + "\n"


def datasets_section(section: Section) -> str:
    """Lay out 1 and 2 jobs by the clock."""
    datasets: list[BatchCost] = section.facts["datasets"]
    lines = [
        (
            f"2 jobs against 1, best of {len(batch.ratios)}: {batch.name}",
            f"{max(batch.ratios):.2f} × of {max(batch.limits):.2f}",
            "1.85 of 2",
        )
        for batch in datasets[1:]
    ]
    return aims(lines) + datasets_table(datasets) + "\n" + dask(section)


def jobs_section(section: Section) -> str:
    """Lay out what jobs add, in processor time."""
    jobs: list[JobCost] = section.facts["jobs"]
    worst = max(job.serial_s / job.processor_s[1] for job in jobs)
    return aims([("serial part, worst", f"{worst:.0%}", "3%")]) + table(
        ("dataset", "1 job", "serial", "each job adds", "2 jobs", f"{MANY_JOBS} jobs"),
        [
            (
                job.name, f"{job.processor_s[1]:.1f} s",
                f"{job.serial_s:.1f} s, {job.serial_s / job.processor_s[1]:.0%}",
                f"{job.each_job_s:.2f} s, {job.each_job_s / job.processor_s[1]:.1%}",
                f"{job.speed_up(2):.2f} ×", f"{job.speed_up(MANY_JOBS):.2f} ×",
            )
            for job in jobs
        ],
    )  # fmt: skip


def datasets_table(datasets: Sequence[BatchCost]) -> str:
    """Lay out each dataset with 1 and 2 jobs."""
    lines = []
    for batch in datasets:
        one, two = (statistics.median(batch.seconds[jobs]) for jobs in (1, 2))
        ratios = ", ".join(f"{ratio:.2f}" for ratio in batch.ratios)
        lines.append(
            (
                batch.name, f"{statistics.median(batch.ratios):.2f} × ({ratios})",
                f"{statistics.median(batch.limits):.2f} ×", f"{one:.1f} s",
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


def cost_model(scans: Sequence[ScanCost]) -> str:
    """Lay out what a million scans of each size take."""
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


HUNDRED_MILLION = 100_000_000


def hundred_million(scans: Sequence[ScanCost], plan: PlanCost) -> str:
    """Lay out what a hundred million scans would take, on paper: straight lines of the above."""
    shared = HUNDRED_MILLION / plan.scans
    lines = []
    for cost in scans:
        each_s = cost.processor_s + cost.specimen_s / SCANS_PER_SPECIMEN
        lines.append(
            (
                f"{cost.profiles} × {cost.points}",
                f"{each_s * HUNDRED_MILLION / 3.6e6:,.0f} hours",
                f"{cost.disk_bytes * HUNDRED_MILLION / 1e12:,.0f} TB",
                f"{HUNDRED_MILLION / MOST_PER_SHARD / 1e6:.1f} million",
                f"{plan.seconds * shared / 60:.0f} min, {plan.peak_bytes * shared / 1e9:.0f} GB",
                f"{plan.row_bytes * HUNDRED_MILLION / 1e9:,.0f} GB",
            )
        )
    head = (
        "a hundred million scans, on paper", "1000 cores", "disk", "shards",
        "the plan, one process", "manifest.* and flaws.*",
    )  # fmt: skip
    return table(head, lines) + (
        f"\nPlan and tables are measured on {plan.scans:,} and 32 scans; the rest is the table "
        "above. Plan and tables are made by one process: from some ten million scans on, several "
        "recipes with seeds of their own are the better datasets.\n"
    )


def dask(section: Section) -> str:
    """Say how long two Dask workers took."""
    dask_s: float | None = section.facts["dask_s"]
    if dask_s is None:
        return "Dask isn't installed: skipped.\n"
    name = section.facts["datasets"][1].name
    return f"Two Dask workers on this machine: {name}, in {dask_s:.1f} s.\n"
