"""The comparison of methods in every scenario."""
