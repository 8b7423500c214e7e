"""Point clouds, organised or not, as height maps."""
