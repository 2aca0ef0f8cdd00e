"""The server of a questionnaire and its database."""
