"""Readings under a model: prediction, expectation at depth edges, log density."""
