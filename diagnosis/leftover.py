"""What is left over must hold on held-out readings, too, as a named effect must.

A smooth departure that follows the sensor or the part is there in every recording. Its fields are
solved on the readings that were fitted, beyond the placement, and asked of the others: u their
whitened residual and p what is predicted for it, the gain is the sum of p u - p²/2.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.families import Family, free_families, mean_signature
from diagnosis.finding import Finding
from diagnosis.noise import Field
from diagnosis.patch import Patch
from diagnosis.screen import Readings
from diagnosis.workspace import Model, Workspace, block_numbers, bootstrap_interval

CERTAIN, BENT = 10.0, 0.4
"""Strength, and size in units of the noise, of a departure that needs no second witness."""
LARGEST_SD = 5.0
"""Departure, in units of the noise, to which free-form coefficients are shrunk."""


def held_findings(
    findings: Sequence[Finding],
    patches: Sequence[Patch],
    ws: Workspace,
    model: Model,
    *,
    least_gain: float,
    rng: np.random.Generator,
) -> list[Finding]:
    """Return the findings without those in the mean that held-out readings deny.

    What belongs to one recording, its rows or its time can't be asked and stays. So does what the
    fitted recordings show beyond all doubt: it may be each recording's own.

    Parameters
    ----------
    patches : all, those with readings held out among them
    least_gain : nats per held-out reading that a finding must gain
    """
    asked = [
        f
        for f in findings
        if f.channel == "mean" and f.family is not None and not (f.z > CERTAIN and f.size > BENT)
    ]
    if not asked:
        return list(findings)
    fitted = _readings([p for p in patches if p.fit.any()], ws, model, rng)
    held = _readings([replace(p, fit=p.scored, kept={}) for p in patches if p.scored.any()],
                     ws, model, rng)  # fmt: skip
    both = [*fitted.patches, *held.patches]
    free = {f.name: f for f in free_families(both)}
    denied = set()
    for finding in asked:
        family = _on(finding, free, both, ws, model)
        if family is None:
            continue
        blocks = _gains(family, fitted, held, ws)
        if blocks is None:
            continue
        low, _ = bootstrap_interval(blocks, rng)
        count = sum(int(k.sum()) for k in held.picks)
        if low <= 0 or float(blocks.sum()) < least_gain * count:
            denied.add(id(finding))
    return [f for f in findings if id(f) not in denied]


def _readings(
    patches: Sequence[Patch], ws: Workspace, model: Model, rng: np.random.Generator
) -> Readings:
    own = replace(ws, patches=tuple(patches))
    return Readings.build(patches, own.states(own.predict(model)), ws.noise, rng, 0)


def _on(
    finding: Finding,
    free: dict[str, Family],
    patches: Sequence[Patch],
    ws: Workspace,
    model: Model,
) -> Family | None:
    """Return a finding's family on other patches; None where it belongs to one recording."""
    assert finding.family is not None
    effect = finding.family.effect
    if effect is None:
        family = free.get(finding.name)
        return None if family is None or any(f is None for f in family.fields) else family
    base = replace(ws, patches=tuple(patches)).predict(model)
    fields = mean_signature(effect, patches, base, ws.noise, model.effects)
    return None if fields is None else replace(finding.family, fields=tuple(fields))


def _gains(family: Family, fitted: Readings, held: Readings, ws: Workspace) -> Field | None:
    """Nats that each block of the readings held out gains by what the others say."""
    count = len(fitted.patches)
    first, second = (
        r if family.at_edges else r.away_from_edges() for r in (fitted, held)
    )
    solved = first.projected(replace(family, fields=family.fields[:count]))
    asked = second.projected(replace(family, fields=family.fields[count:]))
    if solved is None or asked is None:
        return None
    fields = solved[0]
    gram = np.asarray(sum(b.T @ b for b in fields.values()), dtype=np.float64)
    right = np.asarray(sum(b.T @ first.of(r)[0] for r, b in fields.items()), dtype=np.float64)
    weak = (LARGEST_SD * ws.noise.sd_mm) ** -2 if family.effect is None else 1e-9 * np.trace(gram)
    beta = np.linalg.solve(gram + weak * np.eye(right.size), right)
    gains = []
    for recording, block in asked[0].items():
        predicted = block @ beta
        gain = predicted * second.of(recording)[0] - 0.5 * predicted**2
        numbers = _numbers(second, second.own[recording], ws.block)
        gains.append(np.bincount(numbers, gain))
    return np.concatenate(gains)


def _numbers(
    readings: Readings, members: Iterable[int], block: tuple[int, int]
) -> NDArray[np.int64]:
    """Return the number of the block of each reading of one recording."""
    numbers, so_far = [], 0
    for k in members:
        own = block_numbers(readings.patches[k].shape, block) + so_far
        numbers.append(own[readings.picks[k]])
        so_far = int(own.max()) + 1
    return np.concatenate(numbers)
