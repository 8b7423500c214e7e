"""Motion of the sensor: limits, aim, and the path of poses."""
