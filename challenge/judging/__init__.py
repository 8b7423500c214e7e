"""Opened keys against answers: scores of a case and of a set."""
