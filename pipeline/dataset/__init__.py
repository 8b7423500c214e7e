"""The dataset on disk: shards, manifest, checksums, export."""
