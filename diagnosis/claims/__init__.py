"""Recordings against claims: plates, surface texture, firmware, mounting; repeated profiles."""
