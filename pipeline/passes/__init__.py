"""Passes over a part, planned for coverage."""
