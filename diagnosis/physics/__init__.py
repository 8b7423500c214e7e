"""The laws of named causes: fit, remainder beside it, intervals of its numbers."""
