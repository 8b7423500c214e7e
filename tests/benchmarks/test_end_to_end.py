"""The end-to-end benchmark and its page, on a small scale."""

import dataclasses

import pytest

from benchmarks import page, results, waits
from benchmarks.casting import GrowthRow, Row
from benchmarks.datasets import BatchCost, JobCost, PlanCost, batches, plan_cost
from benchmarks.end_to_end import HOME, SCANS, scan_cost
from pipeline.recipe import Recipe

PLATE = "  - builtin: steel_plate\n    parameters: {length_mm: 500, width_mm: 450}"


@pytest.fixture(scope="module")
def cost():
    return scan_cost(24, 32, rounds=2, part=PLATE)


def test_the_stages_make_up_the_scan(cost):
    assert set(cost.stages_s) == set(SCANS)
    assert all(seconds > 0 for seconds in cost.stages_s.values())
    assert sum(cost.stages_s.values()) == pytest.approx(cost.wall_s, rel=0.5)
    assert cost.disk_bytes > 24 * 32
    assert cost.peak_bytes > 1e7
    assert cost.triangles > 1000


def test_the_datasets_are_what_their_names_say(tmp_path):
    recipes = {name: Recipe.load(path) for name, path in batches(tmp_path).items()}
    for name, recipe in recipes.items():
        assert f"{recipe.file.profiles} × {recipe.points}" in name
    parts, specimens, scans = zip(
        *((len(r.file.parts), r.file.specimens, r.file.scans) for r in recipes.values()),
        strict=True,
    )
    assert (parts, specimens, scans) == (
        (3, 3, 1, 1), (4, 8, 1, 1), (4, 8, 200, 200),
    )  # fmt: skip


@pytest.fixture
def found(cost):
    casting = [
        Row(mesh="m", triangles=9, caster=name, rays=rays, rays_per_s=rate, ratio=rate / 2e6,
            note="" if rays else "skipped: No module named 'vtkmodules'")
        for name, rays, rate in (
            ("sweep", 5, 50e6), ("embreex", 5, 2e6), ("trimesh", 5, 1e6), ("Open3D", 5, 4e6),
            ("VTK", 0, 0.0), ("Embree, refined", 5, 5e6),
        )
    ]  # fmt: skip
    larger = dataclasses.replace(cost, profiles=48, processor_s=4 * cost.processor_s)
    triangles = [
        GrowthRow(triangles=10, seconds=1.0, per_doubling=float("nan")),
        GrowthRow(triangles=20, seconds=1.25, per_doubling=1.25),
    ]
    scanned = dataclasses.replace(
        cost, triangles=4 * cost.triangles, processor_s=2.25 * cost.processor_s
    )
    facts = {
        "scans": {
            "scans": [cost, larger], "copied_bytes_per_s": 8e9,
            "stored_bytes_per_s": 1e9,
            "plan": PlanCost(scans=1000, seconds=0.5, peak_bytes=10**6, row_bytes=100.0),
        },
        "waits": {
            "carving": [
                waits.Carving(
                    part="p", triangles=9, all_s=0.5, seams_s=0.125, local_s=0.25, whole_s=0.5
                )
            ],
            "packing": [
                waits.Packing(image="i", way=way, write_s=one, read_s=one, share=1 / one)
                for way, one in (("zlib", 4.0), ("lz4", 2.0))
            ],
            "uses": [waits.Use(what="wait", measured="1 s", aim="2 s")],
        },
        "jobs": {"jobs": [JobCost(name="job", processor_s={1: 20.0, 8: 27.0}, serial_s=1.0)]},
        "datasets": {
            "datasets": [
                BatchCost(
                    name=name, scans=4, seconds={1: [4.0, 6.0], 2: [2.0, 4.0]},
                    apart_s=[5.0, 8.0], disk_bytes=10,
                )
                for name in ("first", "second")
            ],
            "dask_s": None,
        },
        "casting": {"casting": casting, "absent": ["gone.stl"]},
        "growth": {"triangles": triangles, "scanned": [cost, scanned], "points": [cost, larger]},
        "noise": {"noise": {"field": 0.5}},
    }  # fmt: skip
    machine = dataclasses.asdict(page.Machine.here())
    return {
        name: results.Section(machine=machine, load=0.25, seconds=90.0, facts=one)
        for name, one in facts.items()
    }


def test_the_plan_and_the_tables_of_a_scan_are_small():
    cost = plan_cost(800)
    assert 0 < cost.peak_bytes < 1e7
    assert 500 < cost.row_bytes < 20_000


def test_what_is_serial_bounds_the_speed_up():
    batch = JobCost(name="d", processor_s={1: 20.0, 8: 34.0}, serial_s=2.0)
    assert batch.each_job_s == 2.0
    assert batch.speed_up(1) == 1.0
    assert batch.speed_up(2) == pytest.approx(20 / (4 + 8))
    assert batch.speed_up(10**9) == pytest.approx(20 / 4)


def test_the_page_puts_ratios_first(cost, found, tmp_path):
    text = "\n".join(page.blocks(found).values())
    assert "| sweep against embreex, slowest mesh | 25 × | 10 × |" in text
    assert "| 2 jobs against 1, best of 2: second | 2.00 × of 1.60 | 1.85 of 2 |" in text
    assert "| cast's time per doubling of triangles, worst | 1.25 × | 1.3 × |" in text
    assert "| labelled scan's time per doubling of triangles, worst | 1.50 × | 1.3 × |" in text
    assert "One run of 1.5 min, load of the machine before it 0.2;" in text
    assert "| time per point, largest against smallest scan | 2.00 × | 1 × |" in text
    assert "| m | 9 | 25.0 × | 50.0 × | 12.5 × | – | 10.0 × | 50 |" in text
    assert "| p | 9 | 0.500 s | 0.125 s | 2.00 × | 4.00 × |" in text
    assert "| i | lz4 | 2.0 × | 2.0 × | 0.50 |" in text
    assert "| seven flaws into p | 0.50 s | 0.3 s |" in text
    assert "| job | 20.0 s | 1.0 s, 5% | 1.00 s, 5.0% | 1.82 × | 4.71 × |" in text
    assert "| 24 × 32 | " in text.split("a hundred million scans, on paper")[1]
    assert "| 833 min, 100 GB | 10 GB |" in text
    assert "VTK skipped: No module named 'vtkmodules'" in text
    assert "gone.stl: skipped" in text
    assert "Dask isn't installed: skipped" in text
    each_s = cost.processor_s + cost.specimen_s / 8
    assert f"| {3600 / each_s:,.0f} |" in text
    page.plot(tmp_path / "growth.png", found["growth"])
    assert (tmp_path / "growth.png").stat().st_size > 5000


def test_sections_are_kept_and_read_one_by_one(found, tmp_path):
    assert set(found) == set(results.SECTIONS)
    for number, (name, section) in enumerate(found.items(), start=1):
        results.keep(tmp_path, name, section)
        assert len(results.read(tmp_path)) == number
    assert page.blocks(results.read(tmp_path)) == page.blocks(found)


def test_a_section_alone_leaves_the_others_as_they_were(found):
    text = (HOME / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    noise = page.blocks({"noise": found["noise"]})
    filled = page.fill(text, noise)
    assert "| field | 0.50 |" in filled
    mark = "<!-- measured: noise -->"
    assert filled.partition(mark)[0] == text.partition(mark)[0]


def test_the_page_on_scaling_is_filled_and_can_be_filled_again(cost, found):
    text = (HOME / "docs" / "scaling.md").read_text(encoding="utf-8")
    batch = BatchCost(
        name="d", scans=4, seconds={1: [4.0], 2: [2.0]}, apart_s=[4.0], disk_bytes=10
    )
    found["scans"].facts["scans"] = [cost]
    found["datasets"].facts.update({"datasets": [batch, batch], "dask_s": 7.25})
    once = page.fill(text, page.scaling(found))
    assert "in 7.2 s" in once
    assert f"{cost.triangles:,} triangles" in once
    found["datasets"].facts["dask_s"] = 8.5
    again = page.fill(once, page.scaling(found))
    assert "in 8.5 s" in again
    assert "in 7.2 s" not in again
    with pytest.raises(ValueError, match="no marks for 'cost'"):
        page.fill("nothing", {"cost": "x"})
