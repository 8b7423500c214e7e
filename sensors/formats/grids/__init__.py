"""Heights on a grid: arrays, images, and the binary files of profilometers."""
