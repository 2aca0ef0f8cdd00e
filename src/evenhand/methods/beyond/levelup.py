"""Level-up: an issue of somebody in a worse-off group costs more, and no issue is ever paid for.

Pure arrays, with the shapes of ``issues``: n services, G groups, K issues.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError
from evenhand.methods.beyond.gaps import GapMethod, beyond_noise, checked_counts, checked_tau
from evenhand.methods.epoch import Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.paper.scores import Counts, signed_gaps
from evenhand.methods.pooling import Pool, pooled, remember
from evenhand.methods.registry import method


def levelup_reward(
    x: np.ndarray,
    inside: np.ndarray,
    tau: Sequence[float] | np.ndarray,
    counts: Counts | None = None,
    settings: GapMethod | None = None,
    cost: float = 0.0,
) -> np.ndarray:
    """Issues of people in worse-off groups cost more, [n], never above 0.

    r_i = -Σ_k τ_k (c₀ + μ Σ_{g∋i} max(0, p_k(g) - p_k(¬g))) x_ik, each gap times its share beyond
    noise. No group's issue is ever paid for. Where an issue does not apply it costs as if the
    service had it, for the reason said in `influence.influence_reward`.

    Arguments and errors as for `influence.influence`; ``cost`` is c₀.
    """
    settings = settings or GapMethod()
    weights = checked_tau(x, tau)
    counts, _ = checked_counts(x, inside, counts)
    return levelup_pays(x, inside, weights, counts, settings, cost)


def levelup_pays(
    x: np.ndarray,
    inside: np.ndarray,
    weights: np.ndarray,
    counts: Counts,
    settings: GapMethod,
    cost: float,
) -> np.ndarray:
    """What `levelup_reward` pays, [n], from checked arguments and the gaps of ``counts``."""
    worse = np.maximum(signed_gaps(counts), 0.0) * beyond_noise(counts, settings.shrink)
    price = cost + settings.strength * (np.nan_to_num(inside) @ np.nan_to_num(worse))
    return -(price * np.nan_to_num(x, nan=1.0)) @ weights


@method("levelup", label="level-up", colour=palette.GREEN, marker="D", own=True)
@dataclass(frozen=True)
class LevelUp(GapMethod):
    """Issues of people in worse-off groups cost more (recommended)."""

    strength: float = 5.0
    """μ: what an issue costs for each point by which the person's groups meet it more often."""

    cost: float = 0.5
    """c₀: what an issue costs anybody. By itself it is the control ``blind``, and μ = 0 is that."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.cost < np.inf:
            raise InputError("range cost", f"cost is {self.cost}: give a finite number from 0 up")

    def weighed(self, services: Epoch) -> LevelUp:
        """The same with what the guard leaves of both costs."""
        now = super().weighed(services)
        share = services.guard_weight if self.guarded else 1.0
        return replace(now, cost=self.cost * share)

    def teach(self, epoch: Epoch, memory: Pool) -> tuple[Guidance, Pool]:
        """Gaps are those of the last epochs, this one included."""
        memory = remember(memory, epoch.counts)
        if not self.counts_now(epoch):
            return Guidance(), memory
        now = self.weighed(epoch)
        paid = levelup_reward(epoch.x, epoch.inside, epoch.tau, pooled(memory), now, now.cost)
        return Guidance(evenness=paid), memory

    def pay(self, services: Epoch, window: Epoch, memory: Pool) -> np.ndarray:
        """Gaps are those of the windows before, [m]."""
        if not self.counts_now(window):
            return np.zeros(len(services))
        now, counts = self.weighed(services), pooled(memory)
        return levelup_pays(services.x, services.inside, services.tau, counts, now, now.cost)
