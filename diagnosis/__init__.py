"""Where a recording differs from its simulation, and which physics was left out."""
