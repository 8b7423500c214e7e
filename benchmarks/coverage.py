"""How often 95 % intervals of parameters hold the truth, over simulated recordings.

Each simulation takes two recordings of the bench anew (noise, placement), registers them,
calibrates their noise and fits the one effect that is in them, started at the truth: this measures
the interval's formula for chance, not the search, nor the spread of good instruments. Coverage's
own 95 % interval is Clopper and Pearson's (Biometrika 26 (1934) 404).

    python -m benchmarks.coverage [--simulations 30] [--strength 24] [--effects line_bow ...]
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from benchmarks.diagnose import OF
from benchmarks.strength import at_strength
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.curvature import TURN
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.uncertainty import intervals, refined
from sensors.effects import effect_of
from tests.support.effect_case import Case, Entry

EFFECTS = (
    "line_bow", "range_scale", "incidence_bias", "volume_scattering", "stage_vibration",
    "pixel_locking", "incidence_noise", "random_dropout", "outlier_spikes", "finite_spot",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Held:
    """One parameter of one simulation.

    Attributes
    ----------
    held : whether the interval has the truth in it; None without an interval
    """

    effect: str
    parameter: str
    held: bool | None
    width_over_error: float


def workspace(case: Case, effect: Entry, seed: int) -> Workspace:
    """Register two recordings with an effect in them, noise calibrated from themselves."""
    return case.workspace_of(
        [case.record([effect], k, name=f"c{k}", seed=100 * seed + k) for k in range(2)]
    )


def simulate(name: str, entry: Entry, seed: int) -> Iterator[Held]:
    """Yield each parameter of one simulation."""
    case = OF[name]
    truth = effect_of(dict(entry))
    ws = workspace(case, entry, seed)
    states = ws.states(ws.predict(Model()))
    fitted = fit_effect(type(truth), ws, Model(), states, start=truth)
    if fitted is None or fitted.effect.is_null:
        return
    model = refined(ws, ws.levelled(Model().with_effect(fitted.effect, fitted.own)))
    for parameter, found in intervals(ws, model, {})[name].items():
        true = float(getattr(truth, parameter))
        if found.low is None or found.high is None:
            yield Held(effect=name, parameter=parameter, held=None, width_over_error=np.nan)
            continue
        if parameter == "phase_rad":
            true += TURN * round((found.value - true) / TURN)
        error = max(abs(found.value - true), 1e-12)
        yield Held(
            effect=name, parameter=parameter, held=found.low <= true <= found.high,
            width_over_error=0.5 * (found.high - found.low) / error,
        )  # fmt: skip


def report(held: Sequence[Held]) -> str:
    """Return coverage by parameter and over all, a row each."""
    rows: dict[str, list[bool | None]] = defaultdict(list)
    for one in held:
        rows[f"{one.effect}.{one.parameter}"].append(one.held)
    rows["all"] = [one.held for one in held]
    lines = ["| parameter | intervals | none computed | coverage | 95 % interval |",
             "| --- | --- | --- | --- | --- |"]  # fmt: skip
    for name, all_of in rows.items():
        known = [h for h in all_of if h is not None]
        if not known:
            lines.append(f"| {name} | 0 | {len(all_of)} | | |")
            continue
        ends = stats.binomtest(sum(known), len(known)).proportion_ci(method="exact")
        lines.append(
            f"| {name} | {len(known)} | {len(all_of) - len(known)} | {np.mean(known):.3f} | "
            f"{ends.low:.3f} to {ends.high:.3f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Simulate, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulations", type=int, default=30, help="of each effect (default: 30)")
    parser.add_argument("--strength", type=float, default=24.0, help="whitened (default: 24)")
    parser.add_argument("--effects", nargs="+", default=EFFECTS, choices=sorted(OF))
    arguments = parser.parse_args()
    held: list[Held] = []
    for name in arguments.effects:
        entry = at_strength(OF[name], arguments.strength)
        if entry is None:
            continue
        for seed in range(arguments.simulations):
            held += simulate(name, entry, seed)
        print(report([h for h in held if h.effect == name]), flush=True)
    print(report(held))


if __name__ == "__main__":
    main()
