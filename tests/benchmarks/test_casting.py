"""The casting benchmark runs, on a small scale."""

import pytest
import trimesh

from benchmarks.casting import growth_rows, rows, wavy_sheet
from sensors.casting.scene import Scene


def test_every_caster_is_measured_or_skipped_with_a_word():
    ball = trimesh.creation.icosphere(2, 100)
    table = rows(
        [("ball", Scene(ball.vertices, ball.faces))], profiles=40, points=64, share=4, rounds=1
    )
    by_caster = {row.caster: row for row in table}
    assert {"sweep", "Embree, refined", "embreex", "trimesh", "Open3D", "VTK"} == set(by_caster)
    assert by_caster["embreex"].ratio == 1
    assert by_caster["sweep"].rays == 40 * 64
    for row in table:
        assert (row.rays_per_s > 0) != row.note.startswith("skipped")
        assert row.triangles == len(ball.faces)


@pytest.mark.parametrize("triangles", [1000, 20_000])
def test_the_wavy_sheet_is_a_closed_solid(triangles):
    scene = wavy_sheet(triangles)
    mesh = trimesh.Trimesh(scene.vertices_mm, scene.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(520 * 460 * 2, rel=1e-3)
    assert len(scene.faces) == pytest.approx(triangles, rel=0.2)


def test_growth_is_timed_against_the_mesh_before():
    table = growth_rows(profiles=20, points=32, doublings=1, rounds=1)
    assert [row.triangles for row in table] == sorted(row.triangles for row in table)
    assert table[1].per_doubling == pytest.approx(table[1].seconds / table[0].seconds)
