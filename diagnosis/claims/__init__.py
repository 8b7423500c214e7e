"""Recordings against claims: surface texture, firmware, mounting of the sensor, delivery."""
