"""What good instruments have of each component, by kinds of instruments."""
