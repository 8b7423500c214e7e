"""Registration again under a model: with its effects, and by what it predicts at edges."""
