"""Counts of issues, waits and measures by group, on any engine."""
