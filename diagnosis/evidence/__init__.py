"""Evidence: which components the readings need, by marginal likelihoods of one linear model."""
