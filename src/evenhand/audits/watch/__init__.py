"""A growing log and its alarm."""
