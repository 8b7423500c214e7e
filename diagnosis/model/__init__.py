"""A model of the recordings with its readings: log density, shrinkage at depth edges."""
