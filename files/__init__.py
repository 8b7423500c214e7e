"""Files and what users write: read within budget, checked, written whole; errors of one line."""
