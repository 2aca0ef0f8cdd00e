"""Logs of any source as columns."""
