"""What is left of an explanation that held-out readings refute: curves, or no name at all."""

from dataclasses import replace

from diagnosis.components.free_curve import Curve
from diagnosis.evidence.reported_causes import unnamed
from diagnosis.explanation import Explanation, under
from diagnosis.model.model import Model
from diagnosis.physics.remainder import curves_of
from diagnosis.prepare import Prepared

LAW_REFUTED = "Readings held out depart as well, but not by its law: the formula is another."


def with_free_curves(explanation: Explanation, ready: Prepared) -> Explanation:
    """Put the curves by which causes were weighed in place of all laws.

    The rest has no name, but for what readings held out show by themselves.
    """
    curves = {
        m.candidate.effect: m for m in explanation.members if m.candidate.component.is_curve
    }
    kept = tuple(
        c.doubted("Its law is refuted by readings held out; the curve that it follows is kept.")
        for c in explanation.causes if c.name in curves
    )  # fmt: skip
    curve = Curve()
    for cause in kept:
        own = curves_of(curves[cause.name], explanation.first, ready.noise.sd_mm)
        curve = curve.beside(own)
    model = Model(curve=curve)
    others = tuple(c for c in explanation.causes if c.name not in curves)
    plain = without_names(replace(explanation, causes=others), ready)
    return under(model, replace(plain, causes=(*kept, *plain.causes)), ready)


def without_names(explanation: Explanation, ready: Prepared) -> Explanation:
    """Take all laws back: what their components show has no name.

    Where readings held out show it by themselves, it keeps its name without a law.
    """
    kept = tuple(c.doubted(LAW_REFUTED) for c in explanation.causes if c.shown_again)
    rest = [c for c in explanation.causes if not c.shown_again]
    left = (*unnamed(rest), *explanation.unexplained)
    return under(Model(), replace(explanation, causes=kept, unexplained=left), ready)
