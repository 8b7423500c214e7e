"""Laser profilometers: datasheet, geometry, ray casting, noise, law of each reading."""
