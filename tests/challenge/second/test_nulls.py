"""What passes for a null of the second family: no more than its baselines show."""

from dataclasses import replace

import numpy as np
import pytest

from challenge.cases.case import Secret
from challenge.second.case import stage
from challenge.second.edges import off_edges
from challenge.second.nulls import Check, departure, systematic


def surface():
    y, x = np.mgrid[0:120, 0:150].astype(float)
    return 100 + 0.01 * x - 0.02 * y + np.where(x > 90, 2.0, 0.0)


def test_edges_are_left_out_and_slopes_are_not():
    smooth = off_edges(surface())
    assert smooth[20:100, 10:80].all()
    assert not smooth[:, 88:94].any()


def test_noise_alone_departs_as_block_means_of_noise_do():
    truth, rng = surface(), np.random.default_rng(0)
    got, lost, blocks = departure(truth + 0.01 * rng.standard_normal(truth.shape), truth)
    assert got == pytest.approx(1.96 / np.sqrt(12 * 24), rel=0.3)
    assert lost == 0.0
    assert blocks > 20


def test_a_bow_of_a_third_of_the_noise_is_seen():
    truth, rng = surface(), np.random.default_rng(0)
    bow = 0.01 * np.linspace(-1, 1, truth.shape[1]) ** 2
    got, *_ = departure(truth + bow + 0.01 * rng.standard_normal(truth.shape), truth)
    assert got > 0.3


def test_a_null_may_depart_as_its_baselines_do_and_not_more():
    good = {
        "baseline_sd": 0.2, "baseline_lost": 0.0, "lost": 0.001, "blocks": 20,
        "systematic_sd": 0.05,
    }  # fmt: skip
    assert Check(departure_sd=0.35, **good).holds
    assert not Check(departure_sd=0.5, **good).holds
    assert not Check(departure_sd=0.1, **{**good, "lost": 0.02}).holds
    assert not Check(departure_sd=0.0, **{**good, "blocks": 2}).holds
    assert not Check(departure_sd=0.0, **{**good, "systematic_sd": 0.2}).holds


@pytest.mark.slow
def test_a_good_instrument_departs_from_its_mesh_by_noise_alone_and_a_bowed_one_does_not():
    secret = Secret(kind="null", switches=(), strength=1, shape="terraces", recordings=1, seed=2,
                    family="second")  # fmt: skip
    assert systematic(secret, stage(secret).on) < 0.1
    bowed = replace(secret, kind="one", switches=("bowed calibration plate",))
    assert systematic(bowed, stage(bowed).on) > 0.3
