"""Forms of a cause: bands hold their frequency, steps their place, and all are of one size."""

from collections.abc import Sequence

import numpy as np
import pytest

from diagnosis.components.component import Component, components_of
from diagnosis.components.smooth import products
from diagnosis.evidence.block_diagonal import BlockDiagonal
from diagnosis.evidence.candidates import Candidate, candidates_of
from diagnosis.evidence.gram import Block, Gram
from diagnosis.evidence.posterior import Cavity, Weights
from diagnosis.settings import SETTINGS
from sensors.effects.line_bow import LineBow
from sensors.effects.relaxed import Relaxed

MEAN = {c.name: c for c in components_of("mean")}
PROFILES, POINTS = 60, 100
TIMES = np.arange(PROFILES) / 200.0


def of(
    component: Component,
    matrix: np.ndarray,
    listed: tuple = (),
    laws: Sequence[np.ndarray] = (),
) -> dict[str, Candidate]:
    """Candidates of one component whose columns have these products, each of `POINTS` readings."""
    blocks = (Block(component=component, recording=0, columns=slice(0, len(matrix))),)
    gram = Gram(blocks=blocks, matrix=matrix, right=np.zeros(len(matrix)),
                readings=PROFILES * POINTS)  # fmt: skip
    return {c.name: c for c in candidates_of(gram, {0: TIMES}, {0: 80.0 * TIMES}, listed,
                                             {component.name: laws})}  # fmt: skip


@pytest.fixture(scope="module")
def offsets() -> dict[str, Candidate]:
    """Offsets of profiles, each of which has the same number of white readings."""
    return of(MEAN["stage_vibration"], POINTS * np.eye(PROFILES))


def dense(shape: Weights | None) -> np.ndarray:
    assert shape is not None
    return shape.dense() if isinstance(shape, BlockDiagonal) else shape


def missed(shape: np.ndarray, values: np.ndarray) -> float:
    """Share of the values' power that no combination of a form's columns draws."""
    left = values - shape @ np.linalg.lstsq(shape, values, rcond=None)[0]
    return float(left @ left / (values @ values))


def test_a_band_draws_its_own_frequency_and_no_other(offsets: dict[str, Candidate]) -> None:
    bands = offsets["stage_vibration"]
    count = len(bands.shapes) - bands.by_law
    assert min(bands.labels) == pytest.approx(SETTINGS.least_cycles / np.ptp(TIMES))
    for shape, frequency in zip(bands.shapes[:count:7], bands.labels[:count:7], strict=True):
        wave = np.sin(2 * np.pi * frequency * TIMES + 0.7)
        assert missed(dense(shape), wave) < 1e-9
        assert missed(dense(shape), (1 + TIMES) * wave) < 1e-9  # that grows slowly, too
    slowest = bands.shapes[0]
    assert missed(dense(slowest), np.sin(2 * np.pi * 7.3 * bands.labels[0] * TIMES)) > 0.9


def test_the_law_of_a_wave_is_steady(offsets: dict[str, Candidate]) -> None:
    bands = offsets["stage_vibration"]
    count = len(bands.shapes) - bands.by_law
    assert bands.by_law == count
    assert bands.labels[:count] == bands.labels[count:]
    for shape, frequency in zip(bands.shapes[count::7], bands.labels[count::7], strict=True):
        wave = np.sin(2 * np.pi * frequency * TIMES + 0.7)
        assert missed(dense(shape), wave) < 1e-9
        assert missed(dense(shape), np.linspace(-1, 1, PROFILES) * wave) > 0.9


def test_a_steady_wave_is_found_by_its_law_where_freer_forms_pay_too_much(
    offsets: dict[str, Candidate],
) -> None:
    """Six deviations: 18 nats, of which the envelopes and harmonics of a band take more."""
    bands = offsets["stage_vibration"]
    count, wave = len(bands.shapes) - bands.by_law, np.sin(2 * np.pi * bands.labels[7] * TIMES)
    wave *= 6.0 / np.sqrt(POINTS * np.square(wave).sum())
    cavity = Cavity(information=POINTS * np.eye(PROFILES), pull=POINTS * wave)
    each, mean = bands.log_factors(cavity, SETTINGS.mean_sizes())
    free, steady = each[:count].max(), each[count:].max()
    assert int(each[count:].max(axis=1).argmax()) == 7
    assert steady > free + 2
    assert mean.max() == pytest.approx(steady - np.log(2 * count), abs=1.0)


@pytest.mark.parametrize(("parameter", "speed"), [("frequency", 1.0), ("period", 80.0)])
def test_a_frequency_is_of_the_time_and_a_period_of_the_travel(
    parameter: str, speed: float
) -> None:
    form = Relaxed(
        channel="mean", each="profile", periodic=True, times="x", **{parameter: "any_name"}
    )
    waves = of(Component(name="roll", effect="roll", relaxed=form), POINTS * np.eye(PROFILES))
    slowest = SETTINGS.least_cycles / np.ptp(speed * TIMES)
    assert min(waves["roll"].labels) == pytest.approx(slowest)


def test_all_forms_have_a_whitened_rms_of_one(offsets: dict[str, Candidate]) -> None:
    for candidate in (offsets["stage_vibration"], offsets["step of the offsets"]):
        for shape in candidate.shapes:
            energy = POINTS * np.square(dense(shape)).sum()
            assert energy == pytest.approx(PROFILES * POINTS), candidate.name


def test_a_step_is_nothing_before_its_place_and_one_height_after(
    offsets: dict[str, Candidate],
) -> None:
    steps = offsets["step of the offsets"]
    assert steps.effect == ""
    for form, place in zip(steps.shapes, steps.labels, strict=True):
        shape, k = dense(form), int(place)
        assert not shape[:k].any()
        assert np.ptp(shape[k:]) == pytest.approx(0.0)
        assert shape[k, 0] > 0


def test_free_values_of_profiles_have_no_cause(offsets: dict[str, Candidate]) -> None:
    free = offsets["free offsets of profiles"]
    assert (free.effect, free.component.effect) == ("", "")
    assert free.of_recordings
    each, walk = free.shapes
    assert each is None
    # from where the profile before was: a jump is one number, and all later profiles have it
    assert np.count_nonzero(dense(walk)[:, 20]) == PROFILES - 20
    assert POINTS * np.square(dense(walk)).sum() == pytest.approx(PROFILES * POINTS)


def test_a_slower_form_has_smaller_short_waves() -> None:
    bow = MEAN["line_bow"]
    found = of(bow, PROFILES * POINTS * np.eye(3) / 3)["line_bow"]
    _, slow = found.shapes
    falls = np.diag(dense(slow))
    assert (np.diff(falls) < 0).all()
    # even orders 2, 4, 6
    assert falls[1] / falls[0] == pytest.approx((5.0 / 3.0) ** -SETTINGS.further_decay)


def test_what_the_sensors_file_lists_is_held_against_good_ones_of_that_law() -> None:
    matrix = PROFILES * POINTS * np.eye(3) / 3
    assert of(MEAN["line_bow"], matrix)["line_bow"].key == "line_bow"
    listed = of(MEAN["line_bow"], matrix, (LineBow(sag_um=5.0),))["line_bow"]
    assert listed.key == "line_bow (listed)"
    assert listed.unclaimed().effect == ""


def test_forms_that_show_nothing_are_paid_for() -> None:
    """The evidence of a choice among forms is their mean: one of n that fits loses ln n."""
    turned = tuple(np.eye(6)[:, [k]] for k in range(6))
    one = Candidate(name="a", effect="", component=MEAN["line_bow"], at=np.arange(6),
                    shapes=turned, labels=(0.0,) * 6)  # fmt: skip
    pull = np.zeros(6)
    pull[2] = 200.0
    cavity = Cavity(information=400.0 * np.eye(6), pull=pull)
    sizes = np.array([0.5])
    each, mean = one.log_factors(cavity, sizes)
    assert int(each[:, 0].argmax()) == 2
    assert mean[0] == pytest.approx(each[2, 0] - np.log(6), abs=1e-6)
    # one coefficient of information i and pull g: ln BF = (g² s² / (1 + i s²) - ln(1 + i s²)) / 2
    more = 1 + 400.0 * 0.5**2
    assert each[2, 0] == pytest.approx((200.0**2 * 0.5**2 / more - np.log(more)) / 2)


@pytest.mark.parametrize("name", ["form_error", "lens_distortion"])
def test_without_a_law_a_surface_is_free_or_slower(name: str) -> None:
    """No frame knows sides by itself: about which a part bends is its law's (`law_forms`)."""
    surface = of(MEAN[name], POINTS * np.eye(len(products(2))))[name]
    assert surface.shapes[0] is None
    assert len(surface.shapes) == 2


SCALE = MEAN["range_scale"]
SIZE = len(products(1))
STRAIGHT = np.eye(SIZE)[:, :1]
"""A law that is the first of the component's columns."""


def test_a_law_is_as_probable_as_all_freer_forms_together() -> None:
    free, known = (of(SCALE, POINTS * np.eye(SIZE), laws=laws)["range_scale"]
                   for laws in ((), (STRAIGHT, STRAIGHT)))  # fmt: skip
    assert len(known.shapes) == len(free.shapes) + 2
    shares = np.exp(known.log_shares)
    assert shares.sum() == pytest.approx(1.0)
    assert shares[-2:].sum() == pytest.approx(SETTINGS.by_law)
    assert np.exp(free.log_shares) == pytest.approx(1 / len(free.shapes))


def test_what_the_law_explains_speaks_for_it_more_than_a_free_curve_does() -> None:
    candidate = of(SCALE, POINTS * np.eye(SIZE), laws=[STRAIGHT])["range_scale"]
    straight, bent = (
        Cavity(information=1e4 * np.eye(SIZE), pull=1e4 * 0.1 * np.eye(SIZE)[k]) for k in (0, -1)
    )
    by_law, by_another = (
        np.max(candidate.log_factors(c, SETTINGS.mean_sizes())[0], axis=1) for c in (straight, bent)
    )
    assert by_law[-1] > by_law[0]
    assert by_another[-1] < 1 < by_another[0]


def test_a_law_that_the_placement_imitates_is_no_form() -> None:
    alike = np.full((SIZE, SIZE), 1.0 - 1e-5) + 1e-5 * np.eye(SIZE)
    between = np.zeros((SIZE, 1))
    between[:2, 0] = 1.0, -1.0  # next to nothing is left of it
    candidate = of(SCALE, POINTS * alike, laws=[between])["range_scale"]
    assert dense(candidate.shapes[-1]) == pytest.approx(0.0)
    own = of(SCALE, POINTS * alike, laws=[np.abs(between)])["range_scale"].shapes[-1]
    assert dense(own).max() > 0
