"""Files of TOML that people write: every mistake is told at once, with its line."""
