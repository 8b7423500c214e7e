"""Geometry at each point of a scan: slopes, visibility, edges, creases, covariates."""
