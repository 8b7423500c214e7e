"""Whitened signal to noise of what formulas change, pose projected out, edges included.

The pose is where the part lies, which every diagnosis has to fit: turned and shifted in its own
frame, so that a tilt along the travel is none of a drift's or a bend's signal. The noise's
covariance is known exactly (speckle.py), so that this is a closed calculation: sqrt of twice the
expected log likelihood ratio between the recordings with and without the change.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import xlogy

from benchmarks.other_formulas.instrument import MISPLACED_MM, MISPLACED_RAD, PITCH_MM
from benchmarks.other_formulas.shot import Shot
from benchmarks.other_formulas.speckle import Covariance

Floats = NDArray[np.float64]
EDGE_CAP_SD = 4.0
"""At an edge a reading may be off by millimetres; it counts as one outlier, about 8 nats."""
EDGE_PLACE_MM = 0.03
"""No mesh and no travel is surer of an edge's place; a reading there is uncertain accordingly."""
OUTLIER_SD, OUTLIER_SHARE = 4.0, 5e-4
"""Where a reading counts as an outlier, and how many of them good instruments have."""


class Hidden:
    """One recording as its instrument should be, ready to measure changes of it."""

    def __init__(self, nominal: Shot) -> None:
        view = nominal.view
        self.nominal, self.sd = nominal, view.instrument.noise_mm
        self.use = np.isfinite(nominal.mean)
        self.edge = view.edge
        near = EDGE_PLACE_MM * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        jump = np.max([np.abs(np.nan_to_num(view.cast(*d) - view.depth)) for d in near], axis=0)
        self.weight = np.where(self.edge, 1 / np.hypot(1.0, jump / self.sd), 1.0)
        self.covariance = Covariance(nominal.noise, self.use)
        self.columns = self._rigid(self.moved)
        self.solved = np.stack([self.covariance.solve(c) for c in self.columns])
        self.gram = self.columns @ self.solved.T

    def capped(self, change_mm: Floats) -> Floats:
        """Change (n, m) in standard deviations over the used readings, edges capped."""
        z = np.nan_to_num(change_mm / self.sd)
        return np.asarray(
            np.where(self.edge, self.weight * np.clip(z, -EDGE_CAP_SD, EDGE_CAP_SD), z)[self.use]
        )

    def _rigid(self, moved: Callable[[Floats], Floats]) -> Floats:
        """Change with each rigid movement, by central differences.

        Shifts are of half a pitch, so that an edge's readings flip in proportion to them.
        """
        steps = np.diag([1e-3, 1e-3, PITCH_MM / 40, PITCH_MM / 2, PITCH_MM / 2, 1e-2])
        return np.stack([
            (self.capped(moved(step)) - self.capped(moved(-step))) / (2 * step.sum())
            for step in steps
        ])  # fmt: skip

    def moved(self, rigid: Floats) -> Floats:
        """Change of the depth (n, m) with a movement (3 rad, 3 mm) of the part, mm.

        About its origin, which is in the middle of it.
        """
        view = self.nominal.view
        return np.asarray(
            view.seen_from(_movement(rigid, np.zeros(3)) @ view.scan.true_poses) - view.depth
        )

    def seated(self, rigid: Floats) -> Floats:
        """Change of the depth (n, m) with a movement (3 rad, 3 mm) of the sensor, mm.

        About the middle of its measuring range.
        """
        view = self.nominal.view
        return np.asarray(
            view.seen_from(view.scan.true_poses @ _movement(rigid, self.middle)) - view.depth
        )

    @property
    def middle(self) -> Floats:
        """Middle of the measuring range, sensor frame, mm: about which movements turn."""
        return np.array([0.0, 0.0, self.nominal.view.instrument.sheet.working_distance_mm])

    def misplaced(self, shot: Shot) -> float:
        """Square of a shot's mounting over how parts lie off by chance and what readings settle."""
        if shot.mounting is None:
            return 0.0
        turn = shot.mounting[:3, :3]
        shift = shot.mounting[:3, 3] - self.middle + turn @ self.middle
        rigid = np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift])
        unit = np.repeat([MISPLACED_RAD, MISPLACED_MM], 3)
        # (U² + G⁻¹)⁻¹ without G⁻¹: a part may leave a direction open
        columns = self._rigid(self.seated)
        gram = columns @ np.stack([self.covariance.solve(c) for c in columns]).T
        gram = unit[:, None] * gram * unit
        rigid = rigid / unit
        return float(rigid @ np.linalg.solve(np.eye(6) + gram, gram @ rigid))

    def nats(self, shot: Shot) -> float:
        """Return the expected log likelihood ratio of the change, over all channels."""
        return (
            self._mean(shot) + self._spread(shot) + self._missing(shot) + self._outliers(shot)
        )

    def _mean(self, shot: Shot) -> float:
        """Of means: the least that any of the placements tried leaves, each refined linearly.

        At a steep wall a reading isn't linear in the placement; so the part is cast again at the
        placement that fits the change, by all readings and by those off edges.
        """
        change = shot.mean - self.nominal.mean
        s = self.capped(change)
        if not s.any():
            return 0.0
        off = ~self.edge[self.use]
        smooth = np.linalg.lstsq((self.columns * off).T, s * off, rcond=1e-8)[0]
        every = np.linalg.solve(self.gram, self.solved @ s)
        moved = [self.capped(change - self.moved(b)) for b in (smooth, every)]
        return 0.5 * min(self.whitened_square(one) for one in (s, *moved))

    def whitened_square(self, s: Floats) -> float:
        """Whitened square of a change, the placement projected out."""
        white = self.covariance.solve(s)
        along = self.columns @ white
        return float(s @ white - along @ np.linalg.solve(self.gram, along))

    def _spread(self, shot: Shot) -> float:
        """Of sizes of the noise: a field's Kullback-Leibler divergence, by Whittle's spectrum."""
        ratio = np.broadcast_to(shot.scale, self.use.shape)[self.use] ** 2
        if shot.noise is self.nominal.noise:
            return 0.5 * float((ratio - 1 - np.log(ratio)).sum())
        shape = self.use.shape
        power = shot.noise.spectrum(shape) / self.nominal.noise.spectrum(shape) * ratio.mean()
        share = self.use.mean()
        return 0.5 * share * float((power - 1 - np.log(power)).sum())

    def _missing(self, shot: Shot) -> float:
        p = np.broadcast_to(shot.p_missing, self.use.shape)[self.use]
        q = np.broadcast_to(self.nominal.p_missing, self.use.shape)[self.use]
        area = 1.0 if shot.clump is None else float(shot.clump.sum() ** 2)
        return _bernoulli(p, q) / max(area, 1.0)

    def _outliers(self, shot: Shot) -> float:
        if shot.outlier is None:
            return 0.0
        sizes = shot.outlier((400, 50), np.random.default_rng(0))
        far = float((np.abs(sizes) > OUTLIER_SD * self.sd).mean())
        share = np.broadcast_to(shot.p_outlier, self.use.shape)[self.use] * far
        q = np.full(share.shape, OUTLIER_SHARE)
        return _bernoulli(np.maximum(share, 0) + OUTLIER_SHARE, q)


def _movement(rigid: Floats, about: Floats) -> Floats:
    """Turn (rad) about a point (mm), then shift (mm), as a matrix (4, 4)."""
    out = np.eye(4)
    out[:3, :3] = Rotation.from_rotvec(rigid[:3]).as_matrix()
    out[:3, 3] = about - out[:3, :3] @ about + rigid[3:]
    return out


def _bernoulli(p: Floats, q: Floats) -> float:
    p = np.clip(p, 0, 1)
    return float((xlogy(p, p / q) + xlogy(1 - p, (1 - p) / (1 - q))).sum())


def signal_to_noise(hidden: Sequence[Hidden], shots: Sequence[Shot]) -> float:
    """Whitened signal to noise over recordings."""
    nats = sum(h.nats(s) for h, s in zip(hidden, shots, strict=True))
    return float(np.sqrt(2 * max(nats, 0.0)))


def mounting_signal(hidden: Sequence[Hidden], shots: Sequence[Shot]) -> float:
    """Signal to noise of a common misplacement against how parts lie off by chance."""
    return float(np.sqrt(sum(h.misplaced(s) for h, s in zip(hidden, shots, strict=True))))
