"""Seats of kinds of flaws: the skin, feature edges, rims of holes."""
