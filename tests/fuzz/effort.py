"""How much is tried: seconds in `make test`, FUZZ examples a test in `make fuzz`."""

import os
from datetime import timedelta

from hypothesis import HealthCheck, settings

LONG = int(os.environ.get("FUZZ", "0"))


def effort(examples: int) -> settings:
    """Return settings; a long run draws fresh examples and keeps those that fail."""
    return settings(
        max_examples=LONG or examples, derandomize=not LONG, deadline=timedelta(seconds=60),
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
