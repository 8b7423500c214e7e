"""The bench's signal to noise against dense calculations, limits and drawn likelihood ratios."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from benchmarks.other_formulas.cases import Case, nominal_shot, stage
from benchmarks.other_formulas.formulas import BY_NAME
from benchmarks.other_formulas.formulas.sensor import mounted
from benchmarks.other_formulas.instrument import MISPLACED_MM, MISPLACED_RAD
from benchmarks.other_formulas.speckle import Covariance, Noise, field, speckle_kernel
from benchmarks.other_formulas.strength import Hidden, mounting_signal, signal_to_noise


def staged(part="freeform", formulas=(), wanted=0):
    return stage(
        Case(
            name="t", kind="one", formulas=formulas, wanted=wanted, part=part, baselines=False,
            plate=False, seed=11,
        )
    )  # fmt: skip


@pytest.fixture(scope="module")
def smooth():
    made = staged()
    shot = nominal_shot(made, made.scans[0], 0)
    return shot, Hidden(shot)


def dense(noise, shape):
    """Covariance of all readings of a small grid, from the kernel's own definition."""
    n, m = shape
    a, b = noise.kernel.shape
    rows = []
    for i in range(n):
        for j in range(m):
            wide = np.zeros((n + a - 1, m + b - 1))
            wide[i : i + a, j : j + b] = noise.kernel
            rows.append(wide.ravel())
    rows = np.array(rows)
    return noise.share * rows @ rows.T + (1 - noise.share) * np.eye(n * m)


def test_covariance_is_the_dense_one_gaps_included():
    rng = np.random.default_rng(1)
    noise = Noise(kernel=speckle_kernel(0.9, 0.3), share=0.85)
    use = rng.random((9, 11)) < 0.8
    full = dense(noise, use.shape)[np.ix_(use.ravel(), use.ravel())]
    v = rng.normal(size=use.sum())
    fast = Covariance(noise, use)
    np.testing.assert_allclose(fast.times(v), full @ v, atol=1e-12)
    np.testing.assert_allclose(fast.solve(v, 1e-10), cho_solve(cho_factor(full), v), rtol=1e-6)


def test_drawn_fields_have_the_covariance_that_is_claimed():
    rng = np.random.default_rng(2)
    noise = Noise(kernel=speckle_kernel(0.8, 0.3), share=0.85)
    drawn = np.stack([noise.draw((4, 5), rng) for _ in range(20000)]).reshape(20000, -1)
    np.testing.assert_allclose(drawn.T @ drawn / 20000, dense(noise, (4, 5)), atol=0.04)


def test_neighbouring_profiles_are_correlated_negatively():
    lags = Noise(kernel=speckle_kernel(0.9, 0.3), share=1.0).autocorrelation
    middle = lags.shape[0] // 2
    assert lags[middle, middle] == pytest.approx(1.0)
    assert lags[middle + 1, middle] < -0.2


def test_a_rigid_movement_has_no_signal(smooth):
    """Nor has a tilt along the travel, be it of the part or by a drift that is linear in time."""
    shot, hidden = smooth
    moved = replace(shot, mean=shot.mean + hidden.moved(1e-3 * np.array([1, -1, 1, 20, -30, 10])))
    drift = np.linspace(-0.01, 0.01, len(shot.mean))[:, None]
    drifted = shot.plus(np.broadcast_to(drift, shot.view.shape))
    assert signal_to_noise([hidden], [drifted]) < 0.05 * signal_to_noise_of_all(hidden, drifted)
    raw = np.abs((moved.mean - shot.mean)[hidden.use] / hidden.sd)
    assert raw.max() > 0.5
    assert signal_to_noise([hidden], [moved]) < 0.02 * np.sqrt((raw**2).sum())


def signal_to_noise_of_all(hidden, shot):
    """With no pose projected out."""
    s = hidden.capped(shot.mean - hidden.nominal.mean)
    return np.sqrt(s @ hidden.covariance.solve(s))


@pytest.mark.parametrize("part", ["hills", "terraces"])
def test_a_mounting_is_as_far_off_as_parts_lie_off_by_chance(part):
    made = staged(part)
    shots = [nominal_shot(made, scan, k) for k, scan in enumerate(made.scans[:2])]
    hidden = [Hidden(shot) for shot in shots]

    def signal(number, times):
        rigid = np.zeros(6)
        rigid[number] = times * (MISPLACED_RAD if number < 3 else MISPLACED_MM)
        wrong = np.eye(4)
        wrong[:3, :3] = Rotation.from_rotvec(rigid[:3]).as_matrix()
        wrong[:3, 3] = hidden[0].middle - wrong[:3, :3] @ hidden[0].middle + rigid[3:]
        return mounting_signal(hidden, [mounted(shot, wrong) for shot in shots])

    for number in range(6):
        small, large = signal(number, 0.1), signal(number, 3.0)
        assert large == pytest.approx(30 * small, rel=1e-3)
        # the distance is settled by thousands of readings; a turn of the laser's plane about the
        # line in it leaves a level surface as it is
        wanted = pytest.approx(0.1 * np.sqrt(2), rel=0.02)
        assert small == wanted if number == 5 else small < 0.1 * np.sqrt(2)
    assert mounting_signal(hidden, shots) == 0.0


def test_signal_is_linear_in_the_size_of_an_additive_change(smooth):
    shot, hidden = smooth
    bow = BY_NAME["arc"]
    one, three = (signal_to_noise([hidden], [bow.apply(shot, s, 3)]) for s in (0.1, 0.3))
    assert three == pytest.approx(3 * one, rel=1e-3)


def test_mean_signal_is_the_dense_generalised_least_squares():
    made = staged("freeform")
    shot = nominal_shot(made, made.scans[0], 0)
    hidden = Hidden(shot)
    window = np.zeros(hidden.use.shape, bool)
    window[40:58, 60:90] = True  # small enough for a matrix
    keep = (window & hidden.use)[hidden.use]
    hidden.use = window & hidden.use
    hidden.covariance = Covariance(shot.noise, hidden.use)
    hidden.columns = hidden.columns[:, keep]
    hidden.solved = np.stack([hidden.covariance.solve(c, 1e-8) for c in hidden.columns])
    hidden.gram = hidden.columns @ hidden.solved.T
    s = hidden.capped(BY_NAME["sawtooth rows"].apply(shot, 0.5, 3).mean - shot.mean)
    whole = np.zeros(window.sum(), bool)
    whole[:] = hidden.use[window]
    full = dense(shot.noise, (18, 30))[np.ix_(whole, whole)]
    lower = np.linalg.cholesky(full)
    white, columns = np.linalg.solve(lower, s), np.linalg.solve(lower, hidden.columns.T)
    scale = np.linalg.norm(columns, axis=0)
    rest = white - columns / scale @ np.linalg.lstsq(columns / scale, white, rcond=None)[0]
    assert hidden.whitened_square(s) == pytest.approx(rest @ rest, rel=2e-3)


def test_louder_noise_has_the_divergence_of_gaussians(smooth):
    shot, hidden = smooth
    twice = replace(shot, scale=1.2)
    count = hidden.use.sum()
    wanted = count * (0.5 * (1.44 - 1) - np.log(1.2))
    assert hidden.nats(twice) == pytest.approx(wanted, rel=1e-9)


def test_losses_in_clumps_count_as_clumps(smooth):
    shot, hidden = smooth
    clumped = BY_NAME["round clumps"].apply(shot, 0.9, 3)
    apart = replace(shot, p_missing=clumped.p_missing)
    assert hidden.nats(clumped) < hidden.nats(apart) / 10


def test_clumped_losses_have_the_share_that_is_claimed():
    made = staged("hills")
    shot = BY_NAME["round clumps"].apply(nominal_shot(made, made.scans[0], 0), 5.0, 3)
    drawn = field(shot.clump, (400, 400), np.random.default_rng(0))
    assert drawn.std() == pytest.approx(1, abs=0.05)
    seen = np.isfinite(shot.mean)
    lost = np.isnan(shot.sample(np.random.default_rng(4)))[seen].mean()
    assert lost == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("name", ["stick-slip", "GGX lobe", "uniform outliers", "disc footprint"])
def test_a_case_reaches_its_signal_to_noise(name):
    part = (BY_NAME[name].parts or ("hills",))[0]
    assert staged(part, (name,), 12).reached == pytest.approx(12, rel=0.1)
