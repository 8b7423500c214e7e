"""Fillets that the model lacks are found in the corners that have them, and in no other."""

import math
from dataclasses import replace

import manifold3d
import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.physics.effect_fit import fit_effect
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.effects.form_error import FormError
from sensors.model import SensorModel
from sensors.view.creases import concave_creases, filled_mm
from sensors.view.view import View
from tests.support.diagnosis_of import diagnosis_of
from tests.support.effect_case import workspace_of
from tests.support.small_parts import Floats, datasheet, poses, record, solid

TURN = math.radians(50)
AT_MM = 10.0


def trough(left_mm: float, right_mm: float, *, left_rad: float = TURN) -> Scene:
    """Build a floor between two slopes, the corners rounded to these radii."""

    def height(x: Floats, y: Floats) -> Floats:
        rise = np.where(x < 0, math.tan(left_rad), math.tan(TURN))
        out = np.maximum(np.abs(x) - AT_MM, 0.0) * rise
        for side, radius, turn in ((-1, left_mm, left_rad), (1, right_mm, TURN)):
            if radius > 0:
                way = side * x - AT_MM + radius * math.tan(turn / 2)
                arc = (way > 0) & (way < radius * math.sin(turn))
                out[arc] = radius - np.sqrt(radius**2 - way[arc] ** 2)
        return out

    sharp = left_mm == right_mm == 0
    fine = [] if sharp else np.arange(-4.0, 4.0, 0.02)
    x = np.unique(np.concatenate([np.linspace(-26, 26, 14), [-AT_MM, AT_MM],
                                  np.add.outer([-AT_MM, AT_MM], fine).ravel()]))  # fmt: skip
    return solid(height, x, np.linspace(-26, 26, 14))


@pytest.mark.parametrize("tilt_deg", [(0.0, 0.0), (6.0, 9.0), (-5.0, -12.0)])
def test_a_fillet_is_met_before_the_face(tilt_deg: tuple[float, float]) -> None:
    square = tilt_deg == (0.0, 0.0)
    sheet = replace(datasheet(240), columns="even_x" if square else "even_angle")
    laser = Laser.from_datasheet(sheet)
    place, time = poses(8, tilt_deg=tilt_deg), np.arange(8) / sheet.profile_rate_hz
    plain = View(trough(0, 0), SensorModel(sheet), place, time, laser=laser)
    true = View(trough(1.5, 1.5), SensorModel(sheet), place, time, laser=laser)
    filled, crease = filled_mm(plain, 1.5)
    change = plain.depth_mm - true.depth_mm
    assert change.max() > 0.1
    assert np.allclose(filled, change, atol=1e-3)
    assert np.array_equal(crease >= 0, filled > 0)
    if square:  # the arc's height over the floor
        reach = 1.5 * math.tan(TURN / 2)
        left = np.clip(reach - (AT_MM - np.abs(plain.part_mm[..., 0])), 0, reach)
        floor = np.abs(plain.part_mm[..., 0]) < AT_MM
        assert np.allclose(filled[floor], (1.5 - np.sqrt(1.5**2 - left**2))[floor], atol=1e-9)


def test_a_corner_is_named_by_a_point_on_it() -> None:
    sheet, model = datasheet(160), trough(0, 0)
    view = View(model, SensorModel(sheet), poses(40), np.arange(40) / 200.0)
    x = view.part_mm[..., 0]
    creases = concave_creases(model)
    right = creases.start_mm[:, 0] > 0
    points = creases.middle_mm[right]
    everywhere, _ = filled_mm(view, 2.0)
    there, crease = filled_mm(view, 2.0, points)
    assert np.array_equal(there, np.where(x > 0, everywhere, 0.0))
    assert set(np.unique(crease[x > 0])) <= {-1, *np.flatnonzero(right)}
    assert not np.any(filled_mm(view, 2.0, points + [0.0, 0.0, 1.0])[0])


def test_a_fillet_ends_with_its_wall() -> None:
    wall = manifold3d.Manifold.cube((8.0, 4.0, 3.0), center=True)
    floor = manifold3d.Manifold.cube((50.0, 50.0, 2.0), center=True).translate((0, 0, -2.5))
    part = (wall + floor).to_mesh()
    model = Scene(np.asarray(part.vert_properties, float)[:, :3], np.asarray(part.tri_verts))
    sheet = datasheet(240)
    view = View(model, SensorModel(sheet), poses(60), np.arange(60) / 200.0)
    filled, _ = filled_mm(view, 1.5)
    x, y = np.abs(view.part_mm[..., 0]), np.abs(view.part_mm[..., 1])
    beside = ((x > 4.01) & (x < 5.4) & (y < 2.0)) | ((y > 2.01) & (y < 3.4) & (x < 4.0))
    assert np.all(filled[beside] > 0)
    past = np.minimum(x - 4.0, y - 2.0)
    assert past[filled > 0].max() <= 1.5 / 16
    assert np.any((past > 1.5 / 16) & (np.hypot(x - 4.0, y - 2.0) < 1.0))


def test_a_part_without_corners_holds_no_fillet() -> None:
    sides = np.linspace(-20, 20, 5)
    hill = solid(lambda x, y: -np.abs(x), sides, sides)
    assert len(concave_creases(hill).turn_rad) == 0
    sheet = datasheet(40)
    view = View(hill, SensorModel(sheet), poses(4), np.arange(4.0))
    change = FormError(coefficients_um=(), fillet_mm=2.0).signature(view)
    assert np.all(change[view.in_range] == 0.0)


def test_half_a_place_is_refused() -> None:
    with pytest.raises(RecipeError, match="corners_mm of effect form_error.*x, y, z of each"):
        FormError(fillet_mm=1.0, corners_mm=(1.0, 2.0))


@pytest.mark.slow
@pytest.mark.parametrize("radius_mm", [4.0, 2.0])
def test_one_rounded_corner_is_named_and_measured(radius_mm: float) -> None:
    # the smaller one fills nothing but what counts as edge
    model, made, sheet = trough(0, 0), trough(0, radius_mm), datasheet(160)
    scans = [
        record(made, sheet, [], name=name, seed=seed, profiles=80, **placing)
        for seed, (name, placing) in enumerate(
            {
                "a": {"tilt_deg": (4.0, 3.0)},
                "b": {"heading_deg": 180.0, "tilt_deg": (-5.0, 6.0)},
                "c": {"shift_mm": (1.5, 0.0, 1.0), "tilt_deg": (2.0, -4.0)},
            }.items()
        )
    ]
    result = diagnosis_of(scans, model, sheet)
    assert result.verdict == "explained"
    (found,) = result.effects
    assert isinstance(found.effect, FormError)
    assert found.effect.fillet_mm == pytest.approx(radius_mm, rel=0.1)
    corners = np.reshape(found.effect.corners_mm, (-1, 3))
    assert len(corners) > 0
    assert np.allclose(corners[:, [0, 2]], [AT_MM, 0.0])
    assert "corners are rounded" in found.statement


def rounded_corners(made: Scene, model: Scene, shift_mm: float) -> set[float]:
    """Return at which x of the model a fit finds rounded corners, in scans shifted along x."""
    sheet = datasheet(100)
    scans = [
        record(made, sheet, [], name=name, seed=seed, profiles=40, shift_mm=(shift_mm, 0.0, 0.0),
               tilt_deg=tilt_deg)
        for seed, (name, tilt_deg) in enumerate({"a": (4.0, 3.0), "b": (-3.0, -2.0)}.items())
    ]  # fmt: skip
    ws = workspace_of(scans, model, sheet)
    states = ws.states(ws.predict(Model()))
    found = fit_effect(FormError, ws, Model(), states, polish=False)
    assert found is not None
    assert isinstance(found.effect, FormError)
    assert found.effect.fillet_mm == pytest.approx(4.0, rel=0.25)  # radii of the grid
    return {float(x) for x in np.reshape(found.effect.corners_mm, (-1, 3))[:, 0].round(6)}


def test_a_corner_without_readings_is_presumed_to_be_as_those_of_its_angle() -> None:
    both, other = {-AT_MM, AT_MM}, math.radians(35)
    assert rounded_corners(trough(4, 4), trough(0, 0), shift_mm=0.0) == both
    # the left corner isn't seen
    assert rounded_corners(trough(0, 4), trough(0, 0), shift_mm=25.0) == both
    askew = rounded_corners(
        trough(4, 4, left_rad=other), trough(0, 0, left_rad=other), shift_mm=25.0
    )
    assert askew == {AT_MM}


def test_where_a_corner_of_the_angle_is_sharp_none_is_presumed_rounded() -> None:
    assert rounded_corners(trough(0, 4), trough(0, 0), shift_mm=0.0) == {AT_MM}
