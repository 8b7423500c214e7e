"""Every number of the diagnosis that is no derived one: value, unit, and where it comes from."""

from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings:
    """Numbers of the evidence."""

    decay: float = 1.0
    order_1d: int = 6
    order_2d: int = 5
    order_3d: int = 6
    harmonics: int = 3
    row_harmonics: int = 3
    prior_cause: float = 0.02
    prior_unknown: float = 0.01
    least_mean_size: float = 0.001
    mean_steps: int = 15
    doubt: float = 0.03
    clip: float = 4.0
    reported: float = 0.5
    offered: float = 0.05
    fitted_readings: int = 80_000
    explained_share: float = 0.3
    assumed_angles_deg: tuple[float, ...] = (20.0, 30.0, 40.0)
    rounds: int = 3
    unseen: float = 1.0
    placed: int = 3
    small_sizes: int = 3
    most_causes: int = 6
    band_step: float = 0.5
    least_cycles: float = 2.5
    envelope: int = 2
    spanned: int = 3
    pitches: int = 2
    unknown_pitches: int = 200

    least_readings: int = 200
    ambiguous: float = 0.01
    sharp: float = 0.3
    cells: int = 32
    level_sd: dict = field(default_factory=lambda: {"scale": (1.0, 1.0), "missing": (0.2, 3.0), "outliers": (0.2, 3.0)})
    least_rate_size: float = 0.01
    rate_steps: int = 10

    def as_json(self) -> dict[str, object]:
        """Return every number for diagnosis.json."""
        return asdict(self)

    def rate_sizes(self) -> NDArray[np.float64]:
        """Grid of sizes of the linear predictor's change."""
        return self.least_rate_size * 2.0 ** np.arange(self.rate_steps)

    def mean_sizes(self) -> NDArray[np.float64]:
        """Grid of sizes (whitened rms) of the mean's components."""
        return self.least_mean_size * 2.0 ** np.arange(self.mean_steps)

    def log_odds(self, effect: str) -> float:
        """Log odds of a cause before any reading."""
        p = self.prior_cause if effect else self.prior_unknown
        return float(np.log(p / (1 - p)))

    def orders(self, dimensions: int) -> tuple[int, ...]:
        """Highest order along each covariate."""
        if dimensions == 1:
            return (self.order_1d,)
        if dimensions == 2:
            return (self.order_2d, self.order_2d)
        return (self.order_3d,) * dimensions


SETTINGS = Settings()
