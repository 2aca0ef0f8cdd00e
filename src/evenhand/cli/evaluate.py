"""``evenhand evaluate``."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import (
    OPTIONAL,
    Plugin,
    Population,
    Robot,
    RunFolder,
    Strength,
    scenario_help,
)
from evenhand.core.errors import whole
from evenhand.core.processors import CORES, THREADS
from evenhand.experiments.settings import SEEDS, SERVICES, TEST_SEED

if TYPE_CHECKING:
    from evenhand.methods.services import Services
    from evenhand.restaurant.worlds import World


SCENARIO = scenario_help("That of the run's training, or even for a scripted robot.")


@dataclass(frozen=True)
class Evaluate:
    """Test a trained robot, or a scripted one, on people it never saw.

    The issue scores are means over windows of 30 services, and the total is their sum; what chance
    alone gives is that of the same services with identities shuffled. A perfect service has none
    of the four issues; the worst-served group is one with at least 30 services. Shares have 95 %
    intervals (Wilson). JSON has the same numbers under their names, times in physics steps of
    0.02 s.

    For instance: evenhand evaluate out/run, or: evenhand evaluate --robot racist --json
    """

    run_folder: Positional[RunFolder] = None
    """Folder of a run of `evenhand train` or `evenhand reproduce`; its last checkpoint serves."""

    robot: Robot = None
    """Instead of a run, a scripted robot: even, racist, sexist, ageist or ableist."""

    strength: Strength = None
    """Of the scripted robot's bias, 0 to 1."""

    plugin: Plugin = ()

    services: int = 3000
    """How many people are served."""

    seed: int = TEST_SEED
    """Of people, places and chances; take one that training has not used."""

    scenario: Annotated[
        str | None, arg(metavar="NAME[+NAME]", help_behavior_hint=OPTIONAL, help=SCENARIO)
    ] = None

    population: Population = None
    """Where people are drawn from; by default that of the scenario, or of the run's training."""

    threads: int = CORES
    """Threads that step the physics; results are the same on any number."""

    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """Write the services to this .parquet or .csv file."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self, command: str) -> int:
        """Serve, measure, print."""
        inputs.check_server(self.run_folder, self.robot, self.strength)
        whole("services", self.services, 30, SERVICES[1])
        whole("seed", self.seed, *SEEDS)
        whole("threads", self.threads, *THREADS)
        if self.out is not None:
            inputs.check_target(self.out, inputs.ENDINGS)
        inputs.load_physics("sim" if self.run_folder is None else "train")
        from evenhand.core import terminal
        from evenhand.training import evaluate

        who, world, table = self._serve()
        if self.out is not None:
            inputs.write_services(table, self.out)
        found = evaluate.summary(table, self.seed, world.scheme)
        if self.json:
            print(json.dumps(found, allow_nan=False))
        else:
            title = f"{who}: {self.services} services, scenario {world.name}, seed {self.seed}"
            names = world.scheme.issue_names
            terminal.table(title, ("measure", "value", "of"), told(found, names))
        return 0

    def _serve(self) -> tuple[str, World, Services]:
        from evenhand.restaurant import robots, worlds
        from evenhand.training import evaluate

        if self.run_folder is None:
            strength = 1.0 if self.strength is None else self.strength
            robot = robots.ScriptedRobot(str(self.robot), strength)
            world = worlds.scenario(self.scenario or "even", self.population)
            who, serve = robot.name, functools.partial(evaluate.serve_scripted, robot)
        else:
            settings, state = inputs.load_policy(self.run_folder)
            world = settings.elsewhere(self.scenario, self.population)
            who = f"{self.run_folder}, after {int(state.step)} of {settings.epochs} epochs"
            serve = functools.partial(evaluate.serve_policy, state, settings)
        found = serve(world=world, services=self.services, seed=self.seed, threads=self.threads)
        return who, world, found


def told(found: Mapping[str, Any], issues: Sequence[str]) -> list[tuple[str, str, str]]:
    """What ``evaluate.summary`` found, for readers: what it is, a number with its unit, of what."""
    from evenhand.restaurant.floor_plan import TIMESTEP
    from evenhand.training.evaluate import WINDOW

    services = found["services"]
    answered = f"{round(services * found['response_rate']):,} responses"
    windows = f"{services // WINDOW:,} windows of {WINDOW} services"
    every = f"{services:,} services"
    time = found["mean_response_time"]
    seconds = None if time is None else time * TIMESTEP
    return [
        ("total issue score", _number(found["total"]), windows),
        *((f"issue score, {name}", _number(found[name]), windows) for name in issues),
        ("total that chance alone gives", _number(found["floor"]), windows),
        ("total of all services as one window", _number(found["pooled_total"]), every),
        ("perfect services", _share(found["perfect_rate"], services), every),
        (
            "perfect services, worst-served group",
            _share(found["worst_group_rate"]),
            "groups of 30 or more",
        ),
        ("services with a response", _share(found["response_rate"], services), every),
        ("mean response distance", _number(found["mean_response_distance"], " m", 2), answered),
        ("mean response time", _number(seconds, " s", 2), answered),
        ("mean length of a service", _number(found["mean_service_seconds"], " s", 2), every),
    ]


def _number(value: float | None, unit: str = "", digits: int = 3) -> str:
    return "missing" if value is None else f"{value:z.{digits}f}{unit}"


def _share(value: float | None, n: int = 0) -> str:
    from evenhand.statistics.intervals import wilson

    if value is None:
        return "missing"
    if not n:
        return f"{100 * value:.1f} %"
    low, high = wilson(np.array(round(value * n)), np.array(n))
    return f"{100 * value:.1f} % [{100 * float(low):.1f}, {100 * float(high):.1f}]"
