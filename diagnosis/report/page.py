"""One self-contained page that a process engineer reads in two minutes."""

import base64
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from diagnosis.diagnosis import Diagnosis
from diagnosis.localise.residual_structure import Residual
from diagnosis.physics.uncertainty import Estimate
from diagnosis.report.covariate_picture import covariate_picture
from diagnosis.report.map_pictures import mismatch_map, residual_maps
from diagnosis.report.profile_picture import profile_picture
from files.whole_file import write_whole

VERDICTS = {
    "match": "The nominal model explains the recordings.",
    "explained": "The recordings differ from the nominal model, and the effects below explain it.",
    "partly_explained": "The effects below explain part of the difference; residual structure "
    "remains.",
    "unexplained": "The recordings differ from the nominal model, and no catalogued effect "
    "explains it.",
}
FRAMES = {
    "sensor": "It stays with the sensor: look at the instrument, its calibration or optics.",
    "time": "It runs with time: look at the motion, the mounting or warming up.",
    "travel": "It runs with the travel: look at the axis and its encoder.",
    "part": "It stays with the part: look at its shape, finish or material.",
}


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
    return pages.get_template("report.html.j2").render(
        title=f"Diagnosis of {part_name} by {result.datasheet.name}",
        result=result,
        headline=_headline(result),
        summary=_summary(result),
        figures=_figures(result),
        where=_image(mismatch_map(result)) if departs else "",
        residuals=_image(residual_maps(result)) if departs else "",
        effects=[
            {
                "found": e,
                "frame": FRAMES.get(e.frame, ""),
                "rows": [(k, f"{v.value:.4g}", _interval(v)) for k, v in e.parameters.items()],
                "picture": _image(covariate_picture(result, e)),
            }
            for e in result.effects
        ],
        profile=_image(profile_picture(result)),
        size=_size,
        percent=_percent,
    ) + "\n"


def _headline(result: Diagnosis) -> str:
    words = " and ".join(e.name.replace("_", " ") for e in result.effects)
    return f"{VERDICTS[result.verdict]} Found: {words}." if words else VERDICTS[result.verdict]


def _summary(result: Diagnosis) -> str:
    if result.verdict == "match":
        return f"No departure beyond a good instrument's; noise {1e3 * result.noise.sd_mm:.1f} µm."
    share = f"It concerns {100 * result.share_of_points:.0f} % of the points. "
    if result.effects:
        gain = result.before.log_score - result.after.log_score
        share += (
            f"With the effects the held-out readings have an RMS of {result.after.rms_um:.1f} µm "
            f"instead of {result.before.rms_um:.1f} µm, and their log score improves by {gain:.2f} "
            "nats each."
        )
    return share


def _figures(result: Diagnosis) -> list[tuple[str, str, str]]:
    """List label, nominal figure and figure with the effects."""
    rows = [
        ("log score, nats per reading (lower is better)", "log_score", "{:.3f}"),
        ("RMS about the expectation, µm", "rms_um", "{:.1f}"),
        ("distance from the normal law (KS)", "ks", "{:.3f}"),
        ("missing readings, Brier score", "brier", "{:.5f}"),
    ]
    both = (result.before, result.after)
    out = []
    for label, key, form in rows:
        before, after = (form.format(getattr(judged, key)) for judged in both)
        out.append((label, before, after))
    before, after = (" and ".join(_percent(c) for c in judged.coverage) for judged in both)
    return [*out, ("inside the 50 % and 90 % intervals", before, after)]


def _interval(estimate: Estimate) -> str:
    if estimate.low is None or estimate.high is None:
        return "not estimated"
    return f"{estimate.low:.4g} to {estimate.high:.4g}"


def _size(left: Residual) -> str:
    if left.channel == "mean":
        return f"{left.size:.2g} {left.unit}"
    return _percent(left.size)


def _percent(share: float) -> str:
    """Write a share; a probability is never certain."""
    if 0.995 <= share < 1.0:
        return "over 99 %"
    return f"{100 * share:.0f} %"


def _image(png: bytes | None) -> str:
    return "" if png is None else base64.b64encode(png).decode("ascii")
