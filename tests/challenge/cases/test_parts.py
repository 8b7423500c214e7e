"""Parts of sealed cases: closed, filleted, warped as their formulas say."""

import numpy as np
import pytest

from challenge.cases.parts import SHAPES, bent, corners, solid_of


@pytest.mark.parametrize("shape", list(SHAPES))
def test_parts_are_closed_solids(shape):
    for seed in range(3):
        solid = solid_of(SHAPES[shape](np.random.default_rng(seed)))
        edges = np.sort(solid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        assert (count == 2).all()
        a, b, c = np.moveaxis(solid.vertices_mm[solid.faces], 1, 0)
        assert np.sum(a * np.cross(b, c)) / 6 > 1000


def test_fillet_adds_material_in_the_corner_only():
    sharp = solid_of(corners(np.random.default_rng(3)))
    round_ = solid_of(corners(np.random.default_rng(3), 0.8))

    def volume(solid):
        a, b, c = np.moveaxis(solid.vertices_mm[solid.faces], 1, 0)
        return np.sum(a * np.cross(b, c)) / 6

    # for each wall (tan(φ/2) - φ/2) r² of section, φ the wall's angle of 40 to 56 degrees
    added = volume(round_) - volume(sharp)
    low, high = (0.8**2 * (np.tan(a / 2) - a / 2) for a in np.radians([40, 56]))
    # (walls may cover a part of each other's corners)
    assert 0.2 * 2 * low * 14 < added < 2.1 * high * 14


def test_warp_follows_its_formula():
    flat = solid_of(SHAPES["terraces"](np.random.default_rng(0)))
    warped = bent(flat, 0.1, 0.0, 0)
    ends = np.abs(warped.vertices_mm[:, 0]) > 17.99
    assert warped.vertices_mm[ends, 2].min() == pytest.approx(-6.0 - 0.1, abs=1e-6)
