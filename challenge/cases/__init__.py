"""Sealed cases: parts, instruments, what is missing in them, and the files strangers get."""
