"""Clips: services drawn from recorded poses, with signs in the picture, as MP4."""
