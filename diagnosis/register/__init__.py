"""Registration under the nominal model: where the part lay, how the travel went."""
