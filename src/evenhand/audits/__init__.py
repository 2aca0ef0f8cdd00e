"""Audits of foreign logs: from any source to findings, a card and an alarm."""
