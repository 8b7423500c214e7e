"""From a recipe to a labelled dataset: parts, injection, trajectory, scan, noise, shards, manifest."""
