"""Services as a Minari dataset."""
