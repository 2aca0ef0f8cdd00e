"""``evenhand bench``."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from evenhand.commands import inputs
from evenhand.errors import InputError


@dataclass(frozen=True)
class Bench:
    """Measure speed, side by side in one run."""

    json: bool = False
    """Print JSON instead of tables."""

    what: Literal["env", "audit", "film", "adapters", "study", "sweep", "sb3", "all"] = "all"
    """What is measured.
    env: physics steps against a bare mj_step loop over the same room and the same drives, and
    against Gymnasium's SyncVectorEnv over the single environment, with a thread for each processor
    and with one; an epoch of training.
    audit: ten million and one million services from Parquet, and Fairlearn's MetricFrame on the
    million.
    film: clips, and what recording them costs.
    adapters: what wrapping an environment costs.
    study: the analysis of a study of 10,000 participants.
    sweep: what a sweep of 16 runs costs beside its runs.
    sb3: training one arm beside Stable-Baselines3; five minutes.
    all: one after the other; sb3 where its extra is installed."""

    seconds: float = 15.0
    """For each of the six things that are measured of the environment, in turns of a quarter of a
    second."""

    def run(self, command: str) -> int:
        """Measure and print."""
        found: dict[str, Any] = {}
        parts = {
            "env": self._env,
            "audit": self._audit,
            "film": self._film,
            "adapters": self._adapters,
            "study": self._study,
            "sweep": self._sweep,
            "sb3": self._sb3,
        }
        for name, part in parts.items():
            if self.what in (name, "all"):
                found |= part()
        if self.json:
            print(json.dumps(found))
        return 0

    def _shown(
        self, found: dict[str, Any], show: Callable[[dict[str, Any]], None]
    ) -> dict[str, Any]:
        if not self.json:
            show(found)
        return found

    def _env(self) -> dict[str, Any]:
        inputs.load_physics()
        from evenhand import bench
        from evenhand.learn.runtime import set_up_jax

        set_up_jax()
        return self._shown(bench.measure(self.seconds), bench.show)

    def _audit(self) -> dict[str, Any]:
        from evenhand import bench_audit

        return self._shown(bench_audit.measure(), bench_audit.show)

    def _film(self) -> dict[str, Any]:
        inputs.load_physics()
        from evenhand import bench_film

        return self._shown(bench_film.measure(), bench_film.show)

    def _adapters(self) -> dict[str, Any]:
        from evenhand import bench_adapters

        return self._shown(bench_adapters.measure(), bench_adapters.show)

    def _study(self) -> dict[str, Any]:
        from evenhand import bench_study

        return self._shown(bench_study.measure(), bench_study.show)

    def _sweep(self) -> dict[str, Any]:
        inputs.load_physics()
        from evenhand import bench_sweep

        return self._shown(bench_sweep.measure(), bench_sweep.show)

    def _sb3(self) -> dict[str, Any]:
        from evenhand.adapters import versions

        try:
            versions.stable_baselines3()
        except InputError as error:
            if self.what == "sb3":
                raise
            print(f"sb3 is left out: {error}", file=sys.stderr)
            return {}
        inputs.load_physics()
        from evenhand import bench_sb3

        return self._shown(bench_sb3.measure(), bench_sb3.show)
