"""What training remembers from epoch to epoch beside the learner; it goes into checkpoints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from evenhand.methods import guidance
from evenhand.methods.beyond import reflection
from evenhand.methods.guard import GUARD, Guard
from evenhand.training.settings import TrainSettings


@dataclass(frozen=True)
class Memory:
    """Memories of all parts; those of parts that a run does not use stay empty.

    Attributes:
        guard: whether service became worse for a group; its groups are the 22 and everybody.
        reflection: cosines of the last updates.
        method: what the method remembers.
    """

    guard: Guard
    reflection: reflection.Past
    method: Any

    @classmethod
    def begin(cls, settings: TrainSettings) -> Memory:
        """Before the first epoch."""
        scheme = settings.scheme
        groups, issues = len(scheme.groups), len(scheme.issues)
        return cls(
            Guard.new(groups + 1, 1, GUARD),
            reflection.Past.empty(len(scheme.identities), issues, settings.reflection),
            guidance.begin(settings.method, scheme),
        )
