"""From recordings to causes: equations against dense algebra, baselines, scans that decide."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.component import components_of, count_of, mean_columns, ranges_of
from diagnosis.discrepancy.good_instrument import informed, kinds_of, mean_factors
from diagnosis.discrepancy.population import population
from diagnosis.evidence.assess import assessed_mean
from diagnosis.evidence.gram import grams_of, turned, weights_of
from diagnosis.evidence.next_scan import Scan, next_scans
from diagnosis.evidence.seen import seen
from diagnosis.model.workspace import Model, Workspace
from diagnosis.prepare import Inputs, Prepared, prepared
from tests.support.small_parts import VIEWS, datasheet, part, record

BOW = [{"name": "line_bow", "sag_um": 4.0}]


def ready(effects: list[dict[str, object]], seed: int, baselines: bool = False) -> Prepared:
    scene, sheet = part("domes"), datasheet(100)

    def scans(what: list[dict[str, object]], first: int) -> list:
        return [
            record(scene, sheet, what, name=f"r{first + k}", seed=first + k, profiles=72,
                   pitch_mm=0.6, **view)
            for k, view in enumerate(VIEWS)
        ]  # fmt: skip

    return prepared(
        Inputs(
            recordings=scans(effects, 10 * seed), vertices_mm=scene.vertices_mm,
            faces=scene.faces, datasheet=sheet,
            baselines=scans([], 10 * seed + 5) if baselines else (),
        ),
        [], lambda _: None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def bowed() -> Prepared:
    return ready(BOW, 3, baselines=True)


def test_normal_equations_are_those_of_whitened_readings(bowed: Prepared) -> None:
    ws = Workspace.build([p for p in bowed.patches if p.fit.any()][:1], bowed.noise)
    states = ws.states(ws.predict(Model()))
    names = ("line_bow", "column_offset", "stage_vibration")
    components = [c for c in components_of("mean") if c.effect in names]
    ranges = ranges_of(ws.patches, ("x",))
    _, whole = grams_of(components, ws.patches, states, ranges, bowed.noise)
    patch, state = ws.patches[0], states[0]
    n, m = patch.shape
    fields = []
    for b in whole.blocks:
        if b.component.relaxed.each == "column":
            fields += [np.where(np.arange(m)[None] == j, state.sd_mm, 0.0) for j in range(m)]
        elif b.component.relaxed.each == "profile":
            fields += [np.where(np.arange(n)[:, None] == i, state.sd_mm, 0.0) for i in range(n)]
        else:
            fields += mean_columns(b.component, patch, ranges) or []
    w = weights_of(patch, state)[state.used]
    x = np.stack([state.whiten(np.broadcast_to(f, (n, m)))[state.used] * w for f in fields], 1)
    lies, travels = np.split(state.columns[state.used], [6], axis=1)
    y = (state.innovations[state.used] + travels @ (patch.shift + state.moved)[6:]) * w
    pose = lies * w[:, None]
    kept = np.eye(len(y)) - pose @ np.linalg.solve(np.eye(6) + pose.T @ pose, pose.T)
    assert whole.matrix == pytest.approx(x.T @ kept @ x, abs=1e-6 * np.abs(whole.matrix).max())
    assert whole.right == pytest.approx(x.T @ kept @ y, abs=1e-6 * np.abs(whole.right).max())


def test_columns_are_counted_without_being_made(bowed: Prepared) -> None:
    patch = bowed.patches[0]
    names = ("x", "depth", "travel", "slope_y", "incidence", "clock", "part_x", "part_y")
    ranges = ranges_of([patch], names)
    for c in components_of("mean"):
        if not c.relaxed.each:
            made = mean_columns(c, patch, ranges, bowed.noise)
            assert count_of(c, patch, ranges, bowed.noise) == len(made or ()), c.name


def test_combined_equations_are_those_of_combined_columns(bowed: Prepared) -> None:
    rng = np.random.default_rng(2)
    now = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model())
    turns: dict[str, np.ndarray] = {}
    for b in now.bulk.blocks[:4]:
        turns[b.component.name] = np.full(1, 2.0) if len(turns) % 2 else rng.normal(
            size=(b.columns.stop - b.columns.start, 2)
        )
    parts = [
        (b.columns, turns[b.component.name])
        for b in now.bulk.blocks if b.component.name in turns
    ]  # fmt: skip
    whole = np.zeros((len(now.bulk.right), 0))
    for which, turn in parts:
        wide = np.zeros((len(whole), which.stop - which.start))
        wide[which] = np.eye(which.stop - which.start)
        whole = np.hstack([whole, wide * turn[0] if turn.ndim == 1 else wide @ turn])
    found = turned(now.bulk, turns)
    assert found.matrix == pytest.approx(whole.T @ now.bulk.matrix @ whole)
    assert found.right == pytest.approx(whole.T @ now.bulk.right)


@pytest.mark.slow
def test_baselines_show_what_a_population_hides(bowed: Prepared) -> None:
    """A bow of a fifth of the noise: usual among instruments, but new on this one."""
    fitted = [p for p in bowed.patches if p.fit.any()]
    now = seen(fitted, bowed.noise, Model())
    usual = population()
    kinds = kinds_of(usual, mean_factors(now), good=False)
    alone = assessed_mean(now, usual.of_kinds(kinds))
    before = seen(bowed.baseline, bowed.noise, Model(), like=now)
    known = assessed_mean(now, informed(usual, mean_factors(before), {}), before)
    assert [m.candidate.effect for m in known.mean] == ["line_bow"]
    assert known.mean[0].nats > max((m.nats for m in alone.mean), default=0.0)
    # the same recordings as their own baseline: nothing has changed
    same = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model(), like=now)
    still = assessed_mean(now, informed(usual, mean_factors(same), {}), same)
    assert not [m for m in still.mean if not m.candidate.at_edges]


def test_probabilities_of_a_place_add_up(bowed: Prepared) -> None:
    now = seen([p for p in bowed.patches if p.fit.any()], bowed.noise, Model())
    for member in assessed_mean(now, {}).mean:
        assert sum(member.shares.values()) == pytest.approx(1.0)
        assert "" in member.shares


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


def test_a_turn_tells_the_part_from_the_sensor() -> None:
    """One recording can't tell a bow from a bent part; turned by a quarter it can."""
    one = ready([{"name": "line_bow", "sag_um": 40.0}], 7)
    patches = [replace(p, fit=p.fit | True) for p in one.patches if p.recording == 0]
    now = seen(patches, one.noise, Model())
    member = next(m for m in assessed_mean(now, {}).mean)
    rival = "form_error" if member.candidate.effect != "form_error" else "line_bow"
    doubted = replace(member, shares={member.candidate.name: 0.6, rival: 0.4})
    scans = next_scans([doubted], now, one.recorded, one.placed, one.noise)
    assert scans
    odds = {s.scan.what: s.expected_log_odds for s in scans}
    quarter = next(v for k, v in odds.items() if "90°" in k)
    slower = next(v for k, v in odds.items() if "slowly" in k)
    assert quarter > slower
    assert list(odds.values()) == sorted(odds.values(), reverse=True)


def test_a_scan_is_proposed_by_names_and_where_it_adds_evidence() -> None:
    one = ready([{"name": "line_bow", "sag_um": 40.0}], 7)
    patches = [replace(p, fit=p.fit | True) for p in one.patches if p.recording == 0]
    now = seen(patches, one.noise, Model())
    member = next(m for m in assessed_mean(now, {}).mean)
    nameless = replace(
        member, candidate=replace(member.candidate, effect=""),
        shares={member.candidate.name: 0.6, "column_offset": 0.4},
    )  # fmt: skip
    scans = next_scans([nameless], now, one.recorded, one.placed, one.noise)
    assert {s.between for s in scans} == {(member.candidate.name, "column_offset")}
    # free values of profiles follow whatever a step does, in any scan
    step = next(c for c in now.candidates if c.name == "step of the offsets")
    free = {step.name: 0.6, "free offsets of profiles": 0.4}
    nested = replace(nameless, candidate=step, shares=free)
    assert not next_scans([nested], now, one.recorded, one.placed, one.noise)
