"""The report: one page with its pictures."""
