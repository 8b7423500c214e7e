"""Physical effects beyond the nominal model, one per file, and their catalogue."""

from collections.abc import Mapping
from typing import Any

from files.errors import RecipeError, known
from sensors.datasheet import Datasheet
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.axis_quantisation import AxisQuantisation
from sensors.effects.base import AdditiveEffect, MotionEffect
from sensors.effects.basis import Basis
from sensors.effects.camera_occlusion import CameraOcclusion
from sensors.effects.column_offset import ColumnOffset
from sensors.effects.delivery import DeliveryEffect
from sensors.effects.edge_mixing import EdgeMixing
from sensors.effects.effect import Effect
from sensors.effects.empirical import Empirical
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.form_error import FormError
from sensors.effects.incidence_bias import IncidenceBias
from sensors.effects.incidence_noise import IncidenceNoise
from sensors.effects.interreflection import Interreflection
from sensors.effects.lateral_error import LateralError
from sensors.effects.lens_distortion import LensDistortion
from sensors.effects.light_falloff import LightFalloff
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.outlier_spikes import OutlierSpikes
from sensors.effects.parameter import Parameter
from sensors.effects.pixel_locking import PixelLocking
from sensors.effects.pose_error import PoseError
from sensors.effects.random_dropout import RandomDropout
from sensors.effects.range_scale import RangeScale
from sensors.effects.reflectance_edge import ReflectanceEdge
from sensors.effects.roughness_level import RoughnessLevel
from sensors.effects.row_repeat import RowRepeat
from sensors.effects.specular_dropout import SpecularDropout
from sensors.effects.stage_vibration import StageVibration
from sensors.effects.thermal_drift import ThermalDrift
from sensors.effects.travel_ripple import TravelRipple
from sensors.effects.volume_scattering import VolumeScattering

__all__ = [
    "CATALOGUE",
    "AdditiveEffect",
    "Basis",
    "DeliveryEffect",
    "Effect",
    "MotionEffect",
    "Parameter",
    "effect_of",
    "effects_of",
]

_EFFECTS: tuple[type[Effect], ...] = (
    CameraOcclusion,
    FiniteSpot,
    EdgeMixing,
    ReflectanceEdge,
    IncidenceNoise,
    IncidenceBias,
    SpecularDropout,
    LightFalloff,
    Interreflection,
    VolumeScattering,
    PixelLocking,
    ColumnOffset,
    LensDistortion,
    LateralError,
    LineBow,
    RangeScale,
    PoseError,
    StageVibration,
    TravelRipple,
    MotionBlur,
    ThermalDrift,
    OutlierSpikes,
    RandomDropout,
    AnisotropicLay,
    RoughnessLevel,
    FormError,
    AxisQuantisation,
    OnboardFilter,
    RowRepeat,
    Empirical,
)
CATALOGUE: dict[str, type[Effect]] = {effect.name: effect for effect in _EFFECTS}


def effect_of(mapping: Mapping[str, Any], *, where: str = "effects") -> Effect:
    """Build one effect from its entry in a sensor's `effects`.

    Raises
    ------
    RecipeError
        For an unknown effect, an unknown key, or a value out of its bounds.
    """
    name = mapping.get("name")
    if name not in CATALOGUE:
        raise RecipeError(
            "no such effect", where=where, value=name, **known(str(name), sorted(CATALOGUE))
        )
    return CATALOGUE[name].from_mapping(mapping, where=where)


def effects_of(datasheet: Datasheet) -> tuple[Effect, ...]:
    """Build the effects that a sensor's file lists, in order.

    Raises
    ------
    RecipeError
        For a wrong entry, naming the sensor and the entry.
    """
    place = f"sensor '{datasheet.name}'"
    return tuple(
        effect_of(entry, where=f"{place}: effects[{i}]")
        for i, entry in enumerate(datasheet.effects)
    )
