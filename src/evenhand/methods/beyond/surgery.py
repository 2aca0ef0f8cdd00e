"""Gradient surgery: the gradient towards evenness, without what conflicts with service.

What the learner does with the two directions is in `training.surgery`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.core import palette
from evenhand.methods.beyond.influence import CreditSettings, influence, influence_of
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.pooling import Pool, pooled, remember
from evenhand.methods.registry import DIRECTION, method


@method("surgery", label="surgery", colour=palette.SKY, marker="v", own=True)
@dataclass(frozen=True)
class Surgery(CreditSettings):
    """The gradient towards evenness, without what conflicts with service."""

    @property
    def needs(self) -> tuple[str, ...]:
        """A second direction."""
        return (DIRECTION, *super().needs)

    def teach(self, epoch: Epoch, memory: Pool) -> tuple[Guidance, Pool]:
        """-μ n w of each service at all its decisions, beside the advantages of service."""
        memory = remember(memory, epoch.counts)
        if not self.counts_now(epoch):
            return Guidance(), memory
        now = self.weighed(epoch)
        found = influence(epoch.x, epoch.inside, epoch.tau, pooled(memory), now)
        each = -now.strength * len(epoch.x) * found.total
        return Guidance(fair=np.where(epoch.mask > 0, each[:, None], 0.0)), memory

    def worth(self, answers: Answers, memory: Pool) -> np.ndarray:
        """What each answer would have earned: the direction of service, [n, A]."""
        return answers.reward

    def direction(self, answers: Answers, memory: Pool) -> np.ndarray:
        """-μ n w of each service with each answer, [n, A]."""
        window, flat = answers.window, answers.flat
        if not self.counts_now(window):
            return np.zeros(answers.reward.shape)
        now = self.weighed(window)
        found = influence_of(flat.x, flat.inside, flat.tau, pooled(memory), window.counts, now)
        return -now.strength * len(window) * found.total.reshape(answers.reward.shape)
