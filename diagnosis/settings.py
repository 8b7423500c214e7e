"""Every number of the diagnosis that nothing determines: value, unit, and where it comes from.

The numbers of the evidence are fields of `Settings`; those of a room are fields of a record of the
room's name: `SETTINGS.register.position_mm`. diagnosis.json holds all of them, with their sources.

What a good instrument departs by is none of them: it is learnt from a named population
(`discrepancy/population.py`), or from the user's baselines.
"""

from dataclasses import asdict, dataclass, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from quantity import quantities, quantity

Floats = NDArray[np.float64]
CHOSEN = "chosen; no measurement"
"""Source of a number that nothing was measured or derived for."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictSettings:
    """Predictive distributions, depth edges, borders of the albedo: `predict/`."""

    least_missing: float = quantity(
        "smallest probability that a reading is lost, or that it is an outlier",
        default=2e-4, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    least_found: float = quantity(
        "smallest probability of a reading, also where the model expects none",
        default=0.02, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    local_doubt: float = quantity(
        "share of its change of the mean by which a law at edges and in corners may be wrong",
        default=0.4, unit="1", low=0.0,
        source="chosen; such laws are approximations",
    )  # fmt: skip
    crease: float = quantity(
        "change of slope from one point to the next that makes a crease",
        default=0.2, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    crease_typical: float = quantity(
        "change of slope that makes a crease, over that typical of the recording, if it is larger",
        default=6.0, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    step_mm: float = quantity(
        "change of the depth within reach of a misplaced edge that is a step",
        default=1.0, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    step_chance: float = quantity(
        "probability that a point beside a step belongs to its other side",
        default=0.1, unit="1", low=0.0, high=0.5, source=CHOSEN,
    )  # fmt: skip
    outline_chance: float = quantity(
        "probability that a point beside the outline of what is seen belongs to its other side",
        default=0.3, unit="1", low=0.0, high=0.5, source=CHOSEN,
    )  # fmt: skip
    line_sd_mm: float = quantity(
        "standard deviation of a laser line across its width, where the sensor's file states none",
        default=0.03, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    border_step: float = quantity(
        "step of the brightness's logarithm between profiles that is a border of the albedo",
        default=0.15, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    border_reach: int = quantity(
        "profiles to each side of a border within which a reading depends on the line's width",
        default=2, unit="", low=0, whole=True,
        source="as at depth edges, whose reach is two points at least",
    )  # fmt: skip
    size_classes: tuple[float, ...] = quantity(
        "sizes of a law's changes, over the noise, at which classes with a share of their own "
        "begin",
        default=(0.0, 0.5, 1.0, 2.0, 4.0, 8.0), unit="σ", low=0.0,
        source="octaves from half of the noise",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseSettings:
    """Size, correlation and tails of the noise: `noise/`."""

    clip_sd: float = quantity(
        "deviations beyond which a reading counts as an outlier when the noise is measured",
        default=4.5, unit="σ", low=0.0,
        source="7 of a million Gaussian readings",
    )  # fmt: skip
    tail_sd: float = quantity(
        "size of outliers over the noise, where plates show none that are larger",
        default=8.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    least_tail_sd: float = quantity(
        "smallest size of outliers over the noise, where plates show some",
        default=6.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    least_readings: int = quantity(
        "readings below which no correlation of the noise is measured",
        default=50, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    off_edges: int = quantity(
        "readings off depth edges below which those at edges count for the noise, too",
        default=100, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    same_pitch: float = quantity(
        "change of the pitch's logarithm below which lags of the correlation stay as they are",
        default=0.1, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    least_pairs: int = quantity(
        "pairs of readings below which the autocorrelation at a lag counts as none",
        default=200, unit="", low=1, whole=True,
        source="chosen; the standard deviation of such a correlation is 0.07",
    )  # fmt: skip
    even_share: float = quantity(
        "share of a recording's readings off edges that must lie off borders of the albedo, too, "
        "for the noise to be measured on these alone",
        default=0.1, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    usual_share: float = quantity(
        "largest share of losses or outliers that counts as noise of a good instrument",
        default=5e-4, unit="1", low=0.0, high=1.0,
        source="chosen; a sensor's file has to state more",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class RegisterSettings:
    """Where the part lay and how the travel went: `register/`."""

    position_mm: float = quantity(
        "standard deviation of a commanded position; also the largest median distance of readings "
        "from a part whose unit is right",
        default=2.0, unit="mm", low=0.0, above=True,
        source="chosen; a part lies anywhere",
    )  # fmt: skip
    turn_rad: float = quantity(
        "standard deviation of a commanded orientation",
        default=0.02, unit="rad", low=0.0, above=True,
        source="chosen; a part lies anywhere",
    )  # fmt: skip
    travel_share: float = quantity(
        "standard deviation of the travel's length, over the length",
        default=3e-4, unit="1", low=0.0, above=True,
        source="makers' data of linear stages: a few hundred ppm",
    )  # fmt: skip
    travel_turn_rad: float = quantity(
        "standard deviation of the travel's direction in the sensor's frame",
        default=1e-3, unit="rad", low=0.0, above=True,
        source="makers' data of linear stages: a milliradian",
    )  # fmt: skip
    together: int = quantity(
        "readings that count as one against that prior, since neighbours share noise",
        default=50, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    jump_pitches: float = quantity(
        "change of the depth to the next reading, in pitches, that is a depth edge",
        default=6.0, unit="", low=0.0, source=CHOSEN,
    )  # fmt: skip
    crease_deg: float = quantity(
        "turn of the normal to the next reading that is a crease",
        default=12.0, unit="deg", low=0.0, high=90.0, source=CHOSEN,
    )  # fmt: skip
    crease_weight: float = quantity(
        "weight of readings by creases and corners, over that on smooth faces",
        default=0.2, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    bisquare_sd: float = quantity(
        "deviations beyond which a reading has no weight (Tukey's bisquare)",
        default=3.5, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    least_readings: int = quantity(
        "readings on smooth faces below which the placement isn't changed further",
        default=30, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    least_met: int = quantity(
        "readings whose rays must meet the part from the commanded poses",
        default=50, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    least_share_met: float = quantity(
        "share of a recording's readings whose rays must meet the part from the commanded poses",
        default=0.02, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    unit_met: float = quantity(
        "share of the readings whose rays must meet a part whose unit is right",
        default=0.5, unit="1", low=0.0, high=1.0,
        source="chosen: most of them",
    )  # fmt: skip
    unit_nearer: float = quantity(
        "median distance from a part in another unit below which that unit is proposed, over the "
        "distance from the part as it is",
        default=0.1, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    open_pitches: float = quantity(
        "standard deviation, in pitches, from which smooth faces leave a direction open",
        default=0.01, unit="", low=0.0,
        source="blurred terraces: planes were up to two pitches off at deviations of 0.01 to 0.1",
    )  # fmt: skip
    silhouette_pitches: float = quantity(
        "smallest step of the depth, in pitches, that is a silhouette",
        default=0.3, unit="", low=0.0, source=CHOSEN,
    )  # fmt: skip
    shadow_pitches: int = quantity(
        "pitches by which a shadow's end may be off",
        default=3, unit="", low=0, whole=True, source=CHOSEN,
    )  # fmt: skip
    least_settled: float = quantity(
        "what a placement by edges must save: readings on the wrong side of a silhouette; nats "
        "under a model",
        default=5.0, unit="", low=0.0, source=CHOSEN,
    )  # fmt: skip

    def prior_sd(self) -> tuple[float, ...]:
        """Return a placement's standard deviations: mm, rad, share of the travel, its turns."""
        return (
            *(self.position_mm,) * 3, *(self.turn_rad,) * 3, self.travel_share,
            *(self.travel_turn_rad,) * 2,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class DataSettings:
    """Outliers of a recording, brightness of the surface, albedo patterns: `data/`."""

    outlier_sd: float = quantity(
        "deviations from the model and from the neighbours beyond which a reading is an outlier",
        default=6.0, unit="σ", low=0.0,
        source="chosen; no Gaussian reading",
    )  # fmt: skip
    lateral_pitches: float = quantity(
        "how far edges may be off sideways for no reason of physics, over the profiles' pitch",
        default=0.05, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    least_lateral_mm: float = quantity(
        "smallest distance by which edges may be off sideways",
        default=0.015, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    most_lateral_mm: float = quantity(
        "largest distance by which edges may be off sideways",
        default=0.05, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    plate_readings: int = quantity(
        "readings that a scan of a plate must have",
        default=100, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    plate_flat_mm: float = quantity(
        "largest deviation (robust) of a plate from a plane",
        default=0.5, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    plate_sd: float = quantity(
        "deviations, over the robust one, beyond which a reading isn't the plate's",
        default=30.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    speckle_sd: float = quantity(
        "deviations of the speckle beyond which a change of brightness is the surface's",
        default=6.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    border_sd: float = quantity(
        "deviations of the speckle from both levels beyond which a line lies on a border of an "
        "albedo pattern",
        default=3.0, unit="σ", low=0.0,
        source="as likely on it as off it where a line is a twentieth of the pitch wide",
    )  # fmt: skip
    direction_readings: int = quantity(
        "readings below which the brightness of surfaces of one direction isn't known",
        default=50, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    one_albedo: float = quantity(
        "standard deviation of the brightness's logarithm, once the directions of the surface are "
        "subtracted, below which a part has one albedo",
        default=0.15, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    pattern_step: float = quantity(
        "smallest step of the brightness's logarithm between the two levels of an albedo pattern",
        default=0.3, unit="1", low=0.0,
        source="speckle of a contrast of 0.4 leaves 0.12 in a single recording; shading less",
    )  # fmt: skip
    pattern_cos: float = quantity(
        "cosine of the incidence below which a reading is left out of an albedo pattern",
        default=0.5, unit="1", low=0.0, high=1.0,
        source="chosen; at more than 60° much of a face lies in one cell",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class ComponentsSettings:
    """Periods over the range: `components/row_periods.py`."""

    least_periods: int = quantity(
        "fewest periods over the readings' span of the range that are looked for",
        default=8, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    period_readings: int = quantity(
        "readings below which no period is looked for",
        default=500, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class ModelSettings:
    """Shrinkage of laws: `model/shrinkage.py`."""

    shrinkage_clip: float = quantity(
        "deviations beyond which a reading or a law's change counts as that far off",
        default=10.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    shrinkage_readings: int = quantity(
        "readings of each class that support a law whole before any is looked at",
        default=10, unit="", low=0, whole=True, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class ReregisterSettings:
    """Registration again under a model: `reregister/`."""

    near_mm: float = quantity(
        "shift of a part up to which depths are linear in it, and no registration is needed",
        default=0.03, unit="mm", low=0.0, source=CHOSEN,
    )  # fmt: skip
    near_sd: float = quantity(
        "change of a depth, over the noise, up to which it is linear in the placement",
        default=3.0, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class PhysicsSettings:
    """Fits of the laws of named causes: `physics/`."""

    weakest_shares: tuple[float, ...] = quantity(
        "visible shares of a line's light, least of which gives a reading, that are tried where "
        "the sensor's file states none",
        default=(0.4, 0.25, 0.1, 0.04), unit="1", low=0.0, high=1.0,
        source="between the steps in which parts of a line are hidden (`sub_lines`)",
    )  # fmt: skip
    tried_readings: int = quantity(
        "readings on which laws at edges are tried",
        default=30000, unit="", low=1, whole=True,
        source="time; a size of 0.01 is still known to a half",
    )  # fmt: skip
    edge_noise: tuple[float, ...] = quantity(
        "factors on the noise at depth edges, of which the likeliest counts when laws are compared",
        default=(0.7, 1.0, 1.4, 2.0, 2.8, 4.0), unit="1", low=0.0,
        source="half octaves; nine good instruments scatter there by 1 or 1.4",
    )  # fmt: skip
    edge_places: tuple[float, ...] = quantity(
        "factors on how far an edge may be off, of which the likeliest counts as well",
        default=(1.0, 2.0, 4.0, 8.0), unit="1", low=1.0,
        source="octaves; of 22 good instruments eleven are off by 2 to 4, one by 8",
    )  # fmt: skip
    tilt_nats: float = quantity(
        "evidence above which columns have slopes beside their offsets",
        default=3.0, unit="nat", low=0.0,
        source="twenty to one",
    )  # fmt: skip
    fillet_nats: float = quantity(
        "gain above which a concave corner has a fillet, and below whose negative it is sharp",
        default=5.0, unit="nat", low=0.0, source=CHOSEN,
    )  # fmt: skip
    fillet_nats_each: float = quantity(
        "what a fillet must gain besides for each of its readings at edges",
        default=0.5, unit="nat", low=0.0,
        source="the nominal law may be off there by its noise",
    )  # fmt: skip
    corners_alike_deg: float = quantity(
        "difference of their angles below which corners are of one kind",
        default=12.0, unit="deg", low=0.0, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class ValidateSettings:
    """Held-out readings: `validate/heldout.py`."""

    own_every: int = quantity(
        "one group of profiles of so many serves a recording's own parameters and isn't scored",
        default=5, unit="", low=2, whole=True, source=CHOSEN,
    )  # fmt: skip
    group_profiles: int = quantity(
        "profiles of a group, where a recording has enough of them",
        default=6, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class LocaliseSettings:
    """Regions: `localise/`."""

    marked_sd: float = quantity(
        "change of the mean over the noise, averaged over neighbours, from which a reading is in a "
        "region",
        default=0.3, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    marked_lost: float = quantity(
        "change of the probability of a missing reading, averaged over neighbours, from which it "
        "is in a region",
        default=0.2, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    faint_share: float = quantity(
        "where no change of the mean reaches `marked_sd`: change from which a reading is in a "
        "region, over the 98 % quantile of the changes",
        default=0.4, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    faint_sd: float = quantity(
        "smallest such change, over the noise",
        default=0.02, unit="σ", low=0.0, source=CHOSEN,
    )  # fmt: skip
    free_score: float = quantity(
        "deviations of a local mean from which it is in a region where no effect was found",
        default=3.5, unit="σ", low=0.0,
        source="0.05 % of Gaussian means",
    )  # fmt: skip
    least_points: int = quantity(
        "readings that a region has, except the largest",
        default=4, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    alone_sd: float = quantity(
        "change of the mean over the noise, and of the noise over itself, from which an effect "
        "counts for the region that a reading is in",
        default=0.1, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    alone_lost: float = quantity(
        "change of the probability of a missing reading from which an effect counts so",
        default=0.002, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class ClaimsSettings:
    """Recordings against claims: `claims/`."""

    square_deg: float = quantity(
        "incidence below which the noise is compared with a plate's",
        default=25.0, unit="deg", low=0.0, high=90.0, source=CHOSEN,
    )  # fmt: skip
    darker: float = quantity(
        "share of these readings that are darker than those compared",
        default=0.6, unit="1", low=0.0, high=1.0,
        source="chosen; a dark albedo is noisier whatever the surface's texture",
    )  # fmt: skip
    unchanged: float = quantity(
        "change of the noise, and of the mean over the noise, by effects of the model below which "
        "a reading is compared",
        default=0.1, unit="1", low=0.0, source=CHOSEN,
    )  # fmt: skip
    level_parts: int = quantity(
        "parts of what another cause of noise follows, in each of which the noise is compared",
        default=6, unit="", low=1, whole=True, source=CHOSEN,
    )  # fmt: skip
    finer: float = quantity(
        "factor on the density of a surface's peaks, up or down, from which it is reported",
        default=1.35, unit="1", low=1.0,
        source="correlation lengths of plates differ by as much",
    )  # fmt: skip
    averaged: float = quantity(
        "factor on a plate's noise below which a translucent material is tried",
        default=0.9, unit="1", low=0.0, high=1.0,
        source="speckle of a surface rougher than the wavelength doesn't depend on its roughness "
        "(Dorsch, Häusler and Herrmann 1994); the value is chosen",
    )  # fmt: skip
    of_finish: float = quantity(
        "probability that a changed level of the noise is the finish's, not a translucent "
        "material's",
        default=0.62, unit="1", low=0.0, high=1.0,
        source="calibration sets, sealed ones that were opened among them: 4 of the 6 finishes so "
        "named were right (Laplace's rule of succession)",
    )  # fmt: skip
    filter_lags: int = quantity(
        "lags along either axis below which no filter is looked for",
        default=8, unit="", low=1, whole=True, source="they tell the octaves that are compared",
    )  # fmt: skip
    slack_deg: float = quantity(
        "standard deviation of a placement by registration alone: turns",
        default=0.01, unit="deg", low=0.0, above=True, source=CHOSEN,
    )  # fmt: skip
    slack_mm: float = quantity(
        "standard deviation of a placement by registration alone: offsets across the range",
        default=0.01, unit="mm", low=0.0, above=True, source=CHOSEN,
    )  # fmt: skip
    slack_range_mm: float = quantity(
        "standard deviation of a placement by registration alone: offset along the range",
        default=0.02, unit="mm", low=0.0, above=True, source=CHOSEN,
    )  # fmt: skip
    least_scatter: float = quantity(
        "smallest scatter of how parts lie that is weighed, over the prior of a placement",
        default=1e-3, unit="1", low=0.0, above=True,
        source="far below what registration scatters; the largest is the prior itself",
    )  # fmt: skip
    scatters: int = quantity(
        "sizes of that scatter, even on a logarithmic scale",
        default=10, unit="", low=2, whole=True, source=CHOSEN,
    )  # fmt: skip
    least_offset: float = quantity(
        "smallest error of the mounting that is weighed, over the prior of a placement",
        default=0.01, unit="1", low=0.0, above=True,
        source="0.02 mm and 0.01°, as registration scatters; the largest is the prior itself",
    )  # fmt: skip
    offsets: int = quantity(
        "sizes of that error, even on a logarithmic scale",
        default=7, unit="", low=2, whole=True, source=CHOSEN,
    )  # fmt: skip
    lay_readings: int = quantity(
        "readings of a recording below which no lay is sought in it",
        default=3000, unit="", low=1, whole=True,
        source="an autocorrelation is known to 0.02",
    )  # fmt: skip
    lay_off_edges: int = quantity(
        "points beside those within reach of an edge that say nothing of a lay",
        default=4, unit="", low=1, whole=True,
        source="edges lie in one direction, and what light there leaves does: of 16 good makes of "
        "the calibration population with readings on rays 4 seemed to have one, by 15 to 34 nats, "
        "and none by more than 6 off these",
    )  # fmt: skip
    lay_directions: int = quantity(
        "directions of a lay that are tried, over half a turn",
        default=24, unit="", low=2, whole=True,
        source="the narrowest strips of neighbours meet at a wavelength of 4 pitches",
    )  # fmt: skip
    lay_widest: float = quantity(
        "standard deviation of the widest strip of a lay's spectrum, over the coarser pitch",
        default=0.12, unit="1", low=0.0, above=True,
        source="along its ridges the noise is correlated over little more than a pitch, 1 / 2πw",
    )  # fmt: skip
    lay_widths: int = quantity(
        "widths of strips, each half of the one before",
        default=3, unit="", low=1, whole=True,
        source="the narrowest is the resolution of the longest lag, 1 / 24 by three quarters",
    )  # fmt: skip
    lay_octaves: int = quantity(
        "octaves of wavelengths, from the sampling's limit, in each of which a strip has a size",
        default=3, unit="", low=1, whole=True,
        source="up to the longest lag: 24 pitches",
    )  # fmt: skip
    lay_rings: int = quantity(
        "wavelengths in an octave that are told apart whatever the direction",
        default=3, unit="", low=1, whole=True,
        source="a finish's spectrum falls off over more than one",
    )  # fmt: skip
    lay_least_change: float = quantity(
        "smallest change of an autocorrelation without a lay that is weighed",
        default=0.003, unit="1", low=0.0, above=True,
        source="what 100 000 readings show",
    )  # fmt: skip
    lay_changes: int = quantity(
        "sizes of that change, each four times the one before",
        default=5, unit="", low=1, whole=True,
        source="up to 0.77: any",
    )  # fmt: skip
    lay_reach: int = quantity(
        "lags at which autocorrelations change without a lay",
        default=6, unit="pitch", low=1, whole=True,
        source="some correlation lengths of speckle",
    )  # fmt: skip
    lay_smooth: int = quantity(
        "lags at which the nominal spectrum is cut off",
        default=12, unit="pitch", low=1, whole=True,
        source="half of those measured",
    )  # fmt: skip
    lay_least_power: float = quantity(
        "least power of the nominal spectrum, over its mean",
        default=0.02, unit="1", low=0.0, above=True,
        source="less is leakage of the cut at lay_smooth",
    )  # fmt: skip
    lay_correlated: float = quantity(
        "autocorrelation from which it counts for how far noise is drawn out",
        default=0.05, unit="1", low=0.0, high=1.0,
        source="less isn't known by 3000 readings",
    )  # fmt: skip
    least_spectrum_change: float = quantity(
        "smallest change of the noise, in octaves of both frequencies, that is weighed where no "
        "filter makes it",
        default=0.02, unit="1", low=0.0, above=True,
        source="what 100 000 readings show",
    )  # fmt: skip
    spectrum_steps: int = quantity(
        "sizes of that change, each four times the one before",
        default=4, unit="", low=1, whole=True,
        source="up to 1.28: a finish 3.6 times as rough",
    )  # fmt: skip
    strays: float = quantity(
        "share of outliers of other sizes among those of one size",
        default=0.1, unit="1", low=0.0, high=1.0, above=True, below=True,
        source="chosen; a good instrument has some, too",
    )  # fmt: skip
    one_size_sd: float = quantity(
        "standard deviation of outliers of one size, over the noise",
        default=2.0, unit="σ", low=0.0, above=True,
        source="chosen; they lie on slopes, too",
    )  # fmt: skip
    repeats: float = quantity(
        "share of profiles that repeat the one before, from which they are a fault",
        default=0.01, unit="1", low=0.0, high=1.0, source=CHOSEN,
    )  # fmt: skip
    least_steps: int = quantity(
        "steps that readings must span for a coarse step of the depth to be named",
        default=20, unit="", low=2, whole=True, source=CHOSEN,
    )  # fmt: skip
    stuck_values: int = quantity(
        "values in the other half of the counts below which no bit sticks",
        default=8, unit="", low=1, whole=True,
        source="chosen; fewer are a step that is coarser than stated",
    )  # fmt: skip
    stuck_share: float = quantity(
        "share of the readings that the part must put into the middle of the half without any",
        default=0.05, unit="1", low=0.0, high=1.0,
        source="chosen; noise moves some of them out of it, and others into it",
    )  # fmt: skip

    def slack(self) -> tuple[float, ...]:
        """Return the deviations that registration leaves: three turns, deg, three offsets, mm."""
        return (*(self.slack_deg,) * 3, *(self.slack_mm,) * 2, self.slack_range_mm)

    def lay_angles_rad(self) -> Floats:
        """Return directions of a lay."""
        return np.arange(self.lay_directions) * np.pi / self.lay_directions

    def lay_other_changes(self) -> Floats:
        """Return sizes of changes of the autocorrelation without a lay: none, and others."""
        return np.append(0.0, self.lay_least_change * 4.0 ** np.arange(self.lay_changes))

    def spectrum_changes(self) -> Floats:
        """Return sizes of changes of the noise's spectrum that no filter makes, as logarithms."""
        return np.asarray(self.least_spectrum_change * 4.0 ** np.arange(self.spectrum_steps))

    def mounting_scatters(self) -> Floats:
        """Return sizes of the scatter of how parts lie, over the prior of a placement."""
        return np.geomspace(self.least_scatter, 1.0, self.scatters)

    def mounting_offsets(self) -> Floats:
        """Return sizes of the mounting's error, over the prior of a placement: none, and others."""
        return np.append(0.0, np.geomspace(self.least_offset, 1.0, self.offsets))


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """Numbers of the evidence, and below them those of each room."""

    decay: float = quantity(
        "exponent by which longer waves are the larger in a smooth component",
        default=1.0, unit="", low=0.0,
        source="one derivative: the roughest curve whose slope is finite",
    )  # fmt: skip
    further_decay: float = quantity(
        "how much faster than by `decay` waves fall in the slower of a component's two forms",
        default=2.0, unit="", low=0.0,
        source="three derivatives: a cubic spline's",
    )  # fmt: skip
    by_law: float = quantity(
        "probability before any reading that a cause follows the catalogue's formula, where that "
        "is a curve of what the cause follows, and no other one",
        default=0.5, unit="1", low=0.0, high=1.0,
        source="as likely as not; nothing was learnt of it",
    )  # fmt: skip
    column_waves: int = quantity(
        "cosines over the line in the form of column offsets whose neighbours go together",
        default=24, unit="", low=1, whole=True,
        source="a sensor's columns in groups of eight or more",
    )  # fmt: skip
    order_1d: int = quantity(
        "highest polynomial order of a component of one covariate",
        default=6, unit="", low=1, whole=True,
        source="more orders are smaller than the noise under the decay",
    )  # fmt: skip
    order_2d: int = quantity(
        "the same for two covariates",
        default=5, unit="", low=1, whole=True,
        source="as order_1d",
    )  # fmt: skip
    harmonics: int = quantity(
        "harmonics of what repeats with the camera's rows or with the travel",
        default=3, unit="", low=1, whole=True,
        source="inference: a sawtooth's fourth harmonic has 6 % of its power",
    )  # fmt: skip
    envelope: int = quantity(
        "polynomial order of an oscillation's slow change",
        default=8, unit="", low=1, whole=True,
        source="knocks that ring: decays within a fifth of a recording",
    )  # fmt: skip
    band_step: float = quantity(
        "step of the frequencies tried, over the longest recording",
        default=0.5, unit="cycles", low=0.0,
        source="half the resolution of a recording",
    )  # fmt: skip
    least_cycles: float = quantity(
        "fewest cycles in a recording that count as an oscillation",
        default=2.5, unit="cycles", low=0.0,
        source="fewer are a drift or the part's form",
    )  # fmt: skip
    pitches: int = quantity(
        "strongest periods over the range that are weighed, each in three positions",
        default=2, unit="", low=1, whole=True,
        source="a second one for a harmonic that is stronger than its fundamental",
    )  # fmt: skip
    range_beyond: float = quantity(
        "how far a covariate's range reaches beyond 96 % of its values, over what these span",
        default=0.25, unit="1", low=0.0,
        source="uniform values end there; the tails of others count as their ends",
    )  # fmt: skip
    periods_tried: int = quantity(
        "periods over the range that are looked at to pick those",
        default=400, unit="", low=1, whole=True,
        source="cycles over the readings' span, in halves, to two camera rows",
    )  # fmt: skip
    most_columns: int = quantity(
        "columns, or groups of neighbouring columns, with an offset of their own",
        default=512, unit="", low=1, whole=True,
        source="time and memory of the equations",
    )  # fmt: skip
    spanned: int = quantity(
        "main directions kept of what a law does over its grid",
        default=3, unit="", low=1, whole=True,
        source="the widths of a line differ in little more",
    )  # fmt: skip
    prior_cause: float = quantity(
        "probability of each catalogued cause before any reading",
        default=0.05, unit="", low=0.0,
        source="by convention: about one of 25 causes where somebody asks",
    )  # fmt: skip
    prior_unknown: float = quantity(
        "probability of each unknown component before any reading",
        default=0.005, unit="", low=0.0,
        source="by convention: a tenth of a catalogued cause's",
    )  # fmt: skip
    second_mechanism: float = quantity(
        "probability that a cause in a channel in which unknown physics is left is a second "
        "mechanism, not the unknown one",
        default=0.25, unit="1", low=0.0, high=1.0,
        source="calibration sets, sealed ones that were opened among them: 2 of the 10 names so "
        "given were right (Laplace's rule of succession)",
    )  # fmt: skip
    least_mean_size: float = quantity(
        "smallest whitened rms of the grid of sizes",
        default=0.001, unit="1", low=0.0,
        source="signal to noise 0.2 in 40 000 readings: nothing",
    )  # fmt: skip
    mean_steps: int = quantity(
        "sizes of the grid, each twice the one before",
        default=15, unit="", low=1, whole=True,
        source="up to 16 times the noise",
    )  # fmt: skip
    least_rate_size: float = quantity(
        "smallest rms change in the other channels, of the noise's logarithm and of twice the root "
        "of the share of losses or outliers",
        default=0.00125, unit="1", low=0.0,
        source="signal to noise 0.35 in 40,000 readings: nothing",
    )  # fmt: skip
    rate_steps: int = quantity(
        "sizes of that grid, each twice the one before",
        default=13, unit="", low=1, whole=True,
        source="up to a factor exp(5) of the noise; all readings are lost at a change of 2",
    )  # fmt: skip
    small_sizes: int = quantity(
        "smallest sizes of the grid that a component unknown to the population may have",
        default=3, unit="", low=1, whole=True,
        source="nothing is known of it: none",
    )  # fmt: skip
    most_instruments: float = quantity(
        "share of good instruments whose discrepancy is presumed of a component that isn't weighed",
        default=0.5, unit="1", low=0.0,
        source="by convention",
    )  # fmt: skip
    stands_out: float = quantity(
        "evidence from which what a good instrument has is more than chance",
        default=1.0, unit="nats", low=0.0,
        source="by convention: e times as probable as none",
    )  # fmt: skip
    doubt: float = quantity(
        "share of an explained signal by which its law may be wrong",
        default=0.03, unit="1", low=0.0,
        source="by convention; what a curve leaves passes for another cause otherwise",
    )  # fmt: skip
    doubt_at_edges: float = quantity(
        "the same for laws of light at edges",
        default=0.7, unit="1", low=0.0,
        source="two laws of one cause differ there by most of its size (calibration cases)",
    )  # fmt: skip
    doubt_of_laws: float = quantity(
        "share of a law's gain by which the right one of another formula may fall short",
        default=0.1, unit="1", low=0.0,
        source="blurs by two formulas, fitted by laws of three causes (calibration cases)",
    )  # fmt: skip
    doubt_of_rates: float = quantity(
        "the same for the change of the noise and of the losses",
        default=0.1, unit="1", low=0.0,
        source="laws of noise and of lost light are good to a tenth at best",
    )  # fmt: skip
    clip: float = quantity(
        "deviations beyond which a reading counts as that far off",
        default=4.0, unit="σ", low=0.0,
        source="Huber: 0.006 % of Gaussian readings",
    )  # fmt: skip
    long_waves: tuple[float, ...] = quantity(
        "from how many to how many waves a patch has where the noise is asked for power that "
        "whitening leaves",
        default=(2.0, 5.0), unit="cycles", low=0.0,
        source="those of a smooth component of order 5, but for the longest: a law's remainder",
    )  # fmt: skip
    least_waves: int = quantity(
        "waves of that length below which nothing is told of their power",
        default=20, unit="", low=1, whole=True,
        source="chosen; the median of so many is known to a third",
    )  # fmt: skip
    claimed_level: float = quantity(
        "change of the noise's logarithm by which a claimed surface is usually off",
        default=0.05, unit="1", low=0.0,
        source="Ra is stated to a tenth, and speckle follows its root at most",
    )  # fmt: skip
    sharp: float = quantity(
        "doubt of an edge's place beyond which a reading says nothing of the noise",
        default=0.3, unit="σ", low=0.0,
        source="in quadrature, adds 4 % to the standard deviation of the noise",
    )  # fmt: skip
    ambiguous: float = quantity(
        "chance of an edge's other side beyond which a reading's absence says nothing",
        default=0.01, unit="1", low=0.0,
        source="a tenth of the smallest share worth telling",
    )  # fmt: skip
    imitated: float = quantity(
        "whitened square, per reading or as a share of a column's own, below which a placement "
        "imitates a component or coefficient",
        default=1e-6, unit="1", low=0.0,
        source="rounding of the normal equations",
    )  # fmt: skip
    cells: int = quantity(
        "cells along each covariate in which readings of one predictor are summed",
        default=32, unit="", low=1, whole=True,
        source="a component's waves span eight and more",
    )  # fmt: skip
    least_readings: int = quantity(
        "readings of a channel below which it isn't looked at",
        default=200, unit="", low=1, whole=True,
        source="expected events: none",
    )  # fmt: skip
    largest_clump: float = quantity(
        "readings of one clump of losses or outliers that count as one event at most",
        default=12.0, unit="", low=0.0,
        source="as many as a grain of dust hides; a shadow is more",
    )  # fmt: skip
    level_sd_off: float = quantity(
        "deviation of a good instrument's share of losses and outliers, of that share",
        default=0.2, unit="1", low=0.0,
        source="by convention: known to a fifth; the population says the rest",
    )  # fmt: skip
    level_sd_edge: float = quantity(
        "deviation of twice the root of that share at depth edges, where no law is exact",
        default=1.0, unit="1", low=0.0,
        source="any: a root is one at most",
    )  # fmt: skip
    reported: float = quantity(
        "probability from which a cause is reported",
        default=0.5, unit="1", low=0.0,
        source="more likely than not",
    )  # fmt: skip
    offered: float = quantity(
        "probability from which an alternative is offered",
        default=0.05, unit="1", low=0.0,
        source="by convention",
    )  # fmt: skip
    most_causes: int = quantity(
        "causes of a set",
        default=6, unit="", low=1, whole=True,
        source="more need other recordings",
    )  # fmt: skip
    rounds: int = quantity(
        "laws, and curves of what they leave, that are fitted one after the other",
        default=12, unit="", low=1, whole=True,
        source="twice most_causes",
    )  # fmt: skip
    fitted_readings: int = quantity(
        "readings on which laws are searched; linear parts are solved on all",
        default=80000, unit="", low=1, whole=True,
        source="time",
    )  # fmt: skip
    explained_share: float = quantity(
        "share of its component's evidence below which a law is doubted",
        default=0.3, unit="1", low=0.0,
        source="by convention",
    )  # fmt: skip
    assumed_angles_deg: tuple[float, ...] = quantity(
        "triangulation angles tried where the sensor's file states none",
        default=(20.0, 30.0, 40.0), unit="deg", low=0.0, high=90.0,
        source="what makers sell",
    )  # fmt: skip
    predict: PredictSettings = PredictSettings()
    noise: NoiseSettings = NoiseSettings()
    register: RegisterSettings = RegisterSettings()
    data: DataSettings = DataSettings()
    components: ComponentsSettings = ComponentsSettings()
    model: ModelSettings = ModelSettings()
    reregister: ReregisterSettings = ReregisterSettings()
    physics: PhysicsSettings = PhysicsSettings()
    validate: ValidateSettings = ValidateSettings()
    localise: LocaliseSettings = LocaliseSettings()
    claims: ClaimsSettings = ClaimsSettings()

    def as_json(self) -> dict[str, object]:
        """Return every number for diagnosis.json, and what is known about each."""
        return {**asdict(self), "provenance": provenance(self)}

    def mean_sizes(self) -> Floats:
        """Grid of sizes (whitened rms) of the mean's components."""
        return np.asarray(self.least_mean_size * 2.0 ** np.arange(self.mean_steps))

    def rate_sizes(self) -> Floats:
        """Grid of sizes of the linear predictor's change in the other channels."""
        return np.asarray(self.least_rate_size * 2.0 ** np.arange(self.rate_steps))

    def log_odds(self, effect: str) -> float:
        """Log odds of a cause before any reading."""
        p = self.prior_cause if effect else self.prior_unknown
        return float(np.log(p / (1 - p)))

    def probability(self, nats: float, effect: str) -> float:
        """Probability of a cause from its log Bayes factor and its odds before any reading."""
        return float(expit(nats + self.log_odds(effect)))

    def orders(self, dimensions: int) -> tuple[int, ...]:
        """Highest order along each covariate."""
        return (self.order_1d,) if dimensions == 1 else (self.order_2d,) * dimensions


def provenance(record: Any) -> dict[str, object]:
    """Meaning, unit and source of every number of a record, those of its rooms nested alike."""
    known: dict[str, object] = {
        q.name: {"meaning": q.meaning, "unit": q.unit, "source": q.source}
        for q in quantities(type(record))
    }
    rooms = {f.name: getattr(record, f.name) for f in fields(record)}
    return known | {name: provenance(room) for name, room in rooms.items() if is_dataclass(room)}


SETTINGS = Settings()
