"""One self-contained page that a process engineer reads in two minutes."""

import base64
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from diagnosis.diagnosis import Diagnosis
from diagnosis.localise.regions import Region
from diagnosis.localise.residual_structure import Residual
from diagnosis.physics.uncertainty import Estimate
from diagnosis.report.covariate_picture import covariate_picture
from diagnosis.report.map_pictures import mismatch_map, moves_expectation, residual_maps
from diagnosis.report.move_picture import TAKEN_UP, is_taken_up, move_picture
from diagnosis.report.profile_picture import profile_picture
from diagnosis.report.scan_pictures import scan_pictures
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect
from files.whole_file import write_whole

VERDICTS = {
    "match": "The nominal model explains the recordings.",
    "explained": "The recordings differ from the nominal model. What was found explains the "
    "difference.",
    "partly_explained": "The recordings differ from the nominal model. What was found explains "
    "part of the difference; residual structure remains.",
    "unexplained": "The recordings differ from the nominal model, and no catalogued effect "
    "explains the difference.",
}
CHECK = {
    "sensor": "the instrument, its calibration and optics",
    "time": "the motion, the mounting and warming up",
    "travel": "the axis and its encoder",
    "part": "the part's shape, surface texture and material",
}
"""Frame -> what to check."""
FRAMES = {
    "sensor": "stays with the sensor", "time": "runs with time", "travel": "runs with the travel",
    "part": "stays with the part",
}  # fmt: skip
CHANNELS = {
    "mean": "mean of the readings", "scale": "noise", "missing": "missing readings",
    "outliers": "outliers",
}  # fmt: skip
REGIONS_SHOWN = 6
"""Regions that the page lists."""


def write_report(result: Diagnosis, path: Path, *, part_name: str) -> None:
    """Write report.html."""
    write_whole(path, render(result, part_name=part_name))


def render(result: Diagnosis, *, part_name: str) -> str:
    """Return the page as text; names from files are escaped, nothing is loaded from elsewhere."""
    pages = Environment(
        loader=PackageLoader("diagnosis", "report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True,
    )  # fmt: skip
    departs = result.verdict != "match"
    changed = result.effects != ()
    return pages.get_template("report.html.j2").render(
        title=f"Diagnosis of {part_name} by {result.datasheet.name}",
        result=result,
        headline=_headline(result),
        summary=_summary(result),
        figures=_figures(result),
        changed=changed,
        where=_image(mismatch_map(result)) if departs else "",
        residuals=_image(residual_maps(result)) if departs else "",
        paired=departs and moves_expectation(result),
        regions=_largest(result) if departs else [],
        effects=[_shown(result, e) for e in result.effects],
        checks=CHECK,
        channels=CHANNELS,
        profile=_image(profile_picture(result)),
        scans=_image(scan_pictures(result)),
        odds=_odds,
        size=_size,
        percent=_percent,
        words=_words,
    ) + "\n"


def _shown(result: Diagnosis, found: FoundEffect) -> dict[str, object]:
    """Return what the page shows of one effect."""
    meanings = {p.name: p for p in found.effect.parameters()}
    rows = []
    for key, estimate in found.parameters.items():
        known = meanings.get(key)
        meaning = f"{known.meaning}, {known.unit}" if known and known.unit else key
        if known and not known.unit:
            meaning = known.meaning
        rows.append((meaning, f"{estimate.value:.4g}", _interval(estimate)))
    moves = is_taken_up(result, found)
    picture = move_picture(result, found) if moves else covariate_picture(result, found)
    return {
        "found": found,
        "cause": found.statement.removesuffix(found.doubt).strip(),
        "frame": FRAMES.get(found.frame, ""),
        "check": CHECK.get(found.frame, ""),
        "taken_up": TAKEN_UP if moves else "",
        "rows": rows,
        "picture": _image(picture),
    }


def _words(name: str) -> str:
    return name.replace("_", " ")


def _headline(result: Diagnosis) -> str:
    found = ", ".join(f"{_words(e.name)} ({_percent(e.probability)})" for e in result.effects)
    return f"{VERDICTS[result.verdict]} Found: {found}." if found else VERDICTS[result.verdict]


def _summary(result: Diagnosis) -> str:
    if result.verdict == "match":
        return (
            "No departure is larger than those of good instruments. The noise is "
            f"{1e3 * result.noise.sd_mm:.1f} µm.{_nearest(result)}"
        )
    text = (
        f"{100 * result.share_of_points:.0f} % of the readings lie where the recordings depart "
        "from the nominal model. "
    )
    if not result.effects:
        return text
    if all(before == after for _, before, after in _figures(result)):
        why = TAKEN_UP if any(is_taken_up(result, e) for e in result.effects) else ""
        return f"{text}The effects found leave the figures of held-out readings unchanged. {why}"
    gain = result.before.log_score - result.after.log_score
    before, after = (f"{judged.rms_um:.1f}" for judged in (result.before, result.after))
    rms = f"{after} µm as before" if before == after else f"{after} µm instead of {before} µm"
    better = "improves" if gain >= 0 else "worsens"
    return text + (
        f"With the effects the held-out readings have an RMS of {rms}; their log score {better} "
        f"by {abs(gain):.2g} nats per reading."
    )


def _nearest(result: Diagnosis) -> str:
    """Say which departure of a good instrument is nearest to a fault; "" where none is near."""
    near = max(result.usual, key=lambda one: one.probability, default=None)
    if near is None or near.probability < SETTINGS.offered:
        return ""
    return (
        f" Nearest to a fault: {CHANNELS[near.channel]} by {near.covariate}, {_size(near)} "
        f"({_percent(near.probability)})."
    )


def _largest(result: Diagnosis) -> list[tuple[str, str, str, str, str]]:
    """List recording, profiles, points, size and cause of the largest regions.

    Effects that move no reading have no size there.
    """
    still = {e.name for e in result.effects if "mean" not in e.effect.channels}

    def area(region: Region) -> int:
        return (region.profiles[1] - region.profiles[0]) * (region.points[1] - region.points[0])

    return [
        (
            region.recording, _range(region.profiles), _range(region.points),
            f"{region.size_um:.0f} µm" if region.size_um and region.effect not in still else "-",
            _words(region.effect) if region.effect else "no named effect",
        )
        for region in sorted(result.regions, key=area, reverse=True)[:REGIONS_SHOWN]
    ]  # fmt: skip


def _range(half_open: tuple[int, int]) -> str:
    return f"{half_open[0]} to {half_open[1] - 1}"


def _figures(result: Diagnosis) -> list[tuple[str, str, str]]:
    """List label, nominal figure and figure with the effects."""
    rows = [
        ("log score, nats per reading (lower is better)", "log_score", "{:.3f}"),
        ("RMS about the expectation, µm", "rms_um", "{:.1f}"),
        ("distance from the normal distribution (KS)", "ks", "{:.3f}"),
        ("missing readings, Brier score", "brier", "{:.5f}"),
    ]
    both = (result.before, result.after)
    out = []
    for label, key, form in rows:
        before, after = (form.format(getattr(judged, key)) for judged in both)
        out.append((label, before, after))
    before, after = (" and ".join(_percent(c) for c in judged.coverage) for judged in both)
    return [*out, ("readings inside their 50 % and 90 % intervals", before, after)]


def _interval(estimate: Estimate) -> str:
    if estimate.low is None or estimate.high is None:
        return "not estimated"
    return f"{estimate.low:.3g} to {estimate.high:.3g}"


def _size(left: Residual) -> str:
    """Write a departure of the mean with its unit, of the noise as a factor, others as a share."""
    if left.channel == "mean":
        return f"{left.size:.2g} {left.unit}"
    if left.channel != "scale":
        return f"{100 * min(left.size**2 / 4, 1.0):.2g} % of the readings"
    return f"factor {float(f'{np.exp(left.size):.2g}'):g}"


def _odds(log_odds: float) -> str:
    """Write a change of the log odds; beyond 100 every choice is certain."""
    return "over 100" if log_odds > 100.0 else f"{log_odds:.1f}"


def _percent(share: float) -> str:
    """Write a share; a probability is never certain."""
    if 0.995 <= share < 1.0:
        return "over 99 %"
    if 0.0 < share < 0.005:
        return "under 1 %"
    return f"{100 * share:.0f} %"


def _image(png: bytes | None) -> str:
    return "" if png is None else base64.b64encode(png).decode("ascii")
