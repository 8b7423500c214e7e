"""The report's pictures, as PNG bytes."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.diagnose import Diagnosis
from diagnosis.found import FoundEffect
from diagnosis.noise import Field, Mask
from diagnosis.workspace import Workspace
from files.errors import RecipeError
from sensors.view.covariates import COVARIATES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#22303c"
BEFORE = "#c2452d"
AFTER = "#1f6f8b"


def _figure(width: float, height: float, columns: int = 1) -> tuple["Figure", Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for axis in axes:
        axis.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
    return figure, axes


def _png(figure: "Figure") -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def mismatch_map(result: Diagnosis) -> bytes:
    """Depth, and where it departs, of the recording with the largest mismatch."""
    maps = max(result.maps, key=lambda m: m.mask.mean())
    step = (max(1, maps.mask.shape[0] // 500), max(1, maps.mask.shape[1] // 700))
    thin = (slice(None, None, step[0]), slice(None, None, step[1]))
    figure, (axis,) = _figure(5.6, 3.6)
    extent = (0, maps.mask.shape[1], maps.mask.shape[0], 0)
    shown = axis.imshow(maps.depth_mm[thin], aspect="auto", cmap="Greys", extent=extent)
    figure.colorbar(shown, ax=axis, label="depth, mm", shrink=0.85)
    if maps.mask.any():
        overlay = np.zeros((*maps.mask[thin].shape, 4))
        overlay[maps.mask[thin]] = (0.76, 0.27, 0.18, 0.45)
        axis.imshow(overlay, aspect="auto", extent=extent, interpolation="nearest")
    title = f"{maps.name}\ndepth; red where it departs from the nominal model"
    axis.set_title(title, fontsize=9, parse_math=False)  # a file's name is no formula
    axis.set_xlabel("point", fontsize=8)
    axis.set_ylabel("profile", fontsize=8)
    return _png(figure)


def residual_maps(result: Diagnosis) -> bytes:
    """Residuals of the recording with the largest mismatch, before and after, at one scale."""
    maps = max(result.maps, key=lambda m: m.mask.mean())
    step = (max(1, maps.mask.shape[0] // 500), max(1, maps.mask.shape[1] // 700))
    thin = (slice(None, None, step[0]), slice(None, None, step[1]))
    pair = [1e3 * (maps.depth_mm - m)[thin] for m in (maps.simulated, maps.explained)]
    known = np.abs(pair[0][np.isfinite(pair[0])])
    limit = float(np.quantile(known, 0.97)) if known.size else 1.0
    figure, axes = _figure(10.5, 3.6, 2)
    extent = (0, maps.mask.shape[1], maps.mask.shape[0], 0)
    for axis, residual, words in zip(
        axes, pair, ("nominal model", "with the effects found"), strict=True
    ):
        shown = axis.imshow(
            residual, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent,
            interpolation="nearest",
        )  # fmt: skip
        axis.set_title(f"residual, {words}", fontsize=9)
        axis.set_xlabel("point", fontsize=8)
        axis.set_ylabel("profile", fontsize=8)
    figure.colorbar(shown, ax=list(axes), label="reading - expectation, µm", shrink=0.85)
    return _png(figure)


def covariate_picture(result: Diagnosis, found: FoundEffect) -> bytes | None:
    """Residual against an effect's covariate, with the fitted curve; None where neither shows."""
    ws = Workspace.build(result.fit_patches, result.noise)
    rest = result.model.without(found.name)
    predictions = ws.predict(rest)
    states = ws.states(predictions)
    final = ws.predict(result.model)
    values, residuals, curves, missing, lost, squares, spread = [], [], [], [], [], [], []
    covariate = COVARIATES[found.covariate_key]
    own = found.effect.covariate == found.covariate_key
    values_of = found.effect.covariate_values if own else covariate.values
    try:
        values_of(ws.patches[0].view)
    except RecipeError:
        return None  # a camera that the sensor's file doesn't state
    for patch, before, after, state in zip(ws.patches, predictions, final, states, strict=True):
        c = np.broadcast_to(values_of(patch.view), patch.shape)
        use = state.used & np.isfinite(c) & patch.fit
        moved = _pose_part(patch.columns, state.residual_mm, state.used)
        values.append(c[use])
        residuals.append((state.residual_mm - moved)[use])
        change = np.nan_to_num(after.mean_mm - before.mean_mm)
        pose_change = _pose_part(patch.columns, change, state.used & after.seen)
        curves.append((change - pose_change)[use])
        spread.append((after.sd_mm * result.model.level)[use])
        squares.append(np.abs(state.residual_mm - moved)[use])
        seen = before.seen & np.isfinite(c) & patch.fit
        missing.append(np.stack([c[seen], (~patch.observed)[seen].astype(float)]))
        lost.append(after.p_missing[seen])
    x = np.concatenate(values)
    figure, (axis,) = _figure(5.2, 3.3)
    if "mean" in found.effect.channels:
        y, fit = 1e3 * np.concatenate(residuals), 1e3 * np.concatenate(curves)
        if x.size < 50 or np.ptp(x) == 0:
            return None
        centre, mean, low, high = _binned(x, y)
        _, model, _, _ = _binned(x, fit)
        pick = np.random.default_rng(0).permutation(x.size)[:3000]
        axis.plot(x[pick], y[pick], ".", ms=1, color="#b9c2c9", rasterized=True)
        axis.errorbar(centre, mean, yerr=[mean - low, high - mean], fmt="o", ms=3, color=INK, lw=1,
                      label="recordings, mean of a bin")  # fmt: skip
        axis.plot(centre, model, "-", color=BEFORE, lw=2, label=f"fitted {found.name}")
        reach = max(np.nanmax(np.abs(mean)), np.nanmax(np.abs(model)), np.quantile(np.abs(y), 0.8))
        axis.set_ylim(-2.2 * reach, 2.2 * reach)
        axis.set_ylabel("residual, µm", fontsize=8)
    elif "missing" in found.effect.channels:
        both = np.concatenate(missing, axis=1)
        p = np.concatenate(lost)
        if np.ptp(both[0]) == 0:
            return None
        centre, mean, low, high = _binned(both[0], both[1])
        _, model, _, _ = _binned(both[0], p)
        axis.plot(centre, 100 * mean, "o", ms=4, color=INK, label="recordings")
        axis.plot(centre, 100 * model, "-", color=BEFORE, lw=2, label=f"fitted {found.name}")
        axis.set_ylabel("missing, %", fontsize=8)
    else:
        if x.size < 50 or np.ptp(x) == 0:
            return None
        y = 1e3 * np.concatenate(squares) * np.sqrt(np.pi / 2)
        centre, mean, low, high = _binned(x, y)
        _, model, _, _ = _binned(x, 1e3 * np.concatenate(spread))
        axis.errorbar(centre, mean, yerr=[mean - low, high - mean], fmt="o", ms=3, color=INK, lw=1,
                      label="recordings")  # fmt: skip
        axis.plot(centre, model, "-", color=BEFORE, lw=2, label=f"fitted {found.name}")
        axis.set_ylabel("noise of a reading, µm", fontsize=8)
    unit = f", {covariate.unit}" if covariate.unit else ""
    axis.set_xlabel(f"{covariate.words}{unit}", fontsize=8)
    axis.legend(fontsize=7, frameon=False)
    return _png(figure)


def profile_picture(result: Diagnosis) -> bytes | None:
    """Before and after on a held-out profile, and the distribution of what is left."""
    best = None
    left_mm = [
        np.concatenate([r[np.isfinite(r)] for r in judged.residuals_mm])
        for judged in (result.before, result.after)
    ]
    every = np.abs(np.concatenate(left_mm))
    if not every.size:
        return None
    # a few readings from elsewhere, at a step's foot, are no scale for the others
    reach = max(10 * result.noise.sd_mm, 1.4 * float(np.quantile(every, 0.98)))
    for k, (before, after) in enumerate(
        zip(result.before.residuals_mm, result.after.residuals_mm, strict=True)
    ):
        with np.errstate(invalid="ignore"):
            saved = np.clip(before, -reach, reach) ** 2 - np.clip(after, -reach, reach) ** 2
            gain = np.nansum(saved, axis=1)
        full = np.isfinite(before).sum(axis=1)
        if full.max() == 0:
            continue
        gain[full < 0.5 * full.max()] = -np.inf
        row = int(np.argmax(gain))
        if best is None or gain[row] > best[0]:
            best = (float(gain[row]), k, row)
    if best is None:
        return None
    _, k, row = best
    patch = result.held_patches[k]
    figure, (left, right) = _figure(10.5, 3.0, 2)
    x = patch.view.column_x_mm
    for judged, values_mm, colour, word in (
        (result.before, left_mm[0], BEFORE, "plain simulation"),
        (result.after, left_mm[1], AFTER, "with the effects found"),
    ):
        near = 1e3 * np.clip(judged.residuals_mm[k][row], -reach, reach)
        left.plot(x, near, ".", ms=2.5, color=colour, label=word)
        values = values_mm * 1e3
        limit = 4 * 1e3 * result.noise.sd_mm
        limit = max(limit, float(np.quantile(np.abs(values), 0.98)))
        right.hist(
            values, bins=90, range=(-limit, limit), histtype="step", color=colour, label=word
        )
    left.set_ylim(-1.05e3 * reach, 1.05e3 * reach)
    left.axhline(0, color="#b9c2c9", lw=0.8, zorder=0)
    left.set_xlabel("x, mm", fontsize=8)
    left.set_ylabel("reading - expectation, µm", fontsize=8)
    title = f"held out: {patch.name}\nprofile {patch.rows.start + row}"
    left.set_title(title, fontsize=9, parse_math=False)
    left.legend(fontsize=7, frameon=False)
    right.set_xlabel("reading - expectation, µm", fontsize=8)
    right.set_yticks([])
    right.set_title("all held-out readings", fontsize=9)
    right.legend(fontsize=7, frameon=False)
    return _png(figure)


def _pose_part(columns: Field, field: Field, used: Mask) -> Field:
    """Fit the part of a field that a placement takes up."""
    flat, values = columns[used], field[used]
    step = max(1, len(values) // 20000)
    solved, *_ = np.linalg.lstsq(flat[::step], values[::step], rcond=1e-6)
    return np.asarray(columns @ solved)


def _binned(x: Field, y: Field, bins: int = 24) -> tuple[Field, Field, Field, Field]:
    edges = np.unique(
        0.5 * np.quantile(x, np.linspace(0, 1, bins + 1))
        + 0.5 * np.linspace(x.min(), x.max(), bins + 1)
    )
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(which, minlength=edges.size - 1)
    kept = count > 5
    mean = np.bincount(which, weights=y, minlength=edges.size - 1)[kept] / count[kept]
    square = np.bincount(which, weights=y * y, minlength=edges.size - 1)[kept] / count[kept]
    error = 2 * np.sqrt(np.maximum(square - mean**2, 0) / count[kept])
    centre = np.bincount(which, weights=x, minlength=edges.size - 1)[kept] / count[kept]
    return centre, mean, mean - error, mean + error
