"""Where an explained departure is marked."""

import numpy as np

from diagnosis.localise.maps import taken_up
from diagnosis.localise.regions import departure_mask
from diagnosis.settings import SETTINGS

STILL = np.zeros((40, 60))
SD = np.full((40, 60), 0.02)


def test_a_patch_is_marked_to_the_averaging_s_reach() -> None:
    change = STILL.copy()
    change[10:20, 20:40] = 0.02
    mask = departure_mask(change, STILL, SD)
    assert mask[10:20, 20:40].all()
    assert not mask[:8].any()
    assert not mask[22:].any()


def test_alternating_signs_average_out() -> None:
    change = 0.02 * (-1.0) ** np.add.outer(np.arange(40), np.arange(60))
    change[5:15, 5:15] = 0.02
    mask = departure_mask(change, STILL, SD)
    assert mask[7:13, 7:13].all()
    assert not mask[:, 25:].any()


def test_what_is_small_everywhere_is_marked_at_its_peak() -> None:
    change = np.zeros_like(STILL)
    change[:, :20] = 0.5 * SETTINGS.localise.marked_sd * 0.02
    change[:, 20:40] = 0.1 * SETTINGS.localise.marked_sd * 0.02
    mask = departure_mask(change, STILL, SD)
    assert mask[:, :17].all()
    assert not mask[:, 25:].any()


def test_nothing_is_marked_where_nothing_departs_and_lost_returns_are() -> None:
    assert not departure_mask(STILL, STILL, SD).any()
    lost = STILL.copy()
    lost[10:20, 20:40] = 0.5
    mask = departure_mask(np.full_like(STILL, np.nan), lost, SD)
    assert mask[12:18, 22:38].all()
    assert not mask[25:].any()


def test_what_a_placement_takes_up_is_no_mismatch() -> None:
    """A shift of the part on top of a local bump: the shift goes, the bump stays."""
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(4000, 6))
    shift = np.array([1.0, -2.0, 0.5, 0.0, 3.0, 0.1])
    bump = np.where(np.arange(4000) < 300, 8.0, 0.0)
    change = columns @ shift + bump
    change[::50] = np.nan
    assert np.allclose(taken_up(change, columns), shift, atol=0.02)
