"""Laser profilometers: datasheet, geometry, ray casting, noise and the law of a reading."""
