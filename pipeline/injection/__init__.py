"""Flaws in parts: what is planned, placed, carved and recorded."""
