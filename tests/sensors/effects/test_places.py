"""The law of a scan's profiles is the same whether they are looked at alone or in the scan."""

import numpy as np
import pytest

from sensors.effects import CATALOGUE, Effect, MotionEffect
from sensors.effects.pose_error import PoseError
from sensors.law import Law, geometric_law
from sensors.noise.perlin import PerlinField
from sensors.surface.reflectance import ReflectanceMap, Stripes
from sensors.view.view import View

SURFACE = PerlinField(amplitude_mm=0.02, cell_x_mm=2.0, cell_y_mm=2.0)
STRIPES = ReflectanceMap(base=0.8, stripes=(Stripes(value=0.2, period_mm=7.0),))
ROWS, MARGIN = slice(15, 50), 12
"""The profiles, and how many at either end an effect's reach along the travel may concern."""
AHEAD = [PoseError(), PoseError(y_mm=1e-3)]


@pytest.fixture(scope="module")
def view(view_of):
    return view_of("bench", reflectance=STRIPES, y_mm=np.linspace(-24.7, 24.6, 60))


def law_of(effect: Effect, ahead: PoseError, view: View) -> Law:
    """Apply an effect to the view from the poses that an error before it leaves."""
    moved = ahead.moved(view)
    return effect.apply(geometric_law(moved, SURFACE), moved)


@pytest.mark.parametrize("ahead", AHEAD, ids=["unmoved", "moved by 1 um"])
@pytest.mark.parametrize("cls", CATALOGUE.values(), ids=CATALOGUE)
def test_the_law_at_some_profiles_is_the_law_of_these_profiles(cls, ahead, view):
    effect = cls.example()
    if cls.name == "empirical":  # a curve along the travel, whose place matters most
        effect = effect.with_parameters(against="travel")
    whole, alone = law_of(effect, ahead, view), law_of(effect, ahead, view.rows(ROWS))
    inner = slice(ROWS.start + MARGIN, ROWS.stop - MARGIN)
    for name in ("mean_mm", "p_missing", "p_outlier", "reason"):
        one = np.broadcast_to(getattr(whole, name), view.shape)[inner]
        rows = (ROWS.stop - ROWS.start, view.shape[1])
        other = np.broadcast_to(getattr(alone, name), rows)[MARGIN:-MARGIN]
        assert np.allclose(one, other, atol=1e-9, equal_nan=True), (
            f"{name} depends on which profiles are looked at: scans are drawn in strips"
        )


@pytest.mark.parametrize("cls", [c for c in CATALOGUE.values() if issubclass(c, MotionEffect)])
def test_views_of_views_keep_their_place(cls, view):
    strip = view.rows(ROWS)
    moved = cls.example().moved(strip) if cls.name != "motion_blur" else strip.along(strip.laser)
    for one in (moved, strip.shifted(dy_mm=0.1), strip.posed(strip.poses), strip.rows(slice(3, 9))):
        start = ROWS.start + (3 if len(one.poses) == 6 else 0)
        assert one.travel_mm[0] == pytest.approx(view.travel_mm[start], abs=0.5)


def test_another_sensor_sees_the_same_hits_at_the_same_place(view):
    strip = view.rows(ROWS)
    other = strip.with_sensor(view.sensor)
    assert other.hits is strip.hits
    assert np.array_equal(other.travel_mm, strip.travel_mm)
    assert other.reflectance is strip.reflectance
