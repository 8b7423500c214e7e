"""A second family of instruments: laser inclined, telecentric camera upright, LED line.

It shares no optics with the first: other light, other scattering, other lens, other finders,
firmware that rectifies. Only the caster of rays against a mesh is common.
"""
