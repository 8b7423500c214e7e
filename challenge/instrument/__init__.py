"""A virtual laser profilometer at image level: effects emerge from optics, motion and readout."""
