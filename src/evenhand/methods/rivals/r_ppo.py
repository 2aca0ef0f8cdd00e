"""R-PPO: the running unevenness is a penalty on rewards, what A-PPO is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import whole
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.paper.scores import count
from evenhand.methods.registry import method
from evenhand.methods.rivals.shared import (
    Past,
    Rival,
    answer_scores,
    per_service,
    running_scores,
    within,
)


def r_ppo_penalty(delta: np.ndarray, omega: float, zeta: float) -> np.ndarray:
    """r'_t − r_t = −ζ Δ_t where Δ_t >= ω, else 0: R-PPO, POCAR `environments/rewards.py`.

    Args:
        delta: Δ after a service, of any shape.
        omega: ω.
        zeta: ζ.

    Returns:
        Of the same shape.
    """
    return np.where(delta < omega, 0.0, -zeta * delta)


@method("r_ppo", field="zeta", label="R-PPO", colour=palette.PURPLE, marker="s", filled=False)
@dataclass(frozen=True)
class RPPO(Rival):
    """R-PPO: the running total issue score is a penalty on the reward of each service."""

    zeta: float = 1.0
    """Weight of the penalty."""

    omega: float = 0.0
    """A total issue score below this costs nothing."""

    windows: int = 8
    """Epochs that the running score is pooled over, the running one included."""

    def __post_init__(self) -> None:
        for name in ("zeta", "omega"):
            within(name, getattr(self, name), 0.0)
        whole("windows", self.windows, 1, 1000)

    def begin(self, scheme: Any) -> Past:
        """No epoch yet."""
        return Past.none(self.windows, len(scheme.groups), len(scheme.issues))

    def lesson(self, epoch: Epoch, memory: Past) -> tuple[np.ndarray, Past]:
        """The penalty of a service lowers the advantages of all its decisions."""
        score = running_scores(epoch.x, epoch.inside, memory.kept)
        penalty = r_ppo_penalty(score[1:], self.omega, self.zeta)
        now = count(epoch.x, epoch.inside)
        advantage = per_service(epoch.advantage, epoch.mask, penalty)
        return advantage, memory.after(now, len(epoch.x))

    def value(self, answers: Answers, memory: Past) -> np.ndarray:
        """Minus the penalty of the score that would have been there after each answer, [n, A]."""
        window = answers.window
        delta = answer_scores(window.x, answers.x, window.inside, memory.before)
        return answers.reward + r_ppo_penalty(delta, self.omega, self.zeta)
