"""From a recipe to a dataset: parts, injection, trajectory, scan, noise, shards, manifest."""
