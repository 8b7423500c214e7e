"""The laser and the first hits of its rays on a part."""
