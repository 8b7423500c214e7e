"""The two kinds of speckle that a scan may have: Perlin's, or one of a measured autocorrelation."""

from sensors.noise.measured_field import MeasuredField
from sensors.noise.perlin import PerlinField

Speckle = PerlinField | MeasuredField
