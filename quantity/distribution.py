"""Distributions of a number, as a recipe spells them: a number, or `{name: [figures]}`."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np


class Distribution(Protocol):
    """A distribution that a number is drawn from; every draw takes its randomness from outside."""

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value."""
        ...

    def limits(self) -> tuple[float, float]:
        """Return the least and the greatest value that can be drawn."""
        ...

    def to_recipe(self) -> Any:
        """Return what a recipe writes for this distribution."""
        ...


def _ordered(name: str, low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise ValueError(f"{name}: [{low}, {high}] must be finite with low <= high")


@dataclass(frozen=True, kw_only=True, slots=True)
class Fixed:
    """Always the same value."""

    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ValueError(f"size {self.value} must be finite")

    def draw(self, rng: np.random.Generator) -> float:
        """Return the value; nothing is drawn."""
        return self.value

    def limits(self) -> tuple[float, float]:
        """Return the value twice."""
        return self.value, self.value

    def to_recipe(self) -> Any:
        """Return the plain number."""
        return self.value


@dataclass(frozen=True, kw_only=True, slots=True)
class Uniform:
    """Even density between `low` and `high`."""

    name: ClassVar[str] = "uniform"
    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered("uniform", self.low, self.high)

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value."""
        return float(rng.uniform(self.low, self.high))

    def limits(self) -> tuple[float, float]:
        """Return `low` and `high`."""
        return self.low, self.high

    def to_recipe(self) -> Any:
        """Return `{uniform: [low, high]}`."""
        return {self.name: [self.low, self.high]}


@dataclass(frozen=True, kw_only=True, slots=True)
class LogUniform:
    """Even density of the logarithm between `low` and `high`, both above zero."""

    name: ClassVar[str] = "log_uniform"
    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered("log_uniform", self.low, self.high)
        if self.low <= 0:
            raise ValueError(f"log_uniform: low is {self.low}, must be above 0")

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value."""
        value = math.exp(rng.uniform(math.log(self.low), math.log(self.high)))
        return min(max(value, self.low), self.high)

    def limits(self) -> tuple[float, float]:
        """Return `low` and `high`."""
        return self.low, self.high

    def to_recipe(self) -> Any:
        """Return `{log_uniform: [low, high]}`."""
        return {self.name: [self.low, self.high]}


@dataclass(frozen=True, kw_only=True, slots=True)
class Normal:
    """A normal density cut off at `low` and `high` (truncated, not clipped)."""

    name: ClassVar[str] = "normal"
    mean: float
    sd: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered("normal", self.low, self.high)
        if not (math.isfinite(self.mean) and math.isfinite(self.sd) and self.sd >= 0):
            raise ValueError(f"normal: mean {self.mean} and sd {self.sd} must be finite, sd >= 0")
        if not self.low <= self.mean <= self.high:
            raise ValueError(f"normal: mean {self.mean} must lie in [{self.low}, {self.high}]")

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value, by inverting the truncated distribution at one uniform number."""
        from scipy.special import ndtr, ndtri

        share = rng.uniform()
        if self.sd == 0:
            return self.mean
        with np.errstate(over="ignore"):  # limits infinitely many sd away don't cut
            below, above = ndtr((np.array([self.low, self.high]) - self.mean) / self.sd)
        value = self.mean + self.sd * float(ndtri(below + share * (above - below)))
        return min(max(value, self.low), self.high)

    def limits(self) -> tuple[float, float]:
        """Return `low` and `high`."""
        return self.low, self.high

    def to_recipe(self) -> Any:
        """Return `{normal: [mean, sd, low, high]}`."""
        return {self.name: [self.mean, self.sd, self.low, self.high]}


@dataclass(frozen=True, kw_only=True, slots=True)
class Choice:
    """One of the listed values, each as likely as the others."""

    name: ClassVar[str] = "choice"
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.values or not all(math.isfinite(value) for value in self.values):
            raise ValueError(f"choice: {list(self.values)} must hold at least one finite value")

    def draw(self, rng: np.random.Generator) -> float:
        """Return one value."""
        return self.values[int(rng.integers(len(self.values)))]

    def limits(self) -> tuple[float, float]:
        """Return the least and the greatest of the values."""
        return min(self.values), max(self.values)

    def to_recipe(self) -> Any:
        """Return `{choice: [values]}`."""
        return {self.name: list(self.values)}


def _figures(name: str, value: object, wanted: Sequence[str] | None) -> list[float]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise ValueError(f"{name}: {value!r} must be a list of numbers")
    for figure in value:
        if isinstance(figure, bool) or not isinstance(figure, int | float):
            raise ValueError(f"{name}: {figure!r} must be a number")
    if wanted is not None and len(value) != len(wanted):
        raise ValueError(f"{name}: {list(value)} must be [{', '.join(wanted)}]")
    return [float(figure) for figure in value]


def _uniform(value: object) -> Distribution:
    low, high = _figures("uniform", value, ("low", "high"))
    return Uniform(low=low, high=high)


def _log_uniform(value: object) -> Distribution:
    low, high = _figures("log_uniform", value, ("low", "high"))
    return LogUniform(low=low, high=high)


def _normal(value: object) -> Distribution:
    mean, sd, low, high = _figures("normal", value, ("mean", "sd", "low", "high"))
    return Normal(mean=mean, sd=sd, low=low, high=high)


def _choice(value: object) -> Distribution:
    return Choice(values=tuple(_figures("choice", value, None)))


DISTRIBUTIONS: dict[str, Callable[[object], Distribution]] = {
    "uniform": _uniform,
    "log_uniform": _log_uniform,
    "normal": _normal,
    "choice": _choice,
}


def parse_distribution(value: object) -> Distribution:
    """Read a distribution as a recipe spells it.

    Parameters
    ----------
    value
        A number, or one of `{uniform: [low, high]}`, `{log_uniform: [low, high]}`,
        `{normal: [mean, sd, low, high]}`, `{choice: [values]}`.

    Returns
    -------
    Distribution
        The distribution.

    Raises
    ------
    ValueError
        One line that says what is wrong and what is allowed.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return Fixed(value=float(value))
    if isinstance(value, Mapping) and len(value) == 1:
        ((name, figures),) = value.items()
        if name in DISTRIBUTIONS:
            return DISTRIBUTIONS[name](figures)
    allowed = ", ".join(DISTRIBUTIONS)
    raise ValueError(f"{value!r} must be a number or one of {{{allowed}}}: [figures]")
