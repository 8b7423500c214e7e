"""What competes to be chosen, and what a departure within its tolerance must gain."""

from typing import Any

import numpy as np
import pytest

from diagnosis import select, trials, workspace
from diagnosis.families import Family, effect_families, free_families
from diagnosis.finding import SUSPECT, Finding, Screening
from diagnosis.fit import LEAST_CYCLES, _grid
from diagnosis.linear import Fitted
from diagnosis.patch import FEWEST_ROWS
from diagnosis.select import _of_kin
from diagnosis.trials import fold_masks
from diagnosis.workspace import Model, Workspace
from sensors.effects import CATALOGUE
from tests.support.effect_case import bench_workspace


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("steps")


def finding(channel: str, size: float, family: Any = None, z: float = 20.0) -> Finding:
    return Finding(
        channel=channel, name=f"{channel} {size}", words="", frame="sensor", z=z, size=size,
        tolerance=1.0, gain=1.0, coefficients=np.zeros(1), family=family,
    )  # fmt: skip


def best_for(ws: Workspace, findings: list[Finding]) -> tuple[Model, select.Choice] | None:
    asked = trials.Trials(ws=ws, model=Model())
    return select._best(asked, findings, np.random.default_rng(0), withheld=set())


def test_few_readings_are_whole_profiles_within_the_budget(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    budget = FEWEST_ROWS * sum(p.shape[1] for p in ws.patches)
    assert ws.thin(budget) is ws  # strips of no more readings than are looked at as a whole
    monkeypatch.setattr(workspace, "WHOLE", 0)
    few = ws.thin(budget)
    assert 0 < sum(p.depth_mm.size for p in few.patches) <= budget
    assert {p.shape[1] for p in few.patches} == {p.shape[1] for p in ws.patches}


def test_suspect_is_what_a_coarse_law_may_hide(ws: Workspace) -> None:
    model = Model()
    families = [
        *free_families(ws.patches),
        *effect_families(ws.patches, ws.predict(model), ws.noise),
    ]
    at_edge = next(f for f in families if f.at_edges)
    smooth = next(f for f in families if not f.at_edges)
    hidden = [finding("variance", 0.8), finding("mean", 0.8, at_edge)]
    passed = [
        finding("variance", 0.9 * SUSPECT),
        finding("variance", 0.8, z=3.0),
        finding("mean", 0.8, smooth),
    ]
    screening = Screening(findings=(*hidden, *passed), threshold=5.0)
    assert screening.suspect() == hidden
    assert screening.significant() == []


@pytest.mark.parametrize(("share", "chosen"), [(0.5, ()), (2.0, ("line_bow",))])
def test_a_suspect_must_gain_much(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch, share: float, chosen: tuple[str, ...]
) -> None:
    screenings = [Screening(findings=(finding("variance", 0.8),), threshold=5.0)]
    nothing = Screening(findings=(), threshold=5.0)
    bow = CATALOGUE["line_bow"].example()

    def best(asked: trials.Trials, *rest: object) -> tuple[Model, select.Choice]:
        gain = share * select.SUSPECT_GAIN * asked.ws.count()
        blocks = np.full(10, gain / 10)
        choice = select.Choice(name="line_bow", gain=gain, blocks=blocks, alternatives=())
        return asked.model.with_effect(bow), choice

    monkeypatch.setattr(
        select, "screen", lambda *rest: screenings.pop() if screenings else nothing
    )
    monkeypatch.setattr(select, "_best", best)
    selection = select.select(ws, np.random.default_rng(0))
    assert tuple(c.name for c in selection.choices) == chosen


def test_what_is_not_sure_blocks_no_other(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    one_block, every_block = np.full(60, -1.0), np.full(60, 1.0)
    one_block[7] = 300.0
    gains = {"line_bow": one_block, "range_scale": every_block}

    def fit(kind: Any, *rest: object, **more: object) -> Fitted | None:
        if kind.name not in gains:
            return None
        return Fitted(effect=kind.example(), own={}, gain=gains[kind.name].sum(), free=1)

    monkeypatch.setattr(trials, "fit_effect", fit)
    monkeypatch.setattr(trials, "crossfitted", lambda ws, model, kind, *rest: gains[kind.name])
    step = best_for(ws, [finding("mean", 2.0)])
    assert step is not None
    assert step[1].name == "range_scale"
    assert step[1].alternatives == ()


def test_an_effect_is_fitted_once_whatever_is_left_asks_for_it(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[str] = []
    monkeypatch.setattr(trials, "fit_effect", lambda kind, *args, **more: tried.append(kind.name))
    asked = trials.Trials(ws=ws, model=Model())
    for _ in range(2):
        select._best(asked, [finding("mean", 2.0)], np.random.default_rng(0), withheld=set())
    assert tried
    assert len(tried) == len(set(tried))


@pytest.mark.parametrize(
    ("name", "parameter", "axis", "turns"),
    [
        ("stage_vibration", "frequency_hz", "time_s", 1),
        ("travel_ripple", "period_mm", "travel_mm", -1),
    ],
)
def test_a_wave_has_some_cycles_in_a_scan(
    ws: Workspace, name: str, parameter: str, axis: str, turns: int
) -> None:
    """What slips once or twice is no vibration, however well a slow sine follows it."""
    points = _grid(CATALOGUE[name], ws, ws.states(ws.predict(Model())))
    longest = max(float(np.ptp(getattr(p.view, axis))) for p in ws.patches)
    assert points
    for point in points:
        assert getattr(point, parameter) ** turns * longest >= LEAST_CYCLES


@pytest.mark.parametrize(("behind", "chosen"), [(0.5, "line_bow"), (1.5, "range_scale")])
def test_fewer_numbers_win_where_more_gain_next_to_nothing(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch, behind: float, chosen: str
) -> None:
    worth = select.LEAST_GAIN * ws.count()
    most = np.full(60, 200 * worth / 60)
    gains = {"range_scale": most, "line_bow": most - behind * worth / 60}
    numbers = {"range_scale": 4, "line_bow": 1}

    def fit(kind: Any, *rest: object, **more: object) -> Fitted | None:
        if kind.name not in gains:
            return None
        free, gain = numbers[kind.name], gains[kind.name].sum()
        return Fitted(effect=kind.example(), own={}, gain=gain, free=free)

    monkeypatch.setattr(trials, "fit_effect", fit)
    monkeypatch.setattr(trials, "crossfitted", lambda ws, model, kind, *rest: gains[kind.name])
    step = best_for(ws, [finding("mean", 2.0)])
    assert step is not None
    assert step[1].name == chosen


@pytest.mark.parametrize(("name", "whole"), [("form_error", False), ("line_bow", True)])
def test_form_is_judged_where_it_was_seen(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch, name: str, whole: bool
) -> None:
    """A recording that looks elsewhere can't speak of the form here; the sensor's is the same."""
    asked: list[bool] = []

    def halves(ws: Workspace, *, whole: bool) -> Any:
        asked.append(whole)
        return fold_masks(ws, whole=whole)

    monkeypatch.setattr(trials, "fold_masks", halves)
    kind = CATALOGUE[name]
    fitted = Fitted(effect=kind.example(), own={}, gain=1.0, free=1)
    base = ws.log_densities(Model())
    assert trials.crossfitted(ws, Model(), kind, fitted, base).size > 1
    assert asked == [whole]


def test_what_shows_for_one_of_a_kin_is_looked_for_in_all() -> None:
    assert "variance" in _of_kin("finite_spot")  # a blur's
    assert _of_kin("range_scale") == {"mean"}


@pytest.mark.parametrize("name", ["reflectance_edge", "line_bow"])
def test_a_gloss_is_tried_where_a_mean_like_a_print_s_was_found(
    ws: Workspace, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    tried = []
    monkeypatch.setattr(trials, "fit_effect", lambda kind, *args, **more: tried.append(kind.name))
    family = Family(
        name=f"effect:{name}", words="", frame="sensor", fields=(), effect=CATALOGUE[name]()
    )
    found = [finding("mean", 2.0, family)]
    assert best_for(ws, found) is None
    assert name in tried
    assert ("specular_dropout" in tried) == (name == "reflectance_edge")
