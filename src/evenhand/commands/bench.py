"""``evenhand bench``."""

from __future__ import annotations

import json
from dataclasses import dataclass

from evenhand.commands import inputs


@dataclass(frozen=True)
class Bench:
    """Measure speed, side by side in one run.

    Ratios are against a bare mj_step loop over the same model and the same drives, and against
    Gymnasium's SyncVectorEnv over the single environment.
    """

    json: bool = False
    """Print JSON instead of a table."""

    seconds: float = 15.0
    """For each of the four things that are measured, in turns of a quarter of a second."""

    def run(self, command: str) -> int:
        """Measure and print."""
        inputs.load_physics()
        from evenhand import bench
        from evenhand.learn.runtime import set_up_jax

        set_up_jax()
        found = bench.measure(self.seconds)
        if self.json:
            print(json.dumps(found))
        else:
            bench.show(found)
        return 0
