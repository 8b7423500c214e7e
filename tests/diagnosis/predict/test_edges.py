"""Edges: creases and outlines are found, smooth slopes aren't; the law is trusted less there."""

import numpy as np
import pytest

from diagnosis.predict.edges import edge_softness, near_edges, on_edges, reaches_edges
from diagnosis.predict.prediction import law_of
from sensors.casting.laser import Laser
from sensors.effects import CATALOGUE
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import datasheet, part, poses

FINITE = {"name": "finite_spot", "line_sd_um": 200.0}


def seen(name: str, effects: tuple[dict[str, object], ...] = ()) -> tuple[View, np.ndarray]:
    scan = poses(60, pitch_mm=0.3)
    view = View(part(name), SensorModel(datasheet(100, effects)), scan, np.arange(60) / 200.0)
    return view, np.asarray(law_of(view, (), None).mean_mm)


@pytest.mark.parametrize("name", ["domes", "bowl"])
def test_smooth_relief_has_no_edges(name: str) -> None:
    view, plain = seen(name)
    assert near_edges(view, plain).mean() < 0.01


def test_walls_and_roofs_are_edges() -> None:
    view, plain = seen("steps")
    edge = near_edges(view, plain)
    jump = np.abs(np.diff(view.depth_mm, axis=1)) > 1.0
    assert edge[:, 1:][jump].all()
    assert edge.mean() < 0.5
    view, plain = seen("wedge")
    edge = near_edges(view, plain)
    ridge = np.abs(view.part_mm[..., 0] - 3.0) < 0.2
    assert edge[ridge].all()
    assert not edge[np.abs(view.part_mm[..., 0] - 3.0) > 4.0].all()


def test_the_law_is_trusted_to_its_own_correction_at_edges_and_fully_elsewhere() -> None:
    view, plain = seen("wedge", (FINITE,))
    edge = near_edges(view, plain)
    sd, chance = edge_softness(view, plain, edge, lateral_mm=1e-4)
    correction = np.abs(plain - view.depth_mm)
    assert (sd[edge] >= correction[edge] - 1e-12).all()
    assert correction[edge].max() > 0.01  # the roof's ridge is rounded
    assert sd[~edge].max() < 1e-3
    assert chance[~edge].max() == 0.0


def test_whether_a_point_beside_an_outline_is_seen_is_open() -> None:
    view, plain = seen("steps", ({"name": "camera_occlusion"},))
    sd, chance = edge_softness(view, plain, near_edges(view, plain), lateral_mm=1e-4)
    lost = np.isnan(plain)
    border = lost[:, 1:] != lost[:, :-1]
    assert border.any()
    assert (chance[:, 1:][border] > 0).all()
    assert np.isfinite(sd).all()


@pytest.mark.parametrize("order", [1, -1])
def test_an_outline_just_outside_a_recording_is_one(order: int) -> None:
    view, _ = seen("domes")
    view = view.shifted(dx_mm=0.5 * np.ptp(view.scene.vertices_mm[:, 0]))  # past the part's end
    whole = np.isfinite(view.depth_mm)
    last = int(np.flatnonzero(whole.all(axis=0))[-1])
    # the same scan, cut where the part ends: its last column is beside the outline
    cut = view.along(
        Laser(
            x_mm=view.laser.x_mm[: last + 1][::order],
            slope_x=view.laser.slope_x[: last + 1][::order],
        )
    )
    end, inside = (-1 if order > 0 else 0), last // 2
    assert np.isfinite(cut.depth_mm).all()
    assert not whole[:, last + 1].any()
    _, chance = edge_softness(cut, cut.depth_mm, near_edges(cut, cut.depth_mm), 0.01)
    assert (chance[:, end] > 0).all()
    assert (chance[:, inside] == 0).all()
    assert near_edges(cut, cut.depth_mm)[:, end].all()


def test_laws_of_corners_reach_edges_and_have_smooth_places_besides() -> None:
    reach = {name for name, kind in CATALOGUE.items() if reaches_edges(kind)}
    alone = {name for name, kind in CATALOGUE.items() if on_edges(kind)}
    assert reach - alone == {"interreflection"}
    assert {"finite_spot", "edge_mixing"} <= alone
