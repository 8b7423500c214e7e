"""A real flaw out of a recording: its relief, denoised, and a picture of it."""
