"""Candidates of placement: the same for every model, so that none is judged from a better place.

A recording lies where the nominal model registers it, or where the model that was found does. Under
either model it is placed from each of these by its readings, cast anew there, and the placement of
the largest density is taken.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from diagnosis.data.patch import Patch
from diagnosis.data.recorded import Recorded
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.assumed_camera import seen_by
from diagnosis.register.placement import Placement
from diagnosis.reregister.reregistration import by_all_readings, log_density
from diagnosis.validate.heldout import with_own
from sensors.view.view_cache import ViewCache


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Place:
    """A placement of one recording and the recording looked at from there."""

    placement: Placement
    patches: tuple[Patch, ...]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Placed:
    """Where the recordings lie under a model.

    Attributes
    ----------
    places : of each recording
    model : with each recording's own parameters, held-out ones included
    shifts : residual of each placement to first order, in prior deviations
    """

    places: tuple[Place, ...]
    model: Model
    shifts: Mapping[int, Field]

    @property
    def patches(self) -> list[Patch]:
        """All patches."""
        return [p for place in self.places for p in place.patches]

    @property
    def held(self) -> list[Patch]:
        """Patches with readings that nothing was fitted to."""
        return [p for p in self.patches if p.scored.any()]


_PLACED: ViewCache[Placed] = ViewCache(4)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False, weakref_slot=True)
class Candidates:
    """Places of each recording.

    Attributes
    ----------
    share_own : whether a part of the held-out readings serves each recording's own parameters
    """

    recorded: Recorded
    noise: NoiseModel
    places: tuple[tuple[Place, ...], ...]
    share_own: bool

    def placed(self, model: Model) -> Placed:
        """Place each recording where its readings are most probable under a model."""
        return _PLACED.get(self, model.key, lambda: self._placed(model))

    def _placed(self, model: Model) -> Placed:
        places = tuple(self._best(number, model) for number in range(len(self.places)))
        patches = [p for place in places for p in place.patches]
        model = with_own(patches, self.noise, model, share_own=self.share_own)
        return Placed(
            places=places, model=model, shifts=by_all_readings(patches, self.noise, model)
        )

    def held(self, model: Model) -> list[Patch]:
        """Patches with readings that nothing was fitted to, where they lie under a model."""
        return self.placed(model).held

    def _best(self, number: int, model: Model) -> Place:
        known = [(self._density(place, model), place) for place in self.places[number]]
        density, best = max(known, key=lambda one: one[0])
        own = with_own(best.patches, self.noise, model, share_own=self.share_own)
        shift = by_all_readings(best.patches, self.noise, own)[number]
        there = place_at(self.recorded, number, best.placement.moved_by(shift))
        return there if self._density(there, model) > density else best

    def _density(self, place: Place, model: Model) -> float:
        own = with_own(place.patches, self.noise, model, share_own=self.share_own)
        return log_density(place.patches, self.noise, own)


def place_at(recorded: Recorded, number: int, placement: Placement) -> Place:
    """Look at a recording from a placement."""
    return Place(placement=placement, patches=tuple(recorded.cut(number, placement)))


def candidates_of(
    recorded: Recorded,
    nominal: Mapping[str, Placement],
    found: Mapping[str, Placement],
    patches: tuple[Sequence[Patch], Sequence[Patch]],
    noise: NoiseModel,
    *,
    share_own: bool,
) -> Candidates:
    """Gather where each recording may lie: registered nominally, and under the model.

    Parameters
    ----------
    nominal, found : placements by name, registered under the nominal model and under the other
    patches : the recordings looked at from these
    """
    # a sensor's file may have been completed since the first look
    patches = seen_by(patches[0], recorded.datasheet), patches[1]
    places = []
    for number, recording in enumerate(recorded.recordings):
        one, two = (
            Place(
                placement=placed[recording.name],
                patches=tuple(p for p in own if p.recording == number),
            )
            for placed, own in zip((nominal, found), patches, strict=True)
        )
        places.append((one,) if two.placement is one.placement else (one, two))
    return Candidates(
        recorded=recorded, noise=noise, places=tuple(places), share_own=share_own
    )
