"""Many scans: the plan, units of work, processes and clusters."""
