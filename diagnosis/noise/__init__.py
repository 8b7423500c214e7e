"""The noise of the readings: size, correlation and tails, and whitening."""
