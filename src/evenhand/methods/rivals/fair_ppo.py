"""Fair-PPO: gaps between what groups earned and will earn are penalties (La Malfa et al. 2025)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.registry import method
from evenhand.methods.rivals.shared import Rival, group_means, weighted, within


def parity_slope(mean: np.ndarray, rest: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Sign of each gap J_g − J_¬g over the number of gaps, [G]; 0 where a side is empty."""
    return np.where(known, np.sign(mean - rest), 0.0) / max(int(known.sum()), 1)


def parity_weights(slope: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Derivative of the mean |J_g − J_¬g| by the log-weight of each service's reward, times n.

    n Σ_g slope_g (1(i ∈ g) / n_g − 1(i ∉ g) / n_¬g), [n].

    Args:
        slope: from `parity_slope`, [G].
        inside: membership, [n, G].
    """
    belongs, others = np.nan_to_num(inside), np.nan_to_num(1.0 - inside)
    n, m = belongs.sum(axis=0), others.sum(axis=0)
    each = belongs / np.maximum(n, 1.0) - others / np.maximum(m, 1.0)
    return len(belongs) * (each @ slope)


@method("fair_ppo", label="Fair-PPO", colour=palette.SKY, marker="P", filled=False)
@dataclass(frozen=True)
class FairPPO(Rival):
    """Fair-PPO: gaps between the mean rewards of groups are a penalty.

    The objective is J − α Σ_g |J_g − J_¬g| / G, with rewards that groups earned (retrospective)
    and that the critic expects for them at the beginning (prospective): La Malfa et al. 2025, arXiv
    2502.03953, demographic parity. Its released loss has no gradient towards fairness, so this is
    the published idea and not that code.
    """

    strength: float = 0.5
    """α: weight of the penalties."""

    prospective: float = 0.5
    """Share of the penalty that looks at what the critic expects."""

    def __post_init__(self) -> None:
        within("strength", self.strength, 0.0)
        within("prospective", self.prospective, 0.0, 1.0)

    def begin(self, scheme: Any) -> np.ndarray:
        """Weights of services by group, from the last epoch; none yet."""
        return np.zeros(len(scheme.groups))

    def lesson(self, epoch: Epoch, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rewards of services weigh less where their group earned more than the others."""
        slope = (1.0 - self.prospective) * self._slope(epoch.reward, epoch.inside)
        expected = epoch.reward if epoch.value is None else epoch.value[:, 0]
        slope = slope + self.prospective * self._slope(expected, epoch.inside)
        weight = 1.0 - self.strength * parity_weights(slope, epoch.inside)
        return weighted(epoch.advantage, epoch.mask, weight), slope

    def value(self, answers: Answers, memory: np.ndarray) -> np.ndarray:
        """The same weights, whatever the answer, [n, A]."""
        weight = 1.0 - self.strength * parity_weights(memory, answers.window.inside)
        return answers.over(weight) * answers.reward

    def _slope(self, earned: np.ndarray, inside: np.ndarray) -> np.ndarray:
        mean, n = group_means(earned, inside)
        rest, m = group_means(earned, 1.0 - inside)
        return parity_slope(mean, rest, (n > 0) & (m > 0))
