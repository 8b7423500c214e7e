"""What a data scientist tries first: figures of residuals, a gradient-boosted classifier."""
