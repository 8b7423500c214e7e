"""The sealed proof: an independent image-level instrument, sealed cases and their judge."""
