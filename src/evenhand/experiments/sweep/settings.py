"""What a sweep is made of: variants of the settings, and runs; imports nothing heavy."""

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

from evenhand.experiments.comparison.settings import Cell, CompareSettings, plain
from evenhand.training.learners import LEARNERS

EXAMPLE = Path(str(resources("evenhand.experiments.sweep") / "data" / "sweep.toml"))
"""A sweep to start from."""
Value = bool | int | float | str | tuple[int, ...]
EPOCHS = (2, 100_000)
"""Fewest and most updates of a run."""
PEOPLE = (2, 10_000)
"""Fewest and most services in an epoch."""
MOST = 100_000
"""Runs in one sweep."""
_LONGEST = 120
_PPO_ONLY = ("passes", "minibatches", "clip")


@dataclass(frozen=True)
class Variant:
    """Settings that the runs of a comparison have in common.

    Attributes:
        epochs: updates.
        people: services in one epoch.
        services: in the test.
        learner: settings of learning and of the network that are not their defaults, by name.
    """

    epochs: int = CompareSettings.epochs
    people: int = 30
    services: int = CompareSettings.services
    learner: tuple[tuple[str, Value], ...] = ()

    @property
    def name(self) -> str:
        """What differs from the defaults, as a folder can be called.

        It does not depend on what else a sweep holds, so that a sweep can be enlarged.
        """
        own = [
            (each.name, getattr(self, each.name))
            for each in fields(self)
            if each.name != "learner" and getattr(self, each.name) != each.default
        ]
        words = [f"{name}={_plain(value)}" for name, value in (*own, *self.learner)]
        text = re.sub(r"[^A-Za-z0-9=,.+_-]", "_", ",".join(words)) or "default"
        if len(text) <= _LONGEST:
            return text
        return f"{text[:_LONGEST]}~{zlib.crc32(text.encode()):08x}"


def _plain(value: Value) -> str:
    if isinstance(value, tuple):
        return "x".join(str(one) for one in value)
    return str(value).lower() if isinstance(value, bool) else str(value)


@dataclass(frozen=True)
class Job:
    """One run of a sweep."""

    variant: Variant
    cell: Cell

    def __str__(self) -> str:
        return f"{self.variant.name}: {self.cell}"

    @property
    def path(self) -> Path:
        """Its folder inside that of the sweep."""
        return self.cell.folder(Path("variants") / self.variant.name)

    @property
    def units(self) -> int:
        """Services of the run, in training and test."""
        trained = self.variant.epochs * self.variant.people if self.learns else 0
        return trained + self.variant.services

    @property
    def learns(self) -> bool:
        """Whether there is any training."""
        return self.cell.algorithm != "none"

    @property
    def same(self) -> tuple[object, ...]:
        """Equal for two jobs that would do the same work."""
        learner = self.variant.learner
        algorithm, credit = LEARNERS.get(self.cell.algorithm, ("", ""))
        if algorithm == "reinforce":
            unused = _PPO_ONLY if credit == "sampled" else _PPO_ONLY[1:]
            learner = tuple(one for one in learner if one[0] not in unused)
        v = self.variant
        cell = replace(self.cell, arm=plain(self.cell.arm))
        return (v.epochs, v.people, v.services, learner, cell)


@dataclass(frozen=True)
class Sweep:
    """Runs in the order in which they begin."""

    jobs: tuple[Job, ...]
    text: str

    def variants(self) -> Iterator[Variant]:
        """Each once, in order."""
        yield from dict.fromkeys(job.variant for job in self.jobs)


@dataclass(frozen=True)
class Line:
    """What became of a run.

    Attributes:
        job: which.
        test: its numbers by metric; None if it failed.
        seconds: that it took where it ran; None when that is not known.
        attempts: how often it was begun this time, 0 if it had ended before.
        failure: why it failed.
    """

    job: Job
    test: dict[str, Any] | None
    seconds: float | None
    attempts: int
    failure: str | None

    @property
    def reason(self) -> str:
        """The failure in one line: the last one of a traceback."""
        return (self.failure or "").strip().rpartition("\n")[2]
