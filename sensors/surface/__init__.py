"""The surface as the sensor sees it: roughness, form removal, albedo."""
