"""A small flaw segmenter: gradient-boosted trees on local features of the depth image.

Everything about it was fixed before any test recording was scored, and is the same for all
sets of training data.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, gaussian_filter, median_filter, uniform_filter1d

Floats = NDArray[np.float64]

SETTINGS: dict[str, Any] = {
    "max_iter": 100,
    "learning_rate": 0.1,
    "max_leaf_nodes": 24,
    "min_samples_leaf": 40,
    "l2_regularization": 1.0,
    "early_stopping": False,
}
FLAW_POINTS = 1200  # most that are drawn of a scan for training
PLAIN_POINTS = 2400
FEATURES = 24
_SCALES = (1.0, 2.0, 4.0, 8.0)  # points


def smoothed(values: Floats, valid: NDArray[np.bool_], scale: float) -> tuple[Floats, Floats]:
    """Gaussian means over valid points, and the share that is valid."""
    weight = gaussian_filter(valid.astype(np.float64), scale, truncate=3)
    total = gaussian_filter(np.where(valid, values, 0.0), scale, truncate=3)
    return np.where(weight > 0.02, total / np.maximum(weight, 1e-9), np.nan), weight


def _curvatures(values: Floats) -> tuple[Floats, Floats]:
    """Second differences: largest and smallest over all directions."""
    two = np.array([1.0, -2.0, 1.0])
    one = np.array([-0.5, 0.0, 0.5])
    yy = correlate1d(values, two, axis=0, mode="nearest")
    xx = correlate1d(values, two, axis=1, mode="nearest")
    xy = correlate1d(correlate1d(values, one, axis=0, mode="nearest"), one, axis=1, mode="nearest")
    mean, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return mean + half, mean - half


def features(depth_mm: NDArray[np.floating]) -> NDArray[np.float32]:
    """Describe each point by its surroundings at several scales.

    Parameters
    ----------
    depth_mm : (n, m)
        Reading, NaN where missing.

    Returns
    -------
    (n, m, f) float32
        Heights in mm; NaN where nothing is near.
    """
    depth = np.asarray(depth_mm, np.float64)
    valid = np.isfinite(depth)
    if not valid.any():
        return np.full((*depth.shape, FEATURES), np.nan, np.float32)
    rows, columns = np.indices(depth.shape)
    # take a plane away, so that sums keep their digits and gaps pull less
    design = np.stack([np.ones(depth.shape), rows / 100.0, columns / 100.0], -1)
    found = np.linalg.lstsq(design[valid], depth[valid], rcond=None)[0]
    depth = depth - design @ found
    # one robust reading for each 5 x 5 points keeps spikes out of the means
    filled = np.where(valid, depth, smoothed(depth, valid, 2.0)[0])
    filled = np.where(np.isfinite(filled), filled, 0.0)
    middle = median_filter(filled, size=5, mode="nearest")
    tame = np.clip(filled, middle - 0.15, middle + 0.15)
    means, shares = zip(*(smoothed(tame, valid, s) for s in _SCALES), strict=True)
    layers = [depth - middle, tame - means[1]]
    for fine, coarse in ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3)):
        layers.append(means[fine] - means[coarse])
    for mean in means[:3]:
        layers.extend(_curvatures(mean))
    layers += [np.hypot(*np.gradient(mean)) for mean in means[1:3]]
    rough = np.where(valid, (tame - means[1]) ** 2, 0.0)
    layers += [np.sqrt(np.maximum(smoothed(rough, valid, s)[0], 0)) for s in (1.0, 3.0, 8.0)]
    layers += [shares[0], shares[2]]
    # what the whole profile and the whole column share
    rest = means[0] - means[3]
    layers.append(np.broadcast_to(_median(rest, 1), depth.shape))
    layers.append(np.broadcast_to(_median(rest, 0), depth.shape))
    # along the line and along the travel
    for axis in (0, 1):
        layers.append(uniform_filter1d(np.nan_to_num(rest), 15, axis=axis, mode="nearest"))
    return np.stack(layers, -1).astype(np.float32)


def _median(values: Floats, axis: int) -> Floats:
    """Median over rows or columns; 0 where all is missing."""
    some = np.isfinite(values).any(axis=axis, keepdims=True)
    return np.asarray(np.nanmedian(np.where(some, values, 0.0), axis=axis, keepdims=True))


def booster() -> Any:
    """Return scikit-learn's class of boosted trees.

    Raises
    ------
    ValueError
        Where scikit-learn isn't installed.
    """
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
    except ImportError:
        raise ValueError("the payoff needs scikit-learn: pip install 'flawforge[payoff]'") from None
    return HistGradientBoostingClassifier


def draw_points(
    layers: NDArray[np.float32], instance: NDArray[np.int16], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Draw points of a scan to train on: (k, f) and whether each lies on a flaw."""
    flat, labels = layers.reshape(-1, layers.shape[-1]), instance.ravel()
    some = []
    for chosen, most in ((labels > 0, FLAW_POINTS), (labels == 0, PLAIN_POINTS)):
        all_of = np.flatnonzero(chosen)
        some.append(rng.permutation(all_of)[:most])
    pick = np.concatenate(some)
    return flat[pick], labels[pick] > 0


def train(
    scans: list[tuple[NDArray[np.float32], NDArray[np.int16]]], rng: np.random.Generator
) -> Any:
    """Train on features and labels of scans; returns a scikit-learn classifier."""
    drawn = [draw_points(layers, instance, rng) for layers, instance in scans]
    model = booster()(**SETTINGS, random_state=int(rng.integers(2**31)))
    return model.fit(np.concatenate([d[0] for d in drawn]), np.concatenate([d[1] for d in drawn]))


def suspicion(model: Any, layers: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much each point looks like a flaw, 0 to 1, (n, m)."""
    flat = layers.reshape(-1, layers.shape[-1])
    return np.asarray(model.predict_proba(flat)[:, 1], np.float32).reshape(layers.shape[:-1])
