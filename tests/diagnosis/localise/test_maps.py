"""Maps: of the size of the recordings, marked where they depart, whole where asked to be."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.localise.maps import measured_at


def test_the_maps_differ_by_the_effect_found(diagnosed: tuple[Diagnosis, Path]) -> None:
    for maps in diagnosed[0].maps:
        before, after = (
            float(np.nanstd(maps.depth_mm - m)) for m in (maps.simulated, maps.explained)
        )
        assert after == pytest.approx(diagnosed[0].noise.sd_mm, rel=0.15)
        assert before > 1.2 * after


def test_what_is_marked_departs_and_was_read(diagnosed: tuple[Diagnosis, Path]) -> None:
    for maps in diagnosed[0].maps:
        read = np.isfinite(maps.depth_mm)
        assert maps.mask.shape == maps.depth_mm.shape == maps.score.shape
        rest = np.abs(maps.depth_mm - maps.simulated)
        both = read & np.isfinite(rest)
        assert np.median(rest[both & maps.mask]) > np.median(rest[both & ~maps.mask])
        for region in maps.regions:
            assert 0 <= region.profiles[0] < region.profiles[1] <= maps.mask.shape[0]
            assert 0 <= region.points[0] < region.points[1] <= maps.mask.shape[1]
            assert maps.mask[slice(*region.profiles), slice(*region.points)].any()


def test_a_whole_recording_is_marked_and_silenced(diagnosed: tuple[Diagnosis, Path]) -> None:
    maps = diagnosed[0].maps[0]
    everywhere = maps.everywhere("pose_error")
    assert (everywhere.mask == np.isfinite(maps.depth_mm)).all()
    (region,) = everywhere.regions
    assert region.effect == "pose_error"
    silent = everywhere.silenced()
    assert not silent.mask.any()
    assert silent.regions == ()


def test_a_profile_that_repeats_others_was_measured_where_they_were() -> None:
    repeated = np.array([False, True, True, False, True])
    assert list(measured_at(repeated)) == [0, 0, 0, 3, 3]
