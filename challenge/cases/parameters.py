"""True values of catalogue parameters in a case of the first family, where the law is common."""

from collections.abc import Mapping
from typing import Any

Parameters = dict[str, dict[str, float]]


def true_parameters(facts: Mapping[str, Any], switches: tuple[str, ...]) -> Parameters:
    """Effect -> parameter -> value; the second family's keys hold them, the first's what was set.

    Parameters
    ----------
    facts : of a key
    switches : of the case; values of others are the good instrument's
    """
    if "parameters" in facts:
        return dict(facts["parameters"])
    if "switched" not in facts:
        return {}
    motion, faults = facts["switched"]["motion"], facts["switched"]["faults"]
    stretch = facts["switched"]["plan"]["gauge_stretch"]
    known: Parameters = {
        "stage_vibration": {"amplitude_um": 1e3 * motion["shake_mm"],
                            "frequency_hz": motion["shake_hz"]},
        "travel_ripple": {"amplitude_um": 1e3 * motion["ripple_mm"],
                          "period_mm": motion["ripple_period_mm"]},
        "motion_blur": {"exposure_ms": 1e3 * facts["switched"]["sheet"]["exposure_s"]},
        "random_dropout": {"share": faults["lost_share"]},
        # a true height h (1 + e) was learnt as h
        "range_scale": {"error_ppm": -1e6 * stretch / (1 + stretch)},
    }  # fmt: skip
    return {name: values for name, values in known.items() if name in switches}
