"""``evenhand evaluate``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evenhand.commands import inputs
from evenhand.commands.options import OPTIONAL, Population, Robot, RunFolder, Strength
from evenhand.errors import whole
from evenhand.experiments.settings import SEEDS, SERVICES, TEST_SEED

if TYPE_CHECKING:
    from evenhand.interactions import Interactions


@dataclass(frozen=True)
class Evaluate:
    """Test a trained robot, or a scripted one, on people it never saw.

    The issue scores are means over windows of 30 services, and total is their sum. What chance
    alone gives (the same services, identities shuffled) is the floor. The share of services
    without any issue is perfect_rate, and worst_group_rate is the same for the worst served of
    those of the 22 groups with at least 30 services.

    For instance: evenhand evaluate out/run, or: evenhand evaluate --robot racist --json
    """

    run_folder: Positional[RunFolder] = None
    """Folder of a run of `evenhand train` or `evenhand reproduce`; its last checkpoint serves."""

    robot: Robot = None
    """Instead of a run, a scripted robot: even, racist, sexist, ageist or ableist."""

    strength: Strength = None
    """Of the scripted robot's bias, 0 to 1."""

    services: int = 3000
    """How many people are served."""

    seed: int = TEST_SEED
    """Of people, places and chances; take one that training has not used."""

    population: Population = None
    """Where people are drawn from; that of the run's training, or uniform for a scripted robot."""

    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """Write the services to this .parquet or .csv file."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self, command: str) -> int:
        """Serve, measure, print."""
        inputs.check_server(self.run_folder, self.robot, self.strength)
        whole("services", self.services, 30, SERVICES[1])
        whole("seed", self.seed, *SEEDS)
        if self.out is not None:
            inputs.check_target(self.out)
        inputs.load_physics()
        from evenhand import show
        from evenhand.experiments import measure

        who, table = self._serve()
        if self.out is not None:
            inputs.write_services(table, self.out)
        found = measure.summary(table, self.seed)
        if self.json:
            print(json.dumps(found, allow_nan=False))
        else:
            title = f"{who}: {self.services} services, seed {self.seed}"
            show.table(title, ("measure", "value"), list(found.items()))
        return 0

    def _serve(self) -> tuple[str, Interactions]:
        from evenhand.experiments import measure

        if self.run_folder is None:
            strength = 1.0 if self.strength is None else self.strength
            where = self.population or "uniform"
            name = str(self.robot)
            return name, measure.serve_scripted(name, strength, where, self.services, self.seed)
        settings, state = inputs.load_policy(self.run_folder)
        who = f"{self.run_folder}, after {int(state.step)} of {settings.epochs} epochs"
        return who, measure.serve_policy(state, settings, self.services, self.seed, self.population)
