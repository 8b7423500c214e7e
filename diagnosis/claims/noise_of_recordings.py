"""The noise of each recording, off edges: what claims on the surface and the firmware compare."""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.ndimage import binary_dilation

from diagnosis.data.patch import Patch
from diagnosis.fields import Field, Mask
from diagnosis.model.log_density import Whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel, calibrate
from diagnosis.settings import SETTINGS


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class OffEdges:
    """What a recording reads off edges: what light leaves along these has their direction.

    Attributes
    ----------
    states : residuals of the patches under a model
    masks : readings off edges
    """

    patches: tuple[Patch, ...]
    states: tuple[Whitened, ...]
    masks: tuple[Mask, ...]

    def noise(self, nominal: NoiseModel) -> NoiseModel:
        """Measure the noise over what the model has; `sd_mm` is its share.

        Parameters
        ----------
        nominal : at whose pitch
        """
        return measured([s.residual_mm / s.sd_mm for s in self.states], self.masks, nominal)


def measured(fields: Sequence[Field], masks: Sequence[Mask], like: NoiseModel) -> NoiseModel:
    """Measure the noise of fields at another one's pitch."""
    return calibrate(
        fields, masks, pitch_mm=(like.pitch_x_mm, like.pitch_y_mm), missing_share=0.0,
    )  # fmt: skip


def off_edges(ws: Workspace, model: Model) -> list[OffEdges]:
    """Look at each recording with enough readings."""
    states = ws.states(ws.predict(model))
    found = []
    for number in sorted({p.recording for p in ws.patches}):
        members = [
            (p, s) for p, s in zip(ws.patches, states, strict=True) if p.recording == number
        ]
        masks = tuple(
            p.fit & s.used & ~binary_dilation(p.edge, iterations=SETTINGS.claims.lay_off_edges)
            for p, s in members
        )
        if sum(int(m.sum()) for m in masks) >= SETTINGS.claims.lay_readings:
            patches, theirs = zip(*members, strict=True)
            found.append(OffEdges(patches=patches, states=theirs, masks=masks))
    return found
