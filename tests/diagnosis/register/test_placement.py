"""Placements: shifts that add up, and travels that are longer, askew or neither."""

import numpy as np
import pytest

from diagnosis.register.placement import PRIOR_SD, Placement, move, move_all
from tests.support.small_parts import VIEWS, poses

CENTRE = np.array([1.0, -2.0, 3.0])


def test_no_shift_moves_nothing_and_a_rigid_one_keeps_distances() -> None:
    scan = poses(12, **VIEWS[1])
    np.testing.assert_allclose(move(scan, np.zeros(9), CENTRE), scan, atol=1e-12)
    turned = move(scan, np.array([0.3, -0.2, 0.1, 0.02, -0.01, 0.03, 0, 0, 0]), CENTRE)
    was, now = (np.diff(p[:, :3, 3], axis=0) for p in (scan, turned))
    np.testing.assert_allclose(np.linalg.norm(now, axis=1), np.linalg.norm(was, axis=1))
    np.testing.assert_allclose(
        np.einsum("nji,njk->nik", turned[:, :3, :3], turned[:, :3, :3]),
        np.broadcast_to(np.eye(3), (12, 3, 3)), atol=1e-12,
    )


def test_a_longer_travel_stretches_the_way_by_its_share() -> None:
    scan, shift = poses(12), np.zeros(9)
    shift[6] = 1e-3
    way = np.ptp(scan[:, :3, 3], axis=0)
    np.testing.assert_allclose(np.ptp(move(scan, shift, CENTRE)[:, :3, 3], axis=0), 1.001 * way)


def test_a_turn_about_the_centre_leaves_the_centre_where_it_is() -> None:
    scan, shift = poses(12), np.zeros(9)
    shift[3:6] = 0.01, 0.02, -0.03
    moved = move(scan, shift, CENTRE)
    seen = np.einsum("nji,nj->ni", scan[:, :3, :3], CENTRE - scan[:, :3, 3])
    again = np.einsum("nji,nj->ni", moved[:, :3, :3], CENTRE - moved[:, :3, 3])
    np.testing.assert_allclose(again, seen, atol=1e-12)


@pytest.mark.parametrize("every", [1, 2])
def test_profiles_left_out_of_a_sample_move_with_those_in_it(every: int) -> None:
    """The travel counts from the sample's mean, wherever the recording's lies."""
    scan, shift = poses(13, **VIEWS[1]), np.array([0.1, 0, 0, 0, 0.01, 0, 2e-3, 1e-3, 0])
    some = scan[: 2 * every + 3 : every]
    np.testing.assert_allclose(
        move_all(scan, some, shift, CENTRE)[: 2 * every + 3 : every], move(some, shift, CENTRE),
        atol=1e-9,
    )


def test_shifts_in_prior_deviations_add_up() -> None:
    scan = poses(12)
    placed = Placement(shift=np.zeros(9), centre_mm=CENTRE, covariance=np.eye(9), poses=scan)
    step = np.linspace(-1, 1, 9)
    np.testing.assert_allclose(placed.further(step).shift, PRIOR_SD * step)
    assert placed.further(step).poses is scan
    np.testing.assert_allclose(
        placed.moved_by(step).poses, move(scan, PRIOR_SD * step, CENTRE), atol=1e-12
    )
