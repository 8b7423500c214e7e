"""Checked inputs, recordings and patches of them, reference plates, brightness, albedo."""
