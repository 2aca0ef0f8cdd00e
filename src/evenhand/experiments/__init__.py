"""The paper end to end; imported by the command line only."""
