"""Where recordings depart: maps, regions, residual structure."""
