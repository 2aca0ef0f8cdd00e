"""Which engine steps the physics of services: whole services as machine code, or lane by lane."""

from __future__ import annotations

from functools import cached_property

from evenhand.core.errors import whole
from evenhand.core.processors import THREADS
from evenhand.restaurant.simulation import native, serve, task
from evenhand.restaurant.simulation.lanes import Lanes

LANES = 240
"""Most services at a time, lane by lane."""


def takes_networks() -> bool:
    """Whether whole services can run as machine code; robots that are networks are faster then."""
    return native.found()


class Engine:
    """Serves with any robot; simulations are made when they are first needed, and kept."""

    def __init__(
        self, settings: task.TaskSettings, at_once: int, groups: int, threads: int = 1
    ) -> None:
        """Choose.

        Args:
            settings: when robots decide.
            at_once: services at a time.
            groups: of people, as the robot is told them.
            threads: that step the physics; results are the same on any number.

        Raises:
            InputError: for no threads, or more than a machine has.
        """
        whole("threads", threads, *THREADS)
        self.settings, self._at_once, self._threads = settings, at_once, threads
        self._groups = groups
        self.one = Lanes(1, settings, 1, groups)
        """Prepares services; see ``serve.draw``."""

    @cached_property
    def _lanes(self) -> Lanes:
        return Lanes(self._at_once, self.settings, self._threads, self._groups)

    @cached_property
    def _native(self) -> native.Engines:
        return native.Engines(self._at_once, self._threads)

    def run(
        self, drawn: serve.Drawn, robot: serve.Robot | native.Network, *, recorded: bool = False
    ) -> serve.Services:
        """Run services that have been drawn to their ends.

        Args:
            drawn: the services, at most ``at_once`` of them for a network.
            robot: who serves; a network only where ``takes_networks``.
            recorded: keep what was to be seen.
        """
        if isinstance(robot, native.Network):
            return self._native.run(drawn, robot, self.settings, recorded=recorded)
        return serve.run(self._lanes, drawn, robot, recorded=recorded)
