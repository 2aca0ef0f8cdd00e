"""Pictures of the restaurant."""
