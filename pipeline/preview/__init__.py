"""Pictures of scans and recipes."""
