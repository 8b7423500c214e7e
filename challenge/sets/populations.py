"""Three populations of recordings, and what each may be used for.

A number of the diagnosis may come from a calibration population, never from one that judges.
"""

from dataclasses import dataclass

from challenge.sets.calibration_population import OF_MAKES, POPULATION


@dataclass(frozen=True, kw_only=True, slots=True)
class Population:
    """One population.

    Attributes
    ----------
    name : calibration, validation or test
    rule : what may be done with its cases
    members : names of sets, as a provenance would state them
    """

    name: str
    rule: str
    members: tuple[str, ...]


CALIBRATION = Population(
    name="calibration",
    rule="opened; may set the scales of the diagnosis, which states its name in every answer",
    members=(POPULATION, OF_MAKES, "other-formulas-calibration"),
)
VALIDATION = Population(
    name="validation",
    rule="sealed; opened after its run has been judged, from then on calibration",
    members=("challenge-1-sealed", "challenge-makes-sealed", "other-formulas-validation"),
)
TEST = Population(
    name="test",
    rule="never opened: judged in aggregate, each run recorded with its commit and its reason",
    members=("challenge-2", "other-formulas-test", "real-cases"),
)
POPULATIONS = {p.name: p for p in (CALIBRATION, VALIDATION, TEST)}


def needs_aggregate(population: str) -> bool:
    """Whether a set may be judged in aggregate only.

    Raises
    ------
    ValueError
        Where there is no such population.
    """
    if population not in POPULATIONS:
        allowed = ", ".join(POPULATIONS)
        raise ValueError(f"population: unknown, got {population!r}; allowed: {allowed}")
    return population == TEST.name
