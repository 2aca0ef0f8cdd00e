"""Findings: tests, intervals and verdicts on counts."""
