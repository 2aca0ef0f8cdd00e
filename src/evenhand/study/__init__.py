"""The study behind the detector: who judges robots, and how they are asked."""
