"""What training remembers from epoch to epoch beside the learner; it goes into checkpoints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand import credit, guard, issues, people, reflection
from evenhand.learn import rival_epoch, rivals
from evenhand.learn.settings import TrainSettings

GUARD = guard.GuardSettings()
_GROUPS, _ISSUES = len(people.GROUPS), len(issues.PAPER_ISSUES)


@dataclass(frozen=True)
class Past:
    """Memories of all parts; those of parts that a run does not use stay empty.

    Attributes:
        memory: counts of the last epochs.
        guard: whether service became worse for a group; its groups are the 22 and everybody.
        reflection: cosines of the last updates.
        rival: state of the rival; None without one.
    """

    memory: credit.Memory
    guard: guard.Guard
    reflection: reflection.Past
    rival: Any

    @classmethod
    def empty(cls, settings: TrainSettings) -> Past:
        """Before the first epoch."""
        identities = len(people.IDENTITIES)
        return cls(
            credit.Memory.empty(settings.guidance.weigh.windows, _GROUPS, _ISSUES),
            guard.Guard.new(_GROUPS + 1, 1, GUARD),
            reflection.Past.empty(identities, _ISSUES, settings.reflection),
            _rival_state(settings),
        )

    def plain(self) -> dict[str, Any]:
        """As JSON can hold it, exactly."""
        rival = {} if self.rival is None else rival_epoch.to_arrays(self.rival)
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
            credit.Memory.of(plain["memory"]),
            guard.Guard.of(plain["guard"]),
            reflection.Past.of(plain["reflection"]),
            None if like is None else rival_epoch.from_arrays(like, plain["rival"]),
        )


def _rival_state(settings: TrainSettings) -> Any:
    if settings.rival == "none":
        return None
    return rivals.strong(settings.rival, settings.rival_strength).begin(_GROUPS, _ISSUES)
