"""Answers to agreement, quality, a report and a detector."""
