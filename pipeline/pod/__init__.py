"""Probability of detection against the size of a flaw (MIL-HDBK-1823A)."""
