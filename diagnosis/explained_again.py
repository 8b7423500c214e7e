"""An explanation, made again where it says that it has to be.

Its noise may have more power in long waves than was modelled, and readings held out may speak
against a cause.
"""

from dataclasses import replace
from functools import partial

from diagnosis.discrepancy.population import Population
from diagnosis.evidence.long_waves import power_of_long_waves
from diagnosis.explain import explain
from diagnosis.explanation import Explanation, Progress
from diagnosis.first_look import FirstLook, first_look, louder_look
from diagnosis.prepare import Prepared
from diagnosis.weighed_on_all import weighed_on_all


def explained_again(
    ready: Prepared,
    known: Population,
    withheld: frozenset[str],
    notes: list[str],
    progress: Progress,
    *,
    by_all: bool,
) -> tuple[Prepared, Explanation]:
    """Explain recordings; again without what held-out readings speak against.

    What that stood for may have another cause.

    Parameters
    ----------
    by_all : whether readings held out may weigh causes, too

    Returns
    -------
    the recordings with the noise that they have, and their explanation
    """
    look = first_look(ready, known)
    refuted: frozenset[str] = frozenset()
    while True:
        said: list[str] = []
        louder, found = _explained(ready, look, known, withheld, refuted, said, progress)
        unlikely: list[str] = []
        if by_all:
            found, unlikely = weighed_on_all(found, louder, withheld)
        if refuted.issuperset(unlikely):
            notes += [f"{name}: held-out readings speak against it" for name in sorted(refuted)]
            notes += said
            return louder, found
        refuted |= {*unlikely}


def _explained(
    ready: Prepared,
    look: FirstLook,
    known: Population,
    withheld: frozenset[str],
    refuted: frozenset[str],
    notes: list[str],
    progress: Progress,
) -> tuple[Prepared, Explanation]:
    """Explain recordings; once more where their noise has more power in long waves than modelled.

    What is left tells, once the causes found are taken away: before, they would pass for noise.
    What no cause claims may pass for noise as far as good instruments have as much.

    Returns
    -------
    the recordings with that noise, and their explanation
    """
    said: list[str] = []
    explained_by = partial(explain, withheld=withheld, refuted=refuted, progress=progress)
    found = explained_by(ready, look, notes=said)
    power = 1.0
    channels = {c.channel for c in found.causes} | {u.channel for u in found.unexplained}
    if "mean" in channels:
        power = power_of_long_waves(found.ws, found.model, look.departures, found.slips)
    if power > 1:
        said = [LOUDER.format(power)]
        ready = replace(ready, noise=replace(ready.noise, long_waves=power))
        found = explained_by(ready, louder_look(look, ready, known, power), notes=said)
    notes += said
    return ready, found


LOUDER = (
    "long waves of the noise have {:.1f} times the power that neighbouring readings tell: for a "
    "mismatch of the mean, readings count as so many fewer"
)
