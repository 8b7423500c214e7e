"""The reliability campaign: mutated inputs, damaged datasets, killed runs."""
