"""The interface of an effect: a frozen value that maps one predictive distribution to another.

A new effect subclasses `Effect` (or `AdditiveEffect` for a mean that is linear in some parameters,
or `MotionEffect` for a change of pose or rays) as a frozen dataclass whose fields are made by
`parameter`, states the class attributes, and joins the catalogue. The parameters then state all
that a fit needs: bounds, typical values, owners, linearity, and a coarse grid for the others.
"""

import dataclasses
import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError, known
from quantity import quantities
from sensors.effects.basis import Basis
from sensors.effects.parameter import Parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law, geometric_law
from sensors.line.beam import Beam
from sensors.view.covariates import COVARIATES
from sensors.view.view import View

Floats = NDArray[np.float64]
Channel = Literal["mean", "variance", "missing", "tails", "correlation"]
Frame = Literal["sensor", "time", "travel", "part"]

# Draws of unknown per-recording parameters over which a law is averaged.
AVERAGED = 8


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Effect(ABC):
    """A physical effect beyond the nominal model.

    Attributes
    ----------
    name : the effect's name in formats.md and sensor.yaml
    summary : the effect in one sentence
    equation : the equation in one line of plain text
    source : reference of the equation
    statement : sentence for a process engineer, with {parameter} fields
    channels : moments of the law that the effect changes and by which it is detected
    secondary_channels : further moments that the effect changes, by which it isn't detected
    first_order : whether `fields` are first-order terms of a mean that isn't linear; a fit starts
        from the linear solution and searches the full law
    frame : frame in which the signature is fixed
    covariate : key of `sensors.view.covariates.COVARIATES` on which the effect depends
    relaxed : components by which a diagnosis recognises the effect, whatever its equation
    rivals : confounded effects
    separating : the measurement that separates the effect from these
    needs : keys of the datasheet that the effect requires
    goes_by : further keys that its law goes by where they are stated, and that a diagnosis assumes
        where they aren't
    line_width : parameter of the laser line's width, where the effect is the line's geometry
    least_light : parameter of the share of the line's light below which a reading is lost, which no
        datasheet states
    on_albedo : whether the effect follows the part's albedo, whose pattern a simulation of it needs
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    equation: ClassVar[str]
    source: ClassVar[str]
    statement: ClassVar[str]
    channels: ClassVar[tuple[Channel, ...]]
    secondary_channels: ClassVar[tuple[Channel, ...]] = ()
    first_order: ClassVar[bool] = False
    frame: ClassVar[Frame]
    covariate: ClassVar[str]
    relaxed: ClassVar[tuple[Relaxed, ...]] = ()
    rivals: ClassVar[tuple[str, ...]]
    separating: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    goes_by: ClassVar[tuple[str, ...]] = ()
    line_width: ClassVar[str] = ""
    least_light: ClassVar[str] = ""
    on_albedo: ClassVar[bool] = False

    # ---- defined by a subclass

    @abstractmethod
    def changed(self, law: Law, view: View) -> Law:
        """Return the law with the effect; all parameters are known and not all at their null."""

    def shift(self, view: View) -> Floats | None:
        """Return the change of the mean (n, m), mm, where it is independent of other effects.

        None where `changed` does more than add this change to the mean.
        """
        return None

    def stated_on(self, beam: Beam) -> Beam:
        """Return the laser line with the properties that this effect, listed in a file, states.

        Effects read all stated properties from `view.sensor.beam`.
        """
        return beam

    # ---- called by others

    def apply(self, law: Law, view: View) -> Law:
        """Map one law to another.

        Per-recording parameters that are None are integrated out: the mean is the mean over their
        prior, the white variance includes their scatter, and the probabilities of missing readings
        and outliers are averaged. An effect at zero strength returns the law unchanged.

        Raises
        ------
        RecipeError
            Where the datasheet does not state a key that the effect needs.
        """
        if self.is_null:
            return law
        for key in self.needs:
            view.datasheet.require(key)
        if self.undrawn(view):
            return self._integrated(law, view)
        return self.changed(law, view)

    @property
    def is_null(self) -> bool:
        """Whether the effect is at zero strength."""
        nulls = [p for p in self.parameters() if p.null is not None]
        return bool(nulls) and all(
            all(v == p.null for v in value) if isinstance(value, tuple) else value == p.null
            for p in nulls
            for value in (getattr(self, p.name),)
        )

    @classmethod
    def example(cls) -> Self:
        """Return the effect with typical values throughout."""
        return cls(**{p.name: p.typical for p in cls.parameters()})

    @classmethod
    def none(cls) -> Self:
        """Return the effect at zero strength."""
        empty: dict[str, Any] = {}
        for p in cls.parameters():
            if p.null is not None:
                empty[p.name] = () if p.kind == "list" else p.null
        return cls(**empty)

    def covariate_values(self, view: View) -> Floats:
        """Return the covariate on which the effect depends, broadcastable to (n, m)."""
        return COVARIATES[self.covariate].values(view)

    # ---- linear parameters

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the change of the mean for each coefficient, mm per unit; () without any.

        They broadcast to (n, m). For an `AdditiveEffect` the mean is their sum. For a
        `MotionEffect` they hold to first order, which a search uses.
        """
        return ()

    def basis(self, view: View) -> Basis | None:
        """Return `fields` with their names, at this effect's nonlinear parameters.

        None where the mean is linear in no parameter.
        """
        for key in self.needs:
            view.datasheet.require(key)
        fields = self.fields(view)
        return Basis(names=self.coefficient_names(), fields=fields) if fields else None

    def signature(self, view: View) -> Floats:
        """Return the change of the mean at this effect's parameters, (n, m) mm.

        NaN where either law has no reading.
        """
        bare = geometric_law(view, None)
        return np.asarray(self.apply(bare, view).mean_mm - bare.mean_mm)

    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients, in the order of the fields."""
        linear = [p for p in self.parameters() if p.linear]
        names: list[str] = []
        for p in linear:
            value = getattr(self, p.name)
            lists = [f"{p.name}[{i}]" for i in range(len(value))] if p.kind == "list" else [p.name]
            names.extend(lists)
        return tuple(names)

    def coefficients(self) -> Floats:
        """Return the coefficients (k,) at this effect's parameters."""
        linear = [getattr(self, p.name) for p in self.parameters() if p.linear]
        return np.array([c for v in linear for c in (v if isinstance(v, tuple) else (v,))], float)

    def with_coefficients(self, coefficients: Floats) -> Self:
        """Return the effect that has these coefficients.

        Raises
        ------
        RecipeError
            Where a parameter would be out of its bounds.
        """
        given = [float(c) for c in np.asarray(coefficients).ravel()]
        linear = [p for p in self.parameters() if p.linear]
        values: dict[str, Any] = {}
        for p in linear:
            if p.kind == "list":
                count = len(getattr(self, p.name))
                values[p.name] = tuple(given[:count])
                given = given[count:]
            else:
                values[p.name] = given.pop(0)
        return self.with_parameters(values)

    def describe(self) -> str:
        """Fill the statement with this effect's parameters."""
        values = {p.name: self._worded(p) for p in self.parameters()}
        return self.statement.format(**{**values, **self.words()})

    def words(self) -> dict[str, Any]:
        """Return the fields of the statement beyond the parameters."""
        return {}

    def _worded(self, p: Parameter) -> Any:
        value = getattr(self, p.name)
        if value is None:
            return p.typical
        return max(map(abs, value), default=0.0) if isinstance(value, tuple) else value

    # ---- parameters

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Describe every parameter, in the order of the fields."""
        return quantities(cls)

    @classmethod
    def parameter(cls, name: str) -> Parameter:
        """Describe one parameter."""
        return next(p for p in cls.parameters() if p.name == name)

    def with_parameters(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> Self:
        """Return the effect with some parameters replaced.

        Raises
        ------
        RecipeError
            For an unknown name or a value out of its bounds.
        """
        new = {**(values or {}), **more}
        self._refuse_unknown(new)
        return dataclasses.replace(self, **new)

    def searched(self, *, linear: bool | None = None) -> tuple[Parameter, ...]:
        """Free parameters of a fit; only the linear or the nonlinear ones where requested."""
        found = (p for p in self.parameters() if p.searched)
        return tuple(p for p in found if linear is None or p.linear == linear)

    def vector(self, names: Iterable[str]) -> Floats:
        """Return the named numbers as an array; None counts as the typical value."""
        described = {p.name: p for p in self.parameters()}
        got = [getattr(self, name) for name in names]
        pairs = zip(got, names, strict=True)
        return np.array([described[k].typical if v is None else v for v, k in pairs], dtype=float)

    def grid(self, view: View) -> tuple[Self, ...]:
        """Return effects on a coarse grid of the nonlinear parameters; others keep their values."""
        axes = [(p.name, p.grid) for p in self.parameters() if p.grid]
        points = itertools.product(*(values for _, values in axes))
        names = [name for name, _ in axes]
        return tuple(self.with_parameters(dict(zip(names, p, strict=True))) for p in points)

    def variants(self, view: View) -> tuple[Self, ...]:
        """Return other forms of the effect, tried in a fit and not in a search."""
        return ()

    def starts(self, view: View) -> tuple[Self, ...]:
        """Return the effects from which a fit starts: the grid, and other forms of each point."""
        points = self.grid(view)
        return points + tuple(other for point in points for other in point.variants(view))

    # ---- per-recording parameters

    def undrawn(self, view: View | None = None) -> tuple[str, ...]:
        """Names of the per-recording parameters that are None and unknown in `view`."""
        return tuple(
            p.name
            for p in self.parameters()
            if p.owner == "recording"
            and getattr(self, p.name) is None
            and not (p.known and view is not None and getattr(view, p.known) is not None)
        )

    def draw(self, rng: np.random.Generator) -> Self:
        """Return the effect with unknown per-recording parameters drawn from their prior."""
        drawn = {}
        for p in self.parameters():
            if p.prior is not None:
                value = float(rng.uniform(*p.prior))  # drawn even where known: keeps the stream
                if getattr(self, p.name) is None:
                    drawn[p.name] = value
        return self.with_parameters(drawn) if drawn else self

    def shared(self) -> Self:
        """Return the effect with its per-recording parameters unknown (None)."""
        return self.with_parameters(
            {p.name: None for p in self.parameters() if p.owner == "recording"}
        )

    def _integrated(self, law: Law, view: View) -> Law:
        """Average over the priors of the unknown parameters by moments."""
        laws = []
        names = self.undrawn(view)
        for i in range(AVERAGED):
            values = {}
            for axis, name in enumerate(names):
                low, high = self.parameter(name).prior or (0.0, 0.0)
                # midpoints of strata, in another order along each axis
                share = ((i * (2 * axis + 1) + axis) % AVERAGED + 0.5) / AVERAGED
                values[name] = low + share * (high - low)
            laws.append(self.with_parameters(values).changed(law, view))
        return Law.average(laws)

    # ---- to and from sensor.yaml

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], *, where: str = "effects") -> Self:
        """Build the effect from an entry of a sensor's `effects`.

        Raises
        ------
        RecipeError
            For an unknown key, a value of another type, or a value out of its bounds.
        """
        values = {key: value for key, value in mapping.items() if key != "name"}
        try:
            cls._refuse_unknown(values)
            return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
        except RecipeError as error:
            raise RecipeError(str(error), where=where) from None

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry of a sensor's `effects` without keys that are None."""
        values = {p.name: getattr(self, p.name) for p in self.parameters()}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        return {"name": self.name, **{k: v for k, v in plain.items() if v is not None}}

    @classmethod
    def _refuse_unknown(cls, values: Mapping[str, Any]) -> None:
        names = [p.name for p in cls.parameters()]
        for key in values:
            if key not in names:
                raise RecipeError(
                    f"effect {cls.name} has no parameter '{key}'", **known(key, names)
                )

    def __post_init__(self) -> None:
        for p in self.parameters():
            value = getattr(self, p.name)
            if value is None and (p.typical is None or p.sheet or p.owner == "recording"):
                continue
            if not p.fits(value):
                raise RecipeError(
                    f"{p.name} of effect {self.name}", value=value, allowed=p.bounds_text
                )
