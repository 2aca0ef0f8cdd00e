"""GGF: generalised Gini welfare, in which the worst-off weigh most (Siddique et al. 2020)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.registry import method
from evenhand.methods.rivals.shared import Rival, group_means, service_weights, weighted, within


def gini_weights(mean: np.ndarray, known: np.ndarray, decay: float) -> np.ndarray:
    """w_σ of the generalised Gini welfare Σ_i w_i J_(i), with J_(1) the least.

    w_i ∝ decay^(i−1), with sum 1: the worst-off group weighs most. Groups with the same J share
    their weights evenly (also a supergradient), so that no group is favoured by its place in a
    list. Siddique, Weng and Zimmer 2020 (ICML); their later code takes 1 / decay as
    `weight_coef`. It picks weights by argsort, which is the rank only if the order is its own
    inverse; here the rank is meant.

    Args:
        mean: J of each group, [G].
        known: whether it is known, bool [G].
        decay: in (0, 1]; 1 weighs all alike.

    Returns:
        [G], 0 where not known.
    """
    weight = np.zeros(len(mean))
    if known.any():
        _, place, ties = np.unique(mean[known], return_inverse=True, return_counts=True)
        geometric = decay ** np.arange(known.sum())
        first = np.concatenate([[0], np.cumsum(ties)[:-1]])
        shared = np.add.reduceat(geometric, first) / ties
        weight[known] = shared[place] / geometric.sum()
    return weight


@dataclass(frozen=True)
class GGFState:
    """What GGF remembers.

    Attributes:
        mean: smoothed mean reward of each group, [G]; 0 if none.
        seen: 1 for groups that were served so far, [G].
    """

    mean: np.ndarray
    seen: np.ndarray


@method("ggf", field="decay", label="GGF", colour=palette.VERMILLION, marker="X", filled=False)
@dataclass(frozen=True)
class GGF(Rival):
    """GGF: the generalised Gini welfare of the groups, in which the worst-off weigh most."""

    decay: float = 0.9
    """Weight of each group relative to the next worse one; 1 weighs all alike."""

    memory: float = 0.75
    """Share of the earlier estimate in the mean reward by which groups are ranked: one epoch has
    few services of a group. The source ranks by its critic, which remembers too."""

    def __post_init__(self) -> None:
        within("decay", self.decay, 1e-3, 1.0)
        within("memory", self.memory, 0.0, 1.0)

    def begin(self, scheme: Any) -> GGFState:
        """No group was served yet."""
        nothing = np.zeros(len(scheme.groups))
        return GGFState(nothing, nothing)

    def lesson(self, epoch: Epoch, memory: GGFState) -> tuple[np.ndarray, GGFState]:
        """A group that nobody belonged to in this epoch keeps its last mean."""
        now, n = group_means(epoch.reward, epoch.inside)
        before = np.where(memory.seen > 0, memory.mean, now)
        mean = np.where(n > 0, self.memory * before + (1.0 - self.memory) * now, memory.mean)
        seen = ((memory.seen > 0) | (n > 0)).astype(float)
        group_weight = gini_weights(mean, seen > 0, self.decay)
        weight = service_weights(group_weight, epoch.inside)
        return weighted(epoch.advantage, epoch.mask, weight), GGFState(mean, seen)

    def value(self, answers: Answers, memory: GGFState) -> np.ndarray:
        """Services weigh by the ranks of their groups, whatever the answer, [n, A]."""
        weights = gini_weights(memory.mean, memory.seen > 0, self.decay)
        return answers.over(service_weights(weights, answers.window.inside)) * answers.reward
