"""Scans that would decide: the part moves under the sensor as the scan's words have it."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.evidence.next_scan import NextScan, Scan, scans_like
from diagnosis.report.page import render
from diagnosis.report.scan_pictures import outlines_mm, scan_pictures


def offered(*scans: Scan) -> tuple[NextScan, ...]:
    """Return scans as a diagnosis proposes them."""
    between = ("line_bow", "form_error")
    return tuple(NextScan(scan=s, between=between, expected_log_odds=4e4) for s in scans)


def test_the_part_moves_as_the_words_have_it(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    before, after = outlines_mm(result, Scan(what="farther", like="left", range_mm=1.5))
    farther = np.broadcast_to([0.0, 0.0, 1.5], before.shape)
    np.testing.assert_allclose(after - before, farther, atol=1e-9)
    before, after = outlines_mm(result, Scan(what="aside", like="left", shift_mm=4.0))
    np.testing.assert_allclose(np.abs(after - before)[:, 0], 4.0, atol=1e-9)
    before, after = outlines_mm(result, Scan(what="half a turn", like="left", turn_deg=180.0))
    np.testing.assert_allclose(after[:, :2], -before[:, :2], atol=1e-6)
    before, after = outlines_mm(result, Scan(what="tilted", like="left", tilt_deg=8.0))
    np.testing.assert_allclose(after[:, 0], before[:, 0], atol=1e-9)
    assert np.ptp(after[:, 2]) != pytest.approx(np.ptp(before[:, 2]), abs=0.1)


def test_scans_that_move_something_are_drawn(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    scans = scans_like("left", 40.0, 12.0)
    slow = [s for s in scans if s.slower != 1.0]
    assert scan_pictures(dataclasses.replace(result, next_measurements=offered(*slow))) is None
    undecided = dataclasses.replace(result, next_measurements=offered(*scans))
    picture = scan_pictures(undecided)
    assert picture is not None
    assert picture.startswith(b"\x89PNG")
    page = render(undecided, part_name="bowl")
    assert "over 100" in page
    assert "line bow from form error" in page
    assert "the part under the sensor" in page
