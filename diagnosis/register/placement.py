"""A placement: the correction of the commanded poses of one recording, nine numbers."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from diagnosis.fields import Field
from diagnosis.register.pose_derivative import travel_columns, turned_ways
from diagnosis.settings import SETTINGS

PRIOR_SD = np.array(SETTINGS.register.prior_sd())
"""How far a commanded pose may be off: mm, radians, share of the travel, its direction.

What turns with a part's tilt isn't told apart by flat faces, so that a wider prior would bend the
travel for nothing; where readings tell, it hardly matters.
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Placement:
    """A correction of all poses of one recording.

    A part that lies elsewhere moves all poses alike; a sensor that sits askew on its stage travels
    in another direction than its axes say.

    Attributes
    ----------
    shift : (9,) float64
        Translation (part frame, mm), rotation vector about `centre_mm` (part frame, rad), scale
        of the travel, and its turn towards the sensor's x and z (rad).
    centre_mm : (3,) float64
        Centre of the hits, part frame.
    covariance : (9, 9) float64
        Of the shift, with readings counted as independent.
    poses : (n, 4, 4) float64
        The commanded poses with the correction applied.
    """

    shift: Field
    centre_mm: Field
    covariance: Field
    poses: Field

    def moved_by(self, steps: Field) -> "Placement":
        """Return the placement with its poses moved by a shift (9,), in prior deviations."""
        return replace(
            self,
            shift=self.shift + PRIOR_SD * steps,
            poses=move(self.poses, PRIOR_SD * steps, self.centre_mm),
        )

    def further(self, steps: Field) -> "Placement":
        """Return the placement with a small shift (9,), in prior deviations, added."""
        return replace(self, shift=self.shift + PRIOR_SD * steps)


def move(poses: Field, shift: Field, centre_mm: Field) -> Field:
    """Apply a correction (9,) to commanded poses (n, 4, 4)."""
    moved = poses.copy()
    moved[:, :3, 3] += travel_columns(poses) @ shift[6:]
    turn = Rotation.from_rotvec(shift[3:6]).as_matrix()
    moved[:, :3, :3] = turn @ moved[:, :3, :3]
    moved[:, :3, 3] = (moved[:, :3, 3] - centre_mm) @ turn.T + centre_mm + shift[:3]
    return moved


def move_all(poses: Field, subset: Field, shift: Field, centre_mm: Field) -> Field:
    """Apply a correction found on a subset of profiles: its travel counts from their mean."""
    still = np.zeros(6)
    moved = move(poses, np.concatenate([still, shift[6:]]), centre_mm)
    behind = poses[:, :3, 3].mean(axis=0) - subset[:, :3, 3].mean(axis=0)
    moved[:, :3, 3] += (turned_ways(behind[None], poses) @ shift[6:])[0]
    return move(moved, np.concatenate([shift[:6], np.zeros(3)]), centre_mm)
