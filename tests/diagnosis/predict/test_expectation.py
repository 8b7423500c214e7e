"""What a model changes counts by its share, at edges by another; under motion whole."""

import numpy as np
import pytest

from diagnosis.data.patch import Patch
from diagnosis.model.workspace import Workspace
from diagnosis.predict.expectation import Shares, expect
from diagnosis.predict.prediction import predict
from diagnosis.settings import SETTINGS
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.pose_error import PoseError
from tests.support.effect_case import bench_workspace

WIDE = FiniteSpot(line_sd_um=300.0)


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("wedge")


def change(ws: Workspace, patch: Patch, share: float | None, *effects: object) -> np.ndarray:
    whole = np.ones(len(SETTINGS.predict.size_classes))
    shares = None if share is None else Shares(off_edges=0.5 * whole, at_edges=share * whole)
    with_effects, without = (
        expect(patch.view, of, ws.noise, patch.edge, shares=shares) for of in (effects, ())
    )
    return with_effects.mean_mm - without.mean_mm


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_a_share_scales_the_change_at_edges_and_off_them(ws: Workspace, share: float) -> None:
    patch = ws.patches[0]
    whole, part = change(ws, patch, None, WIDE), change(ws, patch, share, WIDE)
    at, off = patch.edge & np.isfinite(whole), ~patch.edge & np.isfinite(whole)
    assert np.abs(whole[at]).max() > ws.noise.sd_mm
    assert np.allclose(part[at], share * whole[at], atol=1e-12)
    assert np.allclose(part[off], 0.5 * whole[off], atol=1e-12)


def test_what_moves_the_sensor_counts_whole(ws: Workspace) -> None:
    patch, pose = ws.patches[0], PoseError(roll_deg=0.1)
    assert np.array_equal(
        change(ws, patch, 0.0, pose), change(ws, patch, None, pose), equal_nan=True
    )


def test_without_shares_it_is_the_prediction(ws: Workspace) -> None:
    patch = ws.patches[0]
    expected = expect(patch.view, (WIDE,), ws.noise, patch.edge)
    predicted = predict(patch.view, (WIDE,), ws.noise)
    assert np.array_equal(expected.mean_mm, predicted.mean_mm, equal_nan=True)
    assert np.array_equal(expected.sd_mm, predicted.sd_mm)
