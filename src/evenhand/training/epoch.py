"""An epoch after its last service: counted, scored and judged when somebody asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evenhand.methods.paper import issues
from evenhand.methods.paper.detector import Detector, WindowVerdict
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.worlds import World


@dataclass(frozen=True)
class Epoch:
    """n finished services and how even they were.

    Attributes:
        world: where they were given.
        done: the services; observations as the policy saw them.
        judge: what a detector says of their scores.
    """

    world: World
    done: serve.Services
    judge: Callable[[issues.Scores], WindowVerdict]

    @cached_property
    def x(self) -> np.ndarray:
        """Issues, [n, K], NaN where one does not apply."""
        return self.world.indicators(self.done)

    @cached_property
    def inside(self) -> np.ndarray:
        """Membership, [n, G]."""
        return self.world.scheme.inside(self.done.codes)

    @cached_property
    def counts(self) -> issues.Counts:
        """Of these services."""
        return issues.count(self.x, self.inside)

    @cached_property
    def scores(self) -> issues.Scores:
        """Of these services (Eq. 1 and 2)."""
        return issues.scores_of(self.counts, self.world.groups, self.world.scheme.issue_names)

    @cached_property
    def verdict(self) -> WindowVerdict:
        """What the detector says of them (Eq. 3)."""
        return self.judge(self.scores)

    @property
    def biased(self) -> bool:
        """Whether the detector calls them biased."""
        return bool(self.verdict.biased)


def judged_by(world: World, done: serve.Services, detector: Detector | None) -> Epoch:
    """Finished services, to be judged by a detector when somebody asks.

    Args:
        world: where they were given.
        done: the services; observations as the policy saw them.
        detector: judges them; without one they are called not biased.
    """

    def judge(scores: issues.Scores) -> WindowVerdict:
        if detector is None:
            none = np.zeros((1, scores.overall.shape[-1]), bool)
            return WindowVerdict(np.array(False), np.full(1, np.nan), none, np.array(-1))
        rows = [scores.issues.index(name) for name in detector.issues]
        # only what the detector was taught: each identity more raises the false alarms
        taught = [name for name in detector.identities if name in scores.by_identity]
        return detector.judge_window({name: scores.by_identity[name][..., rows] for name in taught})

    return Epoch(world, done, judge)
