"""Parts: closed solids in millimetres, built in or read from mesh files."""
