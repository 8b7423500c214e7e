"""An explanation, made again where it says that it has to be.

Its noise may have more power in long waves than was modelled, and readings held out may speak
against a cause.
"""

from dataclasses import replace

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
    of_noise: list[str] = []
    while True:
        said: list[str] = []
        found = explain(
            ready, look, withheld=withheld, refuted=refuted, notes=said, progress=progress
        )
        power = _louder(ready, look, found)
        if power > 1:
            of_noise = [LOUDER.format(power)]
            ready = replace(ready, noise=replace(ready.noise, long_waves=power))
            look = louder_look(look, ready, known, power)
            continue
        unlikely: list[str] = []
        if by_all:
            found, unlikely = weighed_on_all(found, ready, withheld)
        if refuted.issuperset(unlikely):
            notes += [f"{name}: held-out readings speak against it" for name in sorted(refuted)]
            notes += of_noise + said
            return ready, found
        refuted |= {*unlikely}


def _louder(ready: Prepared, look: FirstLook, found: Explanation) -> float:
    """Return how much more power the noise has in long waves than it is modelled with; 1 of none.

    What is left tells, once the causes found are taken away: before, they would pass for noise.
    What no cause claims may pass for noise as far as good instruments have as much. Once measured
    it is the noise of every further explanation.
    """
    channels = {c.channel for c in found.causes} | {u.channel for u in found.unexplained}
    if "mean" not in channels or ready.noise.long_waves > 1:
        return 1.0
    return power_of_long_waves(found.ws, found.model, look.departures, found.slips)


LOUDER = (
    "long waves of the noise have {:.1f} times the power that neighbouring readings tell: for a "
    "mismatch of the mean, readings count as so many fewer"
)
