"""Sealed sets of cases: drawn, rendered, committed to before anything is diagnosed."""
