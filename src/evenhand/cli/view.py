"""``evenhand view``."""

from __future__ import annotations

import errno
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from evenhand.cli import inputs, interrupts
from evenhand.cli.inputs import OPTIONAL, Plugin, Strength, scenario_help
from evenhand.core.errors import InputError, whole
from evenhand.experiments.settings import SEEDS

if TYPE_CHECKING:
    from evenhand.restaurant.live.shift import Cast

_PORTS = (1, 65535)


SCENARIO = scenario_help("That of the run's training, or even for a scripted robot.")


@dataclass(frozen=True)
class View:
    """Watch a robot at work in the browser, one service after another.

    Opens MuJoCo Studio's web viewer on the running restaurant. It can be paused, stepped, slowed
    down and sped up, and tells who is served, the distances, the timer, the issues, and what has
    been counted so far. The browser draws, so the machine that runs this needs no display and no
    graphics card; only that machine itself can open the address.

    For instance: evenhand view --robot ageist, or: evenhand view --run out/run --scenario tips
    """

    scenario: Annotated[
        str | None, arg(metavar="NAME[+NAME]", help_behavior_hint=OPTIONAL, help=SCENARIO)
    ] = None

    run_folder: Annotated[
        Path | None, arg(name="run", metavar="RUN", help_behavior_hint=OPTIONAL)
    ] = None
    """Folder of a run of `evenhand train` or `evenhand reproduce`; its last checkpoint serves."""

    robot: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: even)")] = None
    """Instead of a run, a scripted robot: even, racist, sexist, ageist or ableist."""

    strength: Strength = None
    """Of the scripted robot's bias, 0 to 1."""

    plugin: Plugin = ()

    seed: int = 0
    """Of people, places and chances: the same seed shows the same services."""

    port: Annotated[
        int | None, arg(metavar="INT", help_behavior_hint="(default: the first free one from 8080)")
    ] = None
    """To listen on, on this machine's loopback address only."""

    no_browser: bool = False
    """Only print the address, though this machine has a display."""

    def run(self, command: str) -> int:
        """Print the address, show services until the viewer or the user ends it."""
        if self.run_folder is not None:
            for option, value in (("--robot", self.robot), ("--strength", self.strength)):
                if value is not None:
                    raise InputError(
                        "conflict run",
                        f"--run and {option} exclude each other: leave one of them out",
                    )
        whole("seed", self.seed, *SEEDS)
        if self.port is not None:
            whole("port", self.port, *_PORTS)
            _check_free(self.port)
        inputs.load_physics("sim" if self.run_folder is None else "train")
        cast = self._cast()
        try:
            from evenhand.restaurant.live import studio
        except ImportError as error:
            raise InputError(
                "unavailable mujoco",
                "MuJoCo for this system lacks Studio's web viewer: use Linux or macOS, or a "
                "newer MuJoCo",
            ) from error
        from evenhand.restaurant.live.shift import Shift

        shift = Shift(cast, self.seed)
        title = f"{cast.name}; scenario {cast.world.name}, seed {self.seed}"
        with interrupts.expected():
            studio.show(
                shift,
                title,
                self.port or 0,
                lambda line: print(line, flush=True),
                browser=not self.no_browser,
            )
        return 0

    def _cast(self) -> Cast:
        from evenhand.restaurant.live import shift

        if self.run_folder is None:
            strength = 1.0 if self.strength is None else self.strength
            return shift.scripted(self.robot or "even", strength, self.scenario or "even")
        from evenhand.restaurant import worlds
        from evenhand.training import evaluate, train

        settings, state = inputs.load_policy(self.run_folder)
        name = f"{self.run_folder}, after {int(state.step)} of {settings.epochs} epochs"
        world = settings.world if self.scenario is None else worlds.scenario(self.scenario)
        evaluate.check_world(settings, world)
        return shift.Cast(name, world, train.robot(settings, state.policy))


def _check_free(port: int) -> None:
    """Say at once, and in one sentence, that a port cannot be had."""
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind(("127.0.0.1", port))
        except OSError as error:
            if error.errno == errno.EACCES:
                raise InputError(
                    "unavailable port", f"port {port} needs special rights: give one from 1024 on"
                ) from error
            raise InputError(
                "unavailable port", f"port {port} is in use: give another one, or leave --port out"
            ) from error
