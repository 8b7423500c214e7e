"""Filters of the firmware are told from other finishes by the noise's spectrum."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from diagnosis.claims.drawn_filters import filters_on
from diagnosis.claims.firmware import filtered_readings, noise_spectra, otherwise_explained
from diagnosis.claims.noise_of_recordings import off_edges
from diagnosis.data.patch import all_fitted
from diagnosis.discrepancy.population import population
from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.prepare import Inputs, Prepared, prepared
from sensors.casting.scene import Scene
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.volume_scattering import VolumeScattering
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.noise.perlin import PerlinField
from sensors.recording import Recording
from sensors.surface.surface import Surface
from sensors.view.view import View
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import SPECKLE, datasheet, part, poses, record

NONE = OnboardFilter.none()
SURFACE = Surface(name="rough", rpm_mm=0.015, rvm_mm=0.015, pc_per_mm=1.2)
WINDOWS = [
    {"median_points": 3, "median_profiles": 3, "mean_points": 5},
    {"mean_points": 5},
    {"mean_profiles": 3, "mean_points": 3},
    {"median_points": 5},
    {"median_points": 3, "median_profiles": 3},
    {"mean_profiles": 7},
]


def ready_of(recordings: list[Recording], scene: Scene, **more: object) -> Prepared:
    inputs = Inputs(
        recordings=recordings, vertices_mm=scene.vertices_mm, faces=scene.faces,
        datasheet=datasheet(141), **more,
    )  # fmt: skip
    return prepared(inputs, [], lambda _: None)


def through(firmware: OnboardFilter, recording: Recording) -> Recording:
    return replace(recording, depth_mm=firmware.filtered(recording.depth_mm))


def plate_of(
    firmware: OnboardFilter, *, amplitude: float = 1.0, peaks: float = 1.0
) -> list[Recording]:
    """Recordings of a plate of another roughness than its file claims, through the firmware."""
    scene, sheet, made = part("plate"), datasheet(141), []
    for number in range(2):
        way = poses(81, pitch_mm=0.3)
        view = View(scene, SensorModel(sheet), way, np.arange(81) / 200)
        field = geometric_law(view, SURFACE).speckle
        assert isinstance(field, PerlinField)
        field = replace(
            field, amplitude_mm=field.amplitude_mm * amplitude,
            cell_x_mm=field.cell_x_mm / peaks, cell_y_mm=field.cell_y_mm / peaks,
        )  # fmt: skip
        rng = np.random.default_rng([1, number])
        heights = field.sample(view.column_x_mm, 0.3 * np.arange(81.0), rng)
        readings = view.depth_mm + heights + 2.1e-3 * rng.standard_normal(heights.shape)
        filtered = firmware.filtered(np.rint(readings / sheet.step_mm) * sheet.step_mm)
        made.append(Recording(
            name=f"r{number}", depth_mm=filtered, poses=way, time_s=np.arange(81) / 200
        ))  # fmt: skip
    return made


def hills(seed: int, **speckle: float) -> Recording:
    """A recording of some hills on a plane."""
    return record(
        part("domes"), datasheet(141), [], name=f"w{seed}", seed=seed, profiles=90, pitch_mm=0.35,
        shift_mm=(0.5 * seed, 0.3 * seed, 0.0), speckle=replace(SPECKLE, **speckle),
    )  # fmt: skip


@pytest.mark.parametrize("windows", WINDOWS)
def test_a_filter_is_found_against_a_surface_s_file(windows):
    firmware = NONE.with_parameters(windows)
    recordings = plate_of(firmware, amplitude=0.9)
    spectra = noise_spectra(ready_of(recordings, part("plate"), surface=SURFACE))
    found = spectra.weighed(spectra.names)
    assert found.factors.max() > 10
    assert spectra.filters[int(found.known.argmax())] == firmware


@pytest.mark.parametrize("amplitude", [0.2, 0.8])
@pytest.mark.parametrize("peaks", [0.3, 1.0, 2.0])
def test_another_finish_is_no_filter(amplitude, peaks):
    recordings = plate_of(NONE, amplitude=amplitude, peaks=peaks)
    spectra = noise_spectra(ready_of(recordings, part("plate"), surface=SURFACE))
    assert spectra.weighed(spectra.names).factors.max() < 3


@pytest.mark.parametrize("windows", [w for w in WINDOWS if w != {"median_points": 5}])
def test_a_filter_is_found_beside_baselines(windows):
    """But for a median along a line that runs over slopes: it does next to nothing there."""
    firmware = NONE.with_parameters(windows)
    ready = ready_of(
        [through(firmware, hills(k)) for k in (1, 2)], part("domes"),
        baselines=[hills(3), hills(4)],
    )  # fmt: skip
    spectra = noise_spectra(ready)
    found = spectra.weighed(spectra.names)
    assert found.factors.max() > 5
    best = spectra.filters[int(found.known.argmax())]
    assert best.mean_window == firmware.mean_window
    if best.mean_window == (1, 1):
        assert best == firmware


@pytest.mark.parametrize(
    "change", [{}, {"amplitude_mm": 0.02}, {"cell_x_mm": 1.6, "cell_y_mm": 2.2}]
)
def test_no_filter_is_found_beside_baselines(change):
    ready = ready_of(
        [hills(k, **change) for k in (1, 2)], part("domes"), baselines=[hills(3), hills(4)]
    )
    spectra = noise_spectra(ready)
    assert spectra.weighed(spectra.names).factors.max() < 3


def test_a_median_averages_along_level_lines():
    """On a slope along the line that is steep beside the noise, waves along the line are left."""
    plate, sheet = part("plate"), datasheet(141)
    tilted = record(
        plate, sheet, [], name="r", seed=1, pitch_mm=0.3, tilt_deg=(0.0, 20.0), shift_mm=(0, 0, 2)
    )
    ready = ready_of([tilted], plate)
    recordings = off_edges(Workspace.build(all_fitted(ready.patches), ready.noise), Model())
    filters, changes = filters_on(recordings, replace(ready.noise, sd_mm=1.0))
    median = NONE.with_parameters({"median_points": 3, "median_profiles": 3})
    change = np.append(0.0, changes[filters.index(median), 0]).reshape(4, 4)
    along_line, along_travel = change[0, 3], change[3, 0]
    assert abs(along_line) < 0.2
    assert along_travel < -1


@pytest.mark.parametrize("windows", [WINDOWS[4], WINDOWS[2]])
def test_a_filter_is_named_and_expected_at_edges(windows):
    """What it does at the steps of a part is neither a spot nor a blur."""
    firmware, steps = NONE.with_parameters(windows), part("steps")
    good = [
        record(steps, datasheet(141), [], name=f"s{k}", seed=k, heading_deg=30.0 * k, profiles=100)
        for k in range(5)
    ]
    found = diagnosis_of(
        [through(firmware, r) for r in good[:3]], steps, datasheet(141), baselines=good[3:]
    )
    assert [e.name for e in found.effects] == [OnboardFilter.name]
    assert found.effects[0].effect == firmware
    assert found.effects[0].probability > 0.9
    listed = [e for e in found.datasheet.effects if e["name"] == OnboardFilter.name]
    assert listed == [firmware.to_mapping()]
    assert found.after.log_score < found.before.log_score  # lower is better


def lagging(recording: Recording) -> Recording:
    """The electronics follow each reading by a third: a filter that no window describes."""
    lagged = lfilter([0.33], [1.0, -0.67], recording.depth_mm, axis=1)
    return replace(recording, depth_mm=np.where(np.arange(lagged.shape[1]) < 20, np.nan, lagged))


@pytest.mark.parametrize("plates", [True, False])
def test_a_translucent_part_smooths_noise_as_no_plate_does(plates: bool) -> None:
    """A filter of unknown form is as likely, but beside baselines, which are of the part."""
    recordings = [lagging(r) for r in plate_of(NONE)]
    before = [replace(r, name=f"good {r.name}") for r in plate_of(NONE)]
    given = {"references": before} if plates else {"baselines": before}
    ready, (found,) = filtered_readings(
        ready_of(recordings, part("plate"), **given), population(), ()
    )
    assert found.name == OnboardFilter.name
    assert found.doubt
    assert [name for name, *_ in found.alternatives] == [VolumeScattering.name] * plates
    assert found.probability == pytest.approx(0.5 if plates else 1.0, abs=0.04)
    assert found.none_of_these < 0.05
    assert ready.filtered is not None
    assert ready.filtered.probability == found.probability
    # where the mean shows the material as well, that is what smooths the noise
    sunk = Cause(
        name=VolumeScattering.name, channel="mean", probability=0.9, alternatives=(),
        none_of_these=0.1, nats=9.0,
    )  # fmt: skip
    for causes, kept in (((), True), ((sunk,), not plates)):
        notes: list[str] = []
        again, by_form = otherwise_explained(ready, causes, [found], notes)
        assert (again.filtered is not None) is kept
        assert by_form == [found] * kept
        assert len(notes) == kept
