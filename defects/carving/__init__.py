"""Solids carved and put together: the booleans, what is around them, the wall that stays."""
