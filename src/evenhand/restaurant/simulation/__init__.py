"""The physics of many services at once."""
