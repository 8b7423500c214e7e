"""Registration: where the part lay and how the travel went, before and under a model."""
