"""Labelled laser-profilometer scans of flawed parts: all that a user imports or types."""
