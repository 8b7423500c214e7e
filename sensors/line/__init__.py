"""The laser line: its width, its motion, its light on the camera."""
