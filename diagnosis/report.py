"""One self-contained page that a process engineer reads in two minutes."""

import base64
import html
from pathlib import Path

from diagnosis.diagnose import Diagnosis
from diagnosis.found import FoundEffect
from diagnosis.pictures import covariate_picture, mismatch_map, profile_picture
from diagnosis.residual_structure import Residual
from diagnosis.uncertainty import Estimate

VERDICTS = {
    "match": "The simulation explains the recordings.",
    "explained": "The recordings differ from the simulation, and the effects below explain it.",
    "partly_explained": "The effects below explain part of the difference; something is left.",
    "unexplained": "The recordings differ from the simulation, and no known effect explains it.",
}
FRAMES = {
    "sensor": "It stays with the sensor: look at the instrument, its calibration or optics.",
    "time": "It runs with time: look at the motion, the mounting or warming up.",
    "travel": "It runs with the travel: look at the axis and its encoder.",
    "part": "It stays with the part: look at its shape, finish or material.",
}
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#22303c;
  max-width:1080px;margin:24px auto;padding:0 20px}
h1{font-size:22px;margin:0 0 4px}
h2{font-size:17px;margin:30px 0 6px;border-bottom:1px solid #d6dde2}
.verdict{padding:14px 18px;border-radius:8px;
  margin:14px 0;background:#eef3f5;border-left:6px solid #1f6f8b}
.unexplained,.partly_explained{background:#fbf0ec;border-color:#c2452d}
.match{background:#eef6ef;border-color:#3c8a4b}
.verdict b{font-size:18px;display:block}
table{border-collapse:collapse;margin:8px 0}
td,th{padding:3px 14px 3px 0;text-align:left;vertical-align:top}
th{font-weight:600;color:#5b6b78;font-size:13px}
td.n{font-variant-numeric:tabular-nums}
.effect{display:flex;gap:22px;align-items:flex-start;flex-wrap:wrap}
.effect>div{flex:1 1 420px}
img{max-width:100%;height:auto}
.small{color:#5b6b78;font-size:13px}
.next{background:#f6f3e7;padding:8px 14px;border-radius:6px}
"""


def write_report(result: Diagnosis, path: Path, *, part_name: str) -> None:
    """Write report.html."""
    path.write_text(render(result, part_name=part_name), encoding="utf-8")


def render(result: Diagnosis, *, part_name: str) -> str:
    """Return the page as text."""
    title = f"Diagnosis of {part_name} by {result.datasheet.name}"
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>",
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>",
        f"<h1>{html.escape(title)}</h1>",
        f"<p class='small'>Fitted on {_names(result.fitted)}; judged on "
        f"{_names(result.held) if result.held else 'blocks of it that were left out'}.</p>",
        f"<div class='verdict {result.verdict}' id='verdict'>"
        f"<b>{html.escape(_headline(result))}</b>"
        f"{html.escape(_summary(result))}</div>",
        _figures(result),
    ]
    if result.verdict != "match":
        parts += ["<h2>Where</h2>", _image(mismatch_map(result), "map of the mismatch")]
    parts += [_effect(result, e) for e in result.effects]
    if result.left:
        parts.append(_left(result))
    picture = profile_picture(result)
    if picture is not None:
        parts += [
            "<h2>Before and after, on readings that nothing was fitted to</h2>",
            _image(picture, "held-out profile"),
        ]
    if result.notes:
        notes = "".join(f"<li>{html.escape(n)}</li>" for n in result.notes)
        parts.append(f"<h2>Notes</h2><ul class='small'>{notes}</ul>")
    parts.append("</body></html>")
    return "\n".join(parts)


def _headline(result: Diagnosis) -> str:
    real = [e for e in result.effects if e.name != "empirical"]
    words = " and ".join(e.name.replace("_", " ") for e in real)
    if result.verdict == "match" or not words:
        return VERDICTS[result.verdict]
    return f"{VERDICTS[result.verdict]} Found: {words}."


def _summary(result: Diagnosis) -> str:
    if result.verdict == "match":
        return (
            "Nothing beyond chance (one false alarm in a thousand) and beyond a tenth of the "
            "noise "
            f"of {1e3 * result.noise.sd_mm:.1f} µm."
        )
    share = f"It concerns {100 * result.share_of_points:.0f} % of the points. "
    gain = result.before.log_score - result.after.log_score
    if result.effects:
        share += (
            f"With the model, held-out readings scatter by {result.after.rms_um:.1f} µm instead of "
            f"{result.before.rms_um:.1f} µm and are {gain:.2f} nats each more probable."
        )
    return share


def _figures(result: Diagnosis) -> str:
    rows = [
        ("score, nats per reading (lower is better)", "log_score", "{:.3f}"),
        ("scatter about the expectation, µm", "rms_um", "{:.1f}"),
        ("distance from the normal law (KS)", "ks", "{:.3f}"),
        ("missing returns, Brier score", "brier", "{:.5f}"),
    ]
    body = "".join(
        f"<tr><td>{label}</td><td class='n'>{form.format(getattr(result.before, key))}</td>"
        f"<td class='n'>{form.format(getattr(result.after, key))}</td></tr>"
        for label, key, form in rows
    )
    cover = (
        f"<tr><td>readings inside the 50 % and 90 % intervals</td>"
        f"<td class='n'>{_cover(result.before.coverage)}</td>"
        f"<td class='n'>{_cover(result.after.coverage)}</td></tr>"
    )
    head = "<tr><th>on held-out readings</th><th>plain</th><th>with the effects</th></tr>"
    return f"<table>{head}{body}{cover}</table>"


def _cover(coverage: tuple[float, float]) -> str:
    return f"{100 * coverage[0]:.0f} %, {100 * coverage[1]:.0f} %"


def _effect(result: Diagnosis, found: FoundEffect) -> str:
    rows = "".join(
        f"<tr><td>{html.escape(k)}</td><td class='n'>{v.value:.4g}</td>"
        f"<td class='n'>{_interval(v)}</td></tr>"
        for k, v in found.parameters.items()
    )
    table = (
        f"<table><tr><th>parameter</th><th>value</th><th>95 % interval</th></tr>{rows}</table>"
        if rows else ""
    )  # fmt: skip
    rivals = ""
    if found.alternatives:
        names = ", ".join(f'{n} ({p:.0%})' for n, _, p in found.alternatives)
        rivals = f"<p><b>Can't be told from:</b> {html.escape(names)}.</p>"
    frame = "" if found.name == "empirical" else f"<p>{FRAMES.get(found.frame, '')}</p>"
    picture = covariate_picture(result, found)
    shown = _image(picture, f"residual against {found.covariate}") if picture else ""
    return (
        f"<h2>{html.escape(found.name)}</h2><div class='effect'><div>"
        f"<p>{html.escape(found.statement)}</p>{frame}{table}"
        f"<p class='small'>Taking it out costs {found.heldout_gain:.3f} nats per held-out "
        f"reading.</p>{rivals}"
        f"<p class='next'><b>Measure next:</b> {html.escape(found.separating)}.</p></div>"
        f"<div>{shown}</div></div>"
    )


def _interval(estimate: Estimate) -> str:
    if estimate.low is None or estimate.high is None:
        return "not estimated"
    return f"{estimate.low:.4g} to {estimate.high:.4g}"


def _left(result: Diagnosis) -> str:
    rows = "".join(
        f"<tr><td>{html.escape(r.channel)}</td><td>{html.escape(r.covariate)}"
        f"{': ' + html.escape(r.detail) if r.detail else ''}</td>"
        f"<td>{html.escape(r.frame)}</td><td class='n'>{_size(r)}</td></tr>"
        for r in result.left
    )
    return (
        "<h2>What is left</h2><p>Structure that no catalogued effect explains, strongest first. "
        "A fitted curve named <i>empirical</i> reproduces it without explaining it.</p>"
        "<table><tr><th>what changes</th><th>with</th><th>it follows the</th><th>size</th></tr>"
        f"{rows}</table>"
    )


def _size(left: Residual) -> str:
    if left.channel == "mean":
        return f"{left.size:.2g} {left.unit}"
    return f"{100 * left.size:.1f} %"


def _names(names: tuple[str, ...]) -> str:
    return html.escape(", ".join(names))


def _image(png: bytes, words: str) -> str:
    data = base64.b64encode(png).decode("ascii")
    return f"<img alt='{html.escape(words)}' src='data:image/png;base64,{data}'>"
