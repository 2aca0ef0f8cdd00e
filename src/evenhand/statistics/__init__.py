"""Statistics of unevenness: what chance explains, how sure a gap is, how many services it takes."""
