"""Sealed cases diagnosed without their keys, and the further scans that a diagnosis proposes."""
