"""What training remembers from epoch to epoch beside the learner; it goes into checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.methods.beyond import guard, levelup, reflection
from evenhand.training.rivals import base, methods
from evenhand.training.settings import TrainSettings

GUARD = guard.GuardSettings()


@dataclass(frozen=True)
class Past:
    """Memories of all parts; those of parts that a run does not use stay empty.

    Attributes:
        memory: counts of the last epochs.
        guard: whether service became worse for a group; its groups are the 22 and everybody.
        reflection: cosines of the last updates.
        rival: state of the rival; None without one.
    """

    memory: levelup.Memory
    guard: guard.Guard
    reflection: reflection.Past
    rival: Any

    @classmethod
    def empty(cls, settings: TrainSettings) -> Past:
        """Before the first epoch."""
        groups, kinds = _sizes(settings)
        identities = len(settings.world.identities)
        return cls(
            levelup.Memory.empty(settings.guidance.weigh.windows, groups, kinds),
            guard.Guard.new(groups + 1, 1, GUARD),
            reflection.Past.empty(identities, kinds, settings.reflection),
            _rival_state(settings),
        )

    def plain(self) -> dict[str, Any]:
        """As JSON can hold it, exactly."""
        rival = {} if self.rival is None else base.to_arrays(self.rival)
        return {
            "memory": self.memory.plain(),
            "guard": self.guard.plain(),
            "reflection": self.reflection.plain(),
            "rival": {name: np.asarray(values).tolist() for name, values in rival.items()},
        }

    @classmethod
    def of(cls, plain: Mapping[str, Any], settings: TrainSettings) -> Past:
        """Back from `plain`."""
        like = _rival_state(settings)
        return cls(
            levelup.Memory.of(plain["memory"]),
            guard.Guard.of(plain["guard"]),
            reflection.Past.of(plain["reflection"]),
            None if like is None else base.from_arrays(like, plain["rival"]),
        )


def _sizes(settings: TrainSettings) -> tuple[int, int]:
    """How many groups and issues there are."""
    return len(settings.world.groups), len(settings.world.issues)


def _rival_state(settings: TrainSettings) -> Any:
    if settings.rival == "none":
        return None
    return methods.strong(settings.rival, settings.rival_strength).begin(*_sizes(settings))
