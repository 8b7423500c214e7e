"""Names in a channel in which something is left that no catalogued effect explains.

Unknown physics isn't of a component's form. What the component that shows it leaves goes with other
covariates as well, and laws that follow these take it up: one mechanism that nobody catalogued is
likelier than it and a catalogued one in the same channel. A name holds as probably as that there is
no unknown mechanism, or that there are two. A filter is such a mechanism in channels in which it
does what wasn't predicted.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import prod

from diagnosis.claims.filtered import Filtered
from diagnosis.evidence.reported_causes import Unexplained, unnamed
from diagnosis.explanation import Explanation, under
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect

SHOWN_IN = {"variance": "scale", "correlation": "scale", "tails": "outliers"}
"""Channel of the evidence in which a channel of an effect shows, where that has another name."""


TAKEN_UP = (
    "may take up what unknown physics leaves, which departs in the same way; its name is taken back"
)


def share_held(
    unexplained: Iterable[Unexplained],
    channels: Iterable[str],
    filtered: Filtered | None = None,
) -> float:
    """Factor on the probability of a name, given what is left unexplained in its channels.

    Parameters
    ----------
    filtered : filter that the recordings went through
    """
    shown = {SHOWN_IN.get(c, c) for c in channels}
    none = prod(1 - u.probability for u in unexplained if u.channel in shown)
    if filtered is not None:
        none *= 1 - filtered.unpredicted(shown)
    return none + (1 - none) * SETTINGS.second_mechanism


def doubted_causes(
    explanation: Explanation, ready: Prepared, notes: list[str]
) -> Explanation:
    """Doubt causes in whose channels something has no name; the unlikely ones lose theirs."""
    causes = [
        c.times(share_held(explanation.unexplained, [c.channel], ready.filtered))
        for c in explanation.causes
    ]
    kept = [c for c in causes if 1 - c.none_of_these > SETTINGS.reported]
    if len(kept) == len(causes):
        return replace(explanation, causes=tuple(kept))
    names = {c.name for c in kept}
    lost = [c for c in explanation.causes if c.name not in names]
    notes += [f"{c.name}: {TAKEN_UP}" for c in lost]
    model = explanation.model.without(*(c.name for c in lost))
    left = (*unnamed(lost), *explanation.unexplained)
    return under(model, replace(explanation, causes=tuple(kept), unexplained=left), ready)


def doubted_claims(
    found: Sequence[FoundEffect],
    unexplained: Sequence[Unexplained],
    filtered: Filtered | None = None,
) -> list[FoundEffect]:
    """Doubt what was found against claims alike; the unlikely ones aren't reported."""
    held = [f.times(share_held(unexplained, f.effect.channels, filtered)) for f in found]
    return [f for f in held if 1 - f.none_of_these > SETTINGS.reported]
