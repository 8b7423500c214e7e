"""From a recipe to a dataset: parts, injection, trajectory, scan, noise, shards, manifest."""

from pathlib import Path

from pipeline.loop_cache import keep_loops

keep_loops(Path(__file__).parent)  # before anything loads numba
