"""Flaws that are cut into a closed mesh: their kinds, their shapes and the carving."""
