"""Make docs/effects.md and its pictures from the code of the catalogue.

A picture holds a digest of the parameters that it was drawn with, see `stamp`. With --text the
pictures are left as they are; names of effects draw those alone.
"""

import argparse
import dataclasses
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE, AdditiveEffect, Effect, MotionEffect, Parameter
from sensors.law import Law, geometric_law
from sensors.model import SensorModel
from sensors.noise.perlin import PerlinField
from sensors.surface.reflectance import Patch, ReflectanceMap, Stripes
from sensors.view.covariates import COVARIATES
from sensors.view.view import View

HERE = Path(__file__).resolve().parent
SHEET = Datasheet(
    name="demonstration",
    working_distance_mm=200.0,
    z_range_mm=100.0,
    x_fov_mm=64.0,
    points_per_profile=256,
    z_resolution_um=2.0,
    repeatability_um=1.0,
    profile_rate_hz=400.0,
    columns="even_x",
    triangulation_angle_deg=30.0,
    line_width_um=1200.0,
    exposure_s=0.0005,
    camera_rows=256,
)
SPECKLE = PerlinField(amplitude_mm=0.04, cell_x_mm=1.0, cell_y_mm=1.0)
# Values at which a signature can be seen at this scale; typical ones elsewhere.
SHOWN: dict[str, dict[str, Any]] = {
    "finite_spot": {"line_sd_um": 300.0},
    "edge_mixing": {"line_sd_um": 300.0, "merge_um": 2000.0},
    "reflectance_edge": {"line_sd_um": 300.0},
    "motion_blur": {"exposure_ms": 5.0},
    "incidence_noise": {"exponent": 2.0},
    "thermal_drift": {"time_constant_s": 0.3},
    "travel_ripple": {"period_mm": 8.0},
    "pixel_locking": {"amplitude_px": 0.1, "rows": 256.0},
    "specular_dropout": {"lobe_deg": 10.0},
    "outlier_spikes": {"share": 0.02},
    "random_dropout": {"share": 0.05, "patch_mm": 2.0},
    "empirical": {"knots": (185.0, 200.0, 205.0), "values": (0.0, 50.0, -50.0)},
    "axis_quantisation": {"step_um": 40.0},
    "lateral_error": {"scale_um": 200.0},
    "column_offset": {"rms_um": 4.0, "values_um": (0.0, 8.0, -4.0, 6.0, 0.0)},
}
PLOTTED = {  # covariates that show the effect better on this part
    "camera_occlusion": "edge_y",
    "finite_spot": "edge_y",
    "motion_blur": "edge_y",
    "edge_mixing": "edge_y",
    "reflectance_edge": "part_y",
    "form_error": "part_y",
    "pose_error": "x",
    "travel_ripple": "travel",
    "row_repeat": "slope_y",
}
CLIPPED = {"lateral_error", "row_repeat"}  # edges would dwarf what slopes show
TURNED_DEG = {"lateral_error": 35.0}  # the part has slopes along the travel alone


def demonstration(turned_deg: float = 0.0) -> View:
    """Scan a tile with a groove, a round bar, a block, a ramp and an albedo pattern; turned."""
    tile = trimesh.creation.box((70.0, 70.0, 20.0))
    tile.apply_translation((0.0, 0.0, -10.0))
    groove = trimesh.creation.box((80.0, 9.0, 9.0))
    groove.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 4, (1, 0, 0)))
    groove.apply_translation((0.0, -18.0, 0.0))
    bar = trimesh.creation.cylinder(radius=10.0, height=60.0, sections=720)
    bar.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, (0, 1, 0)))
    bar.apply_translation((0.0, -2.0, -6.0))
    block = trimesh.creation.box((24.0, 8.0, 8.0))
    block.apply_translation((16.0, 20.0, 1.0))
    ramp = trimesh.creation.box((24.0, 14.0, 14.0))
    ramp.apply_transform(trimesh.transformations.rotation_matrix(math.radians(15), (1, 0, 0)))
    ramp.apply_translation((-16.0, 20.0, -4.5))
    solid = trimesh.boolean.difference([tile, groove], engine="manifold")
    solid = trimesh.boolean.union([solid, bar, block, ramp], engine="manifold")
    n = 256
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = np.diag([-1.0, 1.0, -1.0])
    poses[:, 1, 3] = np.linspace(-32.0, 32.0, n) + 0.013
    poses[:, 2, 3] = 200.0
    turn = trimesh.transformations.rotation_matrix(math.radians(turned_deg), (0, 0, 1))
    solid.apply_transform(turn)
    bright = ReflectanceMap(
        base=0.8,
        stripes=(Stripes(value=0.2, period_mm=16.0, across="x", duty=0.25),),
        patches=(Patch(value=0.15, x_mm=(-30.0, 30.0), y_mm=(9.0, 12.0)),),
    )
    scene = Scene(solid.vertices, solid.faces)
    return View(scene, SensorModel(SHEET), poses, np.arange(n) / 400.0, reflectance=bright)


def shown(name: str) -> Effect:
    """Return the effect with the values that its picture has."""
    return CATALOGUE[name].example().with_parameters(SHOWN.get(name, {}))


STAMP = "Parameters"
"""Key of the digest in a picture's metadata."""


def stamp(name: str) -> str:
    """Return a digest of what the picture of an effect shows: parameters, equation, scan, axes."""
    cls = CATALOGUE[name]
    facts = {
        "effect": shown(name).to_mapping(),
        "equation": cls.equation,
        "channels": cls.channels,
        "sensor": _given(SHEET),
        "speckle": _given(SPECKLE),
        "turned_deg": TURNED_DEG.get(name, 0.0),
        "covariate": PLOTTED.get(name, cls.covariate),
        "clipped": name in CLIPPED,
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _given(record: Any) -> dict[str, Any]:
    """Fields of a record that aren't at their defaults: a new field changes no digest."""
    values = {f.name: (getattr(record, f.name), f.default) for f in dataclasses.fields(record)}
    return {name: value for name, (value, default) in values.items() if value != default}


def draw(name: str, view: View) -> None:
    """Write the picture of one effect's signature."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    bare = geometric_law(view, SPECKLE)
    law = shown(name).apply(bare, view)
    change = 1e3 * (law.mean_mm - bare.mean_mm)
    moved = "mean" in CATALOGUE[name].channels and np.nanmax(np.abs(change)) > 0
    only_mean = moved and law.delivery is None
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(8.2, 2.9), width_ratios=(1, 1.35), layout="constrained"
    )
    extent = (0, view.shape[1], view.shape[0], 0)
    if only_mean:
        top = max(float(np.nanpercentile(np.abs(change), 99.7)), 1e-3)
        image = left.imshow(change, cmap="RdBu", vmin=-top, vmax=top, extent=extent)
        figure.colorbar(image, ax=left, label="change of mean (µm)")
    else:
        residual = 1e3 * (law.sample(_streams, view)[0] - view.depth_mm)
        top = 1e3 * 3 * float(np.median(bare.sd_mm(view)))
        image = left.imshow(residual, cmap="RdBu", vmin=-top, vmax=top, extent=extent)
        figure.colorbar(image, ax=left, label="reading - geometry (µm)")
    lost = np.isnan(law.mean_mm) & view.in_range
    if not only_mean:
        lost |= np.isnan(residual) & view.in_range
    if lost.any():
        red = np.zeros((*view.shape, 4))
        red[lost] = (0.0, 0.0, 0.0, 1.0)
        left.imshow(red, extent=extent)
    left.set_xlabel("point")
    left.set_ylabel("profile")
    _plot(right, name, view, bare, law)
    path = HERE / f"{name}.png"
    figure.savefig(path, dpi=80)
    plt.close(figure)
    facts = PngInfo()
    facts.add_text(STAMP, stamp(name))
    with Image.open(path) as picture:  # a palette keeps the file small
        picture.convert("RGB").quantize(96).save(path, optimize=True, pnginfo=facts)


def _plot(axes: Any, name: str, view: View, bare: Law, law: Law) -> None:
    if name in ("anisotropic_lay", "onboard_filter", "outlier_spikes"):
        one, two = (1e3 * (each.sample(_streams, view)[0] - view.depth_mm) for each in (bare, law))
        if name == "outlier_spikes":
            bins = np.linspace(-800, 800, 161)
            for values, label in ((one, "without"), (two, "with")):
                axes.hist(values[view.in_range], bins, histtype="step", label=label, log=True)
            axes.set_xlabel("reading - geometry (µm)")
            axes.set_ylabel("readings")
        else:
            rows, columns = slice(2, 28), slice(100, 170)  # flat: no gaps, no edges
            for values, label, style in ((one, "without", "--"), (two, "with", "-")):
                for axis, way in ((1, "along x"), (0, "along y")):
                    lags = np.arange(12)
                    patch = np.where(np.isnan(values), 0.0, values)[rows, columns]
                    correlation = [_correlation(patch, lag, axis) for lag in lags]
                    axes.plot(lags * 0.25, correlation, style, label=f"{label}, {way}")
            axes.set_xlabel("distance (mm)")
            axes.set_ylabel("correlation")
        axes.legend(fontsize=8)
        return
    covariate = COVARIATES[PLOTTED.get(name, CATALOGUE[name].covariate)]
    values = np.broadcast_to(covariate.values(view), view.shape)
    scale, unit = (180 / math.pi, "°") if covariate.unit == "rad" else (1.0, covariate.unit)
    axes.set_xlabel(f"{covariate.words}{f' ({unit})' if unit else ''}", fontsize=9)
    change = 1e3 * (law.mean_mm - bare.mean_mm)
    if "mean" in CATALOGUE[name].channels and np.nanmax(np.abs(change)) > 0:
        known = np.isfinite(change) & np.isfinite(values)
        step = max(1, known.sum() // 6000)
        axes.plot(scale * values[known][::step], change[known][::step], ".", ms=2)
        axes.set_ylabel("change of mean (µm)")
        if name in CLIPPED:
            top = 1.3 * float(np.percentile(np.abs(change[known]), 99))
            axes.set_ylim(-top, top)
        return
    if "missing" in CATALOGUE[name].channels:
        quantity = np.where(np.isnan(law.mean_mm), 1.0, law.p_missing)
        axes.set_ylabel("probability of a missing reading")
    else:
        quantity, reference = (
            1e3 * np.hypot(each.sd_mm(view), each.step_mm / math.sqrt(12)) for each in (law, bare)
        )
        axes.set_ylabel("standard deviation (µm)")
        known = view.in_range & np.isfinite(values)
        order = np.argsort(values[known])[:: max(1, known.sum() // 500)]
        x = scale * values[known][order]
        axes.plot(x, reference[known][order], "--", color="grey", label="without")
    known = view.in_range & np.isfinite(values)
    step = max(1, known.sum() // 6000)
    axes.plot(scale * values[known][::step], quantity[known][::step], ".", ms=2, label="with")
    axes.set_ylim(bottom=0)


def _correlation(patch: Any, lag: int, axis: int) -> float:
    size = patch.shape[axis]
    one = np.take(patch, range(size - lag), axis=axis).ravel()
    two = np.take(patch, range(lag, size), axis=axis).ravel()
    return float(np.corrcoef(one, two)[0, 1])


def _streams(name: str) -> np.random.Generator:
    return np.random.default_rng([7, *map(ord, name)])


def text() -> str:
    """Return docs/effects.md."""
    lines = [
        "# The catalogue of effects",
        "",
        "Made by `make effects` from `sensors/effects/`; do not edit.",
        "",
        "An effect changes the predictive distribution of a reading: its mean depth, standard",
        "deviation, correlation, probability of a missing reading, or tails. A sensor's `effects`",
        "lists the effects of a simulation. A diagnosis writes the effects that it finds in the",
        "same form. An omitted parameter has the default of its table: a typical value, or a key",
        "of the sensor's file. A parameter of a *recording* is drawn uniformly for each scan.",
        "",
        "```yaml",
        "effects:",
        "- name: camera_occlusion",
        "- name: stage_vibration",
        "  amplitude_um: 8.0",
        "  frequency_hz: 31.0",
        "```",
        "",
        "Effects that move the sensor or its rays (`pose_error`, `travel_ripple`, `lateral_error`)",
        "act first, whatever their place in the list, because shadows and edges move, too. Effects",
        "of the firmware (`onboard_filter`, `row_repeat`) act last, on whole profiles. The others",
        "act in the order of the list.",
        "",
        "`finite_spot`, `edge_mixing`, `reflectance_edge` and `motion_blur` share one operator",
        "(`sensors/line/line_operator.py`). The operator scans the part at sub-lines of the",
        "laser's width and computes the centroid: nothing is linearised at edges. For a line that",
        "moves or whose width has increased, light below the peak finder's threshold is lost",
        "(`weakest` of the listed `camera_occlusion`, `sensors/line/peak_finder.py`): a steep wall",
        "spreads its light over many camera rows.",
        "",
        "| effect | changes | fixed in the frame of | depends on | confounded with |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, cls in CATALOGUE.items():
        rivals = ", ".join(f"[{rival}](#{rival})" for rival in cls.rivals)
        lines.append(
            f"| [{name}](#{name}) "
            f"| {', '.join((*cls.channels, *cls.secondary_channels))} | {cls.frame} "
            f"| {COVARIATES[cls.covariate].words} | {rivals} |"
        )
    for name in CATALOGUE:
        lines += _section(name)
    return "\n".join(lines) + "\n"


def _section(name: str) -> list[str]:
    cls = CATALOGUE[name]
    kind = "fitted" if issubclass(cls, AdditiveEffect) else "computed"
    if issubclass(cls, MotionEffect):
        kind = "moved"
    how = {
        "fitted": "The mean is linear in the parameters marked *linear*.",
        "moved": "The part is scanned from the true poses.",
        "computed": "",
    }[kind]
    needs = f"Requires `{'`, `'.join(cls.needs)}` in the sensor's file." if cls.needs else ""
    values = ", ".join(f"{key} {_short(value)}" for key, value in SHOWN.get(name, {}).items())
    return [
        "",
        f"## {name}",
        "",
        cls.summary + (f" {how}" if how else "") + (f" {needs}" if needs else ""),
        "",
        f"    {cls.equation}",
        "",
        f"Source: {cls.source}.",
        "",
        f"Separating measurement: {cls.separating}.",
        "",
        "| parameter | meaning | allowed | typical | default | belongs to | linear |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(_row(cls, p) for p in cls.parameters()),
        "",
        f"![signature of {name}](effects/{name}.png)",
        "",
        f"*Shown with {values + ', else ' if values else ''}typical values.*",
    ]


def _row(cls: type[Effect], p: Parameter) -> str:
    default = getattr(cls(), p.name)
    if p.sheet:
        left_out = f"the sensor's `{p.sheet}`"
    elif p.owner == "recording":
        low, high = p.prior or (0.0, 0.0)
        left_out = f"drawn, {low:g} to {high:g}"
    else:
        left_out = _short(default)
    return (
        f"| `{p.name}` | {p.meaning} | {p.bounds_text} | {_short(p.typical)} | {left_out} "
        f"| {p.owner} | {'yes' if p.linear else ''} |"
    )


def _short(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(f"{v:g}" for v in value) + "]"
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


def main() -> None:
    """Write the page, and the pictures unless told not to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--text", action="store_true", help="leave the pictures as they are")
    parser.add_argument("names", nargs="*", help="effects to draw; all where none is named")
    wanted = parser.parse_args()
    (HERE.parent / "effects.md").write_text(text(), encoding="utf-8")
    if not wanted.text:
        view = demonstration()
        for name in wanted.names or CATALOGUE:
            turned = TURNED_DEG.get(name)
            draw(name, view if turned is None else demonstration(turned))


if __name__ == "__main__":
    main()
