"""Flaws that are cut into a closed mesh, one file for each kind."""
