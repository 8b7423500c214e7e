"""The surface that a flaw follows: nearest points, smooth normals, walks."""
