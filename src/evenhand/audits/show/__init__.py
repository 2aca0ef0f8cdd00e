"""Findings as sentences, tables, figures and a card."""
