"""All formulas of the bench, by what they are about."""

from benchmarks.other_formulas.formulas import (
    firmware,
    laws,
    light,
    line,
    motion,
    noise,
    outside,
    sensor,
)
from benchmarks.other_formulas.formulas.base import Formula

CATALOGUED: tuple[Formula, ...] = (
    *sensor.FORMULAS, *motion.FORMULAS, *line.FORMULAS, *light.FORMULAS, *noise.FORMULAS,
    *firmware.FORMULAS,
)  # fmt: skip
OUTSIDE: tuple[Formula, ...] = outside.FORMULAS
LAWS: tuple[Formula, ...] = laws.FORMULAS
BY_NAME: dict[str, Formula] = {f.name: f for f in (*CATALOGUED, *OUTSIDE, *LAWS)}
UNJUDGED: frozenset[str] = frozenset()
"""Effects of the catalogue that no other formula stands for yet: the bench doesn't judge them."""
