"""Noise of a scan: Perlin speckle calibrated to measured figures, spectra, uncertainty."""
