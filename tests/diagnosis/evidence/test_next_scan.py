"""Scans that would decide: moved as they say, and proposed where they add evidence."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.assess import assessed_mean
from diagnosis.evidence.next_scan import Scan, next_scans, scans_like
from diagnosis.evidence.seen import seen
from diagnosis.model.model import Model
from diagnosis.prepare import Prepared


def test_a_scan_is_moved_as_it_says() -> None:
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 1, 3] = np.arange(5.0)
    centre = np.array([0.0, 2.0, 100.0])
    turned = Scan(what="", like="", turn_deg=90.0).moved(poses, centre)
    assert turned[0, :3, 1] == pytest.approx([-1.0, 0.0, 0.0])  # travel, now along -x
    middle = turned[2, :3, 3]
    assert middle == pytest.approx([0.0, 2.0, 0.0])  # over the centre still
    away = Scan(what="", like="", range_mm=3.0).moved(poses, centre)
    assert away[:, 2, 3] == pytest.approx(-3.0)
    aside = Scan(what="", like="", shift_mm=2.0).moved(poses, centre)
    assert aside[:, 0, 3] == pytest.approx(2.0)


def test_scans_keep_every_distance_on_the_part_and_one_changes_the_time_alone() -> None:
    rng = np.random.default_rng(5)
    poses = np.tile(np.eye(4), (9, 1, 1))
    poses[:, :3, 3] = rng.normal(0, 10, (9, 3))
    centre, seen_at = rng.normal(0, 10, 3), np.linalg.norm(poses[:, :3, 3], axis=1)
    assert seen_at.min() > 0
    for scan in scans_like("r", 44.0, 60.0):
        moved = scan.moved(poses, centre)
        was, now = (p[:, None, :3, 3] - p[None, :, :3, 3] for p in (poses, moved))
        np.testing.assert_allclose(np.linalg.norm(now, axis=-1), np.linalg.norm(was, axis=-1))
        assert np.allclose(moved, poses) == (scan.slower != 1.0)
        # turned about the part's centre, a part is as far away as it was
        if scan.turn_deg or scan.tilt_deg:
            away = [np.linalg.norm(p[:, :3, 3] - centre, axis=1) for p in (poses, moved)]
            np.testing.assert_allclose(away[1], away[0])


def test_a_turn_tells_the_part_from_the_sensor(bent: Prepared) -> None:
    """One recording can't tell a bow from a bent part; turned by a quarter it can."""
    patches = [replace(p, fit=p.fit | True) for p in bent.patches if p.recording == 0]
    now = seen(patches, bent.noise, Model())
    member = next(m for m in assessed_mean(now, {}).mean)
    rival = "form_error" if member.candidate.effect != "form_error" else "line_bow"
    doubted = replace(member, odds={member.candidate.name: np.log(1.5), rival: 0.0})
    scans = next_scans([doubted], now, bent.recorded, bent.placed, bent.noise)
    assert scans
    odds = {s.scan.what: s.expected_log_odds for s in scans}
    quarter = next(v for k, v in odds.items() if "90°" in k)
    slower = next(v for k, v in odds.items() if "slowly" in k)
    assert quarter > slower
    assert list(odds.values()) == sorted(odds.values(), reverse=True)


def test_a_scan_is_proposed_by_names_and_where_it_adds_evidence(bent: Prepared) -> None:
    patches = [replace(p, fit=p.fit | True) for p in bent.patches if p.recording == 0]
    now = seen(patches, bent.noise, Model())
    member = next(m for m in assessed_mean(now, {}).mean)
    nameless = replace(
        member, candidate=replace(member.candidate, effect=""),
        odds={member.candidate.name: np.log(1.5), "column_offset": 0.0},
    )  # fmt: skip
    scans = next_scans([nameless], now, bent.recorded, bent.placed, bent.noise)
    assert {s.between for s in scans} == {(member.candidate.name, "column_offset")}
    # free values of profiles follow whatever a step does, in any scan
    step = next(c for c in now.candidates if c.name == "step of the offsets")
    free = {step.name: np.log(1.5), "free offsets of profiles": 0.0}
    nested = replace(nameless, candidate=step, odds=free)
    assert not next_scans([nested], now, bent.recorded, bent.placed, bent.noise)
