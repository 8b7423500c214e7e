"""Cases of a set, drawn from a master seed: kinds, switches, strengths, parts."""

import secrets
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from challenge.cases import imitation
from challenge.cases.case import MAKES, SWITCHES, Secret
from challenge.cases.parts import SHAPES
from challenge.cases.seeds import child
from challenge.cases.switches import DECOY, SINGLE, UNKNOWN
from challenge.second import imitation as second_imitation
from challenge.second import switches as second
from challenge.second.meshes import MARK

# Cases of a full set by kind.
FULL = {"null": 60, "one": 60, "two": 12, "unknown": 12, "decoy": 8, "undecidable": 8}
LEAST = 12
"""Cases of the smallest set that has every kind."""

# Which answers are right where one recording cannot tell them apart: the set of both.
UNDECIDABLE: dict[str, tuple[str, ...]] = {
    "line_bow": ("line_bow", "form_error"),
    "warped_part": ("line_bow", "form_error"),
    "motion_blur": ("motion_blur", "finite_spot"),
    "lens_distortion": ("lens_distortion", "form_error"),
    **second.UNDECIDABLE,
}
# What is drawn: a perfect observer is checked not to tell them (told_apart). Former sets have lens
# errors and long exposures as well: steps tell a lens from a bend, and of a long exposure on
# terraces the oracle told every line of 1.4 to 4 times the width at more than 60 sigma.
FIRST_UNDECIDABLE = tuple(imitation.IMITATES)
SECOND_UNDECIDABLE = tuple(second_imitation.IMITATES)
MESHED = 1 / 3
"""Share of a set's cases on meshes from files, of those whose faults show on any part."""


def counts_of(cases: int) -> dict[str, int]:
    """Share a number of cases over the kinds as in a full set; each kind has one at least.

    Raises
    ------
    ValueError
        Where there are fewer cases than kinds.
    """
    if cases < LEAST:
        raise ValueError(f"--cases: too few, got {cases}; allowed: {LEAST} or more")
    whole = sum(FULL.values())
    counts = {kind: max(1, cases * n // whole) for kind, n in FULL.items()}
    behind = sorted(FULL, key=lambda kind: counts[kind] - cases * FULL[kind] / whole)
    for kind in behind[: cases - sum(counts.values())]:
        counts[kind] += 1
    return counts


def draw(
    master: int, counts: dict[str, int], family: str = "first", meshes: Sequence[str] = ()
) -> list[Secret]:
    """Draw all cases of a set in a shuffled order.

    Parameters
    ----------
    meshes
        Names of meshes from files, which are among the second family's parts.

    Raises
    ------
    ValueError
        Where there is no such family.
    """
    if family == "second":
        return _draw_second(master, counts, meshes)
    if family == "first":
        return _draw_first(master, counts)
    if family == MAKES:
        return _of_makes(master, _draw_first(master, counts))
    raise ValueError(f"--family: unknown, got {family!r}; allowed: first, second, {MAKES}")


def _of_makes(master: int, cases: Sequence[Secret]) -> list[Secret]:
    """Give cases to instruments of other makes, with and without reference plates and baselines.

    A coarse camera has no baselines: its locking is no change.
    """
    rng = child(master, "makes")
    return [
        replace(
            c, family=MAKES, plates=min(c.plates, int(rng.choice([0, 2]))),
            baselines=int(rng.choice([0, 2]))
            * (c.kind != "undecidable" and "pixel_locking" not in c.switches),
        )
        for c in cases
    ]  # fmt: skip


def _draw_first(master: int, counts: dict[str, int]) -> list[Secret]:
    """Draw a set of the first family."""
    rng = child(master, "set")
    wanted: list[tuple[str, tuple[str, ...]]] = [("null", ())] * counts["null"]
    names = list(rng.permutation(list(SINGLE)))
    wanted += [("one", (str(names[k % len(names)]),)) for k in range(counts["one"])]
    for _ in range(counts["two"]):
        first, second = rng.choice(list(SINGLE), 2, replace=False)
        while _clash(str(first), str(second)):
            first, second = rng.choice(list(SINGLE), 2, replace=False)
        wanted.append(("two", (str(first), str(second))))
    for kind, group in (("unknown", UNKNOWN), ("decoy", DECOY), ("undecidable", FIRST_UNDECIDABLE)):
        pool = list(group)
        wanted += [(kind, (pool[k % len(pool)],)) for k in range(counts[kind])]
    cases = []
    for kind, switches in wanted:
        shapes = set(SHAPES)
        for name in switches:
            shapes &= set(SWITCHES[name].shapes or SHAPES)
        cases.append(
            Secret(
                kind=kind,
                switches=switches,
                strength=_strength(kind, rng),
                shape=str(rng.choice(sorted(shapes))),
                recordings=1 if kind == "undecidable" else 3,
                seed=int(rng.integers(2**62)),
                # the instrument's plates would tell: they are flat; so would a bend at an angle
                plates=0 if kind == "undecidable" else 2,
                aligned=kind == "undecidable",
            )
        )
    return [cases[k] for k in rng.permutation(len(cases))]


def _draw_second(master: int, counts: dict[str, int], meshes: Sequence[str]) -> list[Secret]:
    """Draw a set of the second family, with and without reference plates and baselines."""
    rng = child(master, "second set")
    names = list(second.SINGLE)
    order = [str(n) for n in rng.permutation(names)]
    wanted: list[tuple[str, tuple[str, ...]]] = [("null", ())] * counts["null"]
    wanted += [("one", (order[k % len(order)],)) for k in range(counts["one"])]
    while sum(kind == "two" for kind, _ in wanted) < counts["two"]:
        pair = tuple(str(n) for n in rng.choice(names, 2, replace=False))
        first, other = (set(second.SINGLE[n].accept) for n in pair)
        if second_shapes(pair) and not first & other and not _same_screw(*pair):
            wanted.append(("two", pair))
    for kind, group in (("unknown", second.UNKNOWN), ("decoy", second.DECOY),
                        ("undecidable", SECOND_UNDECIDABLE)):  # fmt: skip
        pool = [str(n) for n in rng.permutation(list(group))]
        wanted += [(kind, (pool[k % len(pool)],)) for k in range(counts[kind])]
    cases = []
    for kind, switches in wanted:
        shape = str(rng.choice(sorted(second_shapes(switches))))
        anywhere = not any(second.FAULTS[n].shapes or second.FAULTS[n].built for n in switches)
        if meshes and rng.random() < MESHED and anywhere:
            shape = MARK + str(rng.choice(list(meshes)))
        single = kind == "undecidable"
        cases.append(
            Secret(
                kind=kind, switches=switches, shape=shape, family="second", aligned=single,
                strength=_strength(kind, rng),
                recordings=1 if single else 3, seed=int(rng.integers(2**62)),
                plates=int(rng.choice([0, 2])), baselines=0 if single else int(rng.choice([0, 2])),
            )
        )  # fmt: skip
    return [cases[k] for k in rng.permutation(len(cases))]


def _strength(kind: str, rng: np.random.Generator) -> int:
    """Draw one; what nobody can see can't be flagged or offered: these are medium or strong."""
    return int(rng.choice([1, 2] if kind in ("unknown", "undecidable") else [0, 1, 1, 2]))


def second_shapes(switches: tuple[str, ...]) -> set[str]:
    """Parts on which all of some faults of the second family show."""
    found = set(SHAPES)
    for name in switches:
        found &= set(second.FAULTS[name].shapes or SHAPES)
    return found


def _same_screw(first: str, other: str) -> bool:
    """Two faults of the second family that set the same field."""
    same = [
        {"worn roller", "eccentric roller", "shaking frame"}, {"median firmware", "gap filling"},
        {"dark gloss", "shining corner", "rubber", "clear coat", "coarse speckle"},
        {"stretched gauge blocks", "bowed calibration plate", "skew window"},
        {"long exposure", "wide slit", "coarse chip"},
    ]  # fmt: skip
    return any({first, other} <= group for group in same)


def _clash(first: str, second: str) -> bool:
    """Two switches that turn the same screw, or share no part."""
    same = [
        {"anisotropic_lay", "roughness_level"},
        {"line_bow", "lens_distortion", "column_offset", "range_scale"},
        {"finite_spot", "motion_blur", "pixel_locking"},
        {"specular_dropout", "interreflection", "reflectance_edge", "volume_scattering"},
    ]
    shapes = set(SWITCHES[first].shapes or SHAPES) & set(SWITCHES[second].shapes or SHAPES)
    return not shapes or any({first, second} <= group for group in same)


def entropy() -> int:
    """Return a master seed from the operating system."""
    return secrets.randbits(62)
