"""Recordings explained by what is known of good instruments whose columns are rays."""

from typing import Any

from diagnosis.discrepancy.population import population
from diagnosis.explain import explain
from diagnosis.explanation import Explanation
from diagnosis.first_look import first_look
from diagnosis.prepare import Prepared


def explained(one: Prepared, **more: Any) -> Explanation:
    """Explain recordings without a word."""
    look = first_look(one, population().of_files("even_angle"))
    return explain(one, look, notes=[], progress=lambda _: None, **more)
