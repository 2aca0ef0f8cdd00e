"""How many processors there are; imports nothing heavy."""

from __future__ import annotations

import os

CORES = len(os.sched_getaffinity(0))
"""Processors that this process may use."""
THREADS = (1, 256)
"""Fewest and most threads of one batch of simulations."""
