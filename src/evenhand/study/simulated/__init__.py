"""Simulated respondents and participants."""
