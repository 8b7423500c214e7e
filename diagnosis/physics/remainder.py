"""The remainder of a law: what of its cause's component the readings still show."""

from collections.abc import Collection

from diagnosis.components.free_curve import Part
from diagnosis.evidence.assess import Assessment
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.seen import Seen


def remainder(found: Assessment, known: Collection[str]) -> Member | None:
    """Return the largest member that is the remainder of a known cause, if it is a curve."""
    kin = [
        m for m in found.mean
        if m.candidate.effect in known and m.candidate.component.is_curve
    ]  # fmt: skip
    return max(kin, key=lambda m: m.size, default=None)


def curves_of(member: Member, seen: Seen, sd_mm: float) -> list[Part]:
    """Return the most probable curve of a member; of a periodic one, those of its periods.

    Parameters
    ----------
    seen : recordings in whose equations the member was weighed
    sd_mm : of the noise, by which values of columns are scaled
    """
    out, at = [], 0
    group = member.candidate.component.group
    for block in (b for b in seen.bulk.blocks if b.component.group == group):
        size = len(block.at)
        own = member.coefficients[at : at + size] * seen.turns[block.component.name]
        at += size
        if block.component.relaxed.each == "column":
            own = own * sd_mm
        if own.any():
            along = [a for a in block.component.relaxed.along if a in seen.ranges]
            out.append(
                Part(
                    component=block.component,
                    ranges=tuple((a, *seen.ranges[a]) for a in along),
                    coefficients=tuple(float(c) for c in own),
                )
            )
    return out
