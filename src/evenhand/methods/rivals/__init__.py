"""Published ways to learn evenness."""
