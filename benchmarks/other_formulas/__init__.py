"""Recordings made by formulas that are not the catalogue's, and how well they are diagnosed.

Each effect is made by at least two formulas of its own; nothing of `sensors/effects` or of the
diagnosis is used. The diagnosis sees files and answers with files.
"""
