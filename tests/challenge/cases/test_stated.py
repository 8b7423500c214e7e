"""What a maker's file says at edges: the challenge's own reading against the catalogue's."""

import numpy as np
import pytest

from challenge.cases.artefact import artefact, edge_figures
from challenge.cases.case import Secret, edge_on, stage
from challenge.cases.nominal import noise_law, noise_on_plane
from challenge.cases.stated import Rays, stated
from challenge.instrument.instrument import Path, Solid
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import effects_of
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.view.view import View


@pytest.fixture(scope="module")
def staged():
    """Stage a null of one recording."""
    return stage(
        Secret(kind="null", switches=(), strength=1, shape="terraces", recordings=1, seed=10)
    )


def test_listed_laws_are_the_catalogues(staged):
    world = staged.off
    path, camera = world.scans.paths[0], world.device.camera
    rows = slice(40, 70)
    rays = Rays(world.solid, path, np.eye(4), camera, world.device.z_range_mm, rows=rows)
    mine = stated(rays, staged.effects).depth_mm
    sheet = Datasheet(
        name="s",
        working_distance_mm=camera.working_distance_mm,
        z_range_mm=world.device.z_range_mm,
        x_fov_mm=2 * camera.working_distance_mm * float(np.tan(camera.fov_rad / 2)),
        points_per_profile=camera.columns,
        z_resolution_um=1.0,
        repeatability_um=1.0,
        profile_rate_hz=100.0,
        travel_speed_mm_s=10.0,
        triangulation_angle_deg=float(np.degrees(camera.triangulation_rad)),
        camera_side="+y" if camera.side > 0 else "-y",
        effects=tuple(staged.effects),
    )
    poses = path.poses()[rows]
    view = View(Scene(world.solid.vertices_mm, world.solid.faces), SensorModel(sheet), poses,
                np.arange(len(poses)) / 100.0)  # fmt: skip
    law = geometric_law(view, None)
    for effect in effects_of(sheet):
        law = effect.apply(law, view)
    theirs = np.where(law.reason == 0, law.mean_mm, np.nan)
    differs = np.isfinite(mine) != np.isfinite(theirs)
    assert differs.mean() < 0.002  # rays through an edge, cast by two casters
    both = np.isfinite(mine) & np.isfinite(theirs)
    rest = np.abs(mine - theirs)[both]
    assert np.mean(rest > 0.002) < 0.005
    assert np.median(rest) < 1e-4
    assert both.mean() > 0.5


def test_artefact_rises_and_returns():
    solid, length = artefact()
    z = solid.vertices_mm[:, 2]
    assert z.max() == pytest.approx(1.5)
    assert z[0] == pytest.approx(z[-1], abs=1e-9)
    assert 5 < length < 15


def test_figures_of_edges_beat_the_line_left_alone(staged):
    # the maker's choice never describes the artefact worse than a line that has no width
    figures = edge_figures(staged.good, np.random.default_rng(1), along_um=25.0)
    waist_um = 1e3 * staged.good.sheet.waist_mm
    assert 0.7 * waist_um < figures.spot_um < 2 * waist_um
    assert 0.3 * waist_um < figures.mixing_um < 1.3 * waist_um
    # a line is read as long as its tail reaches the threshold: a few hundredths of its light
    assert 0.005 <= figures.weakest <= 0.12


def test_noise_law_follows_common_slopes(staged):
    rng = np.random.default_rng(2)
    law = noise_law(lambda *plate: noise_on_plane(staged.good, *plate, rng))
    # a line on a facet that leans from the camera looks shorter, and its speckle moves it less
    assert law.lean * staged.good.camera.side > 0.05
    assert law.worst < 0.2


def test_no_file_states_noise_that_no_file_may_state():
    growing = noise_law(lambda x, y, _: float(np.exp(9 * np.hypot(x, y))))
    falling = noise_law(lambda x, y, _: float(np.exp(-np.hypot(x, y))))
    leaning = noise_law(lambda _x, y, _n: float(np.exp(5 * y)))
    assert (growing.exponent, falling.exponent, leaning.lean) == (4.0, 0.0, 3.0)


def test_a_wall_seen_edge_on_is_counted(staged):
    camera = staged.good.camera
    # a plane that holds the sight line of the camera almost in itself
    slope = camera.side / np.tan(camera.triangulation_rad) * 0.9
    wd = camera.working_distance_mm
    y = np.array([-1.0, -1.0, 1.0, 1.0])
    x = np.array([-20.0, 20.0, -20.0, 20.0])
    for sign, share in ((1.0, 1.0), (-1.0, 0.0)):
        corners = np.stack([x, y, wd - sign * slope * y], 1)
        plane = Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))
        start = np.eye(4)
        start[1, 3] = -0.5
        path = Path(start=start, direction=1, profiles=10, pitch_mm=0.1, rate_hz=1.0, start_s=0.0)
        assert edge_on(plane, path, staged.good) == pytest.approx(share)
