"""``python -m benchmarks``: everything that is measured of speed."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import arg

from evenhand import cli
from evenhand.cli import inputs
from evenhand.core import extras
from evenhand.core.errors import InputError


@dataclass(frozen=True)
class Bench:
    """Measure speed, side by side in one run."""

    json: bool = False
    """Print JSON instead of tables."""

    what: Literal["env", "train", "audit", "film", "adapters", "study", "sweep", "sb3", "all"] = (
        "all"
    )
    """What is measured.
    env: physics steps against a bare mj_step loop over the same room and the same drives, and
    against Gymnasium's SyncVectorEnv over the single environment, with a thread for each processor
    and with one; an epoch of training.
    train: whole trainings; against another commit with --against.
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

    against: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="(optional)")] = None
    """A checkout of another commit, which trains in alternating rounds; only with --what train or
    all."""

    def run(self, command: str) -> int:
        """Measure and print."""
        if self.against is not None and self.what not in ("train", "all"):
            raise InputError(
                "conflict against", f"--against does nothing with --what {self.what}: leave it out"
            )
        found: dict[str, Any] = {}
        parts = {
            "env": self._env,
            "train": self._train,
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
        from benchmarks import environment
        from evenhand.training.jax_setup import set_up_jax

        set_up_jax()
        return self._shown(environment.measure(self.seconds), environment.show)

    def _train(self) -> dict[str, Any]:
        inputs.load_physics()
        from benchmarks import training

        return self._shown(training.measure(self.against), training.show)

    def _audit(self) -> dict[str, Any]:
        from benchmarks import audit

        return self._shown(audit.measure(), audit.show)

    def _film(self) -> dict[str, Any]:
        inputs.load_physics()
        from benchmarks import film

        return self._shown(film.measure(), film.show)

    def _adapters(self) -> dict[str, Any]:
        from benchmarks import adapters

        return self._shown(adapters.measure(), adapters.show)

    def _study(self) -> dict[str, Any]:
        from benchmarks import study

        return self._shown(study.measure(), study.show)

    def _sweep(self) -> dict[str, Any]:
        inputs.load_physics()
        from benchmarks import sweep

        return self._shown(sweep.measure(), sweep.show)

    def _sb3(self) -> dict[str, Any]:

        try:
            extras.require("sb3", "this measurement")
        except InputError as error:
            if self.what == "sb3":
                raise
            print(f"sb3 is left out: {error}", file=sys.stderr)
            return {}
        inputs.load_physics()
        from benchmarks import stable_baselines3

        return self._shown(stable_baselines3.measure(), stable_baselines3.show)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what the words ask for; exit codes are those of ``evenhand``."""
    words = list(sys.argv[1:] if arguments is None else arguments)

    def measured() -> int:
        parsed = cli.parse(Bench, "python -m benchmarks", words)
        return 0 if parsed is None else parsed.run(" ".join(["python -m benchmarks", *words]))

    return cli.guarded(measured, listening=arguments is None)


if __name__ == "__main__":
    sys.exit(main())
