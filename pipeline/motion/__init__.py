"""Where the sensor goes: limits, aim, and the path of poses."""
