"""The questionnaire: protocol, orders of clips."""
