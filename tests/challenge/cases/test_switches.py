"""Switches of the first family speak the catalogue's names."""

from challenge.cases.case import SWITCHES
from challenge.cases.parts import SHAPES
from challenge.cases.switches import DECOY, SINGLE, UNKNOWN

FORMATS = {
    "camera_occlusion", "finite_spot", "edge_mixing", "reflectance_edge", "incidence_noise",
    "incidence_bias", "specular_dropout", "interreflection", "volume_scattering",
    "pixel_locking", "column_offset", "lens_distortion", "line_bow", "range_scale", "pose_error",
    "stage_vibration", "travel_ripple", "motion_blur", "thermal_drift", "outlier_spikes",
    "random_dropout", "anisotropic_lay", "roughness_level", "form_error", "row_repeat",
}  # fmt: skip


def test_switches_speak_the_catalogues_names():
    for name, switch in SWITCHES.items():
        assert set(switch.accept) | set(switch.rivals) <= FORMATS, name
        assert set(switch.shapes) <= set(SHAPES), name
    assert set(SINGLE) <= FORMATS
    assert not any(UNKNOWN[name].accept for name in UNKNOWN)
    assert set(DECOY) & set(SINGLE) == set()
