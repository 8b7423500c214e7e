"""Components: the relaxed form of each cause, as columns of a linear model."""
