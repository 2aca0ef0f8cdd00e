"""Group DRO: an adversary moves weight to the groups served worst (Sagawa et al. 2020)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.registry import method
from evenhand.methods.rivals.shared import Rival, group_means, service_weights, weighted, within


def dro_step(
    log_q: np.ndarray, loss: np.ndarray, n: np.ndarray, rate: float, adjustment: float
) -> np.ndarray:
    """Step of the adversary of group DRO: q_g ∝ q_g exp(η (loss_g + C / √n_g)), in logs.

    Sagawa et al. 2020 (arXiv 1911.08731), algorithm 1 with group adjustments;
    kohpangwei/group_DRO `loss.py`.

    Args:
        log_q: log of the shares so far, [G].
        loss: minus the mean reward of each group, [G].
        n: services of each group that its data set holds, [G]; a group with 0 keeps its share.
        rate: η.
        adjustment: C.

    Returns:
        [G].
    """
    seen = n > 0
    if not seen.any():
        return log_q
    moved = log_q[seen] + rate * (loss[seen] + adjustment / np.sqrt(n[seen]))
    result = log_q.copy()
    result[seen] = moved - np.logaddexp.reduce(moved) + np.logaddexp.reduce(log_q[seen])
    return result


@dataclass(frozen=True)
class GroupDROState:
    """What group DRO remembers.

    Attributes:
        log_q: log of each group's share, [G].
        mean: last known mean reward of each group, [G]; 0 if none.
        seen: services of each group so far, [G].
    """

    log_q: np.ndarray
    mean: np.ndarray
    seen: np.ndarray


@method(
    "group_dro",
    field="rate",
    label="group DRO",
    colour=palette.VERMILLION,
    marker="P",
    filled=False,
)
@dataclass(frozen=True)
class GroupDRO(Rival):
    """Group DRO: an adversary moves weight to the groups that are served worst."""

    rate: float = 0.1
    """η, step size of the adversary."""

    adjustment: float = 0.0
    """C: a small group counts as worse off by C / √n, with n its services in the run so far."""

    def __post_init__(self) -> None:
        for name in ("rate", "adjustment"):
            within(name, getattr(self, name), 0.0)

    def begin(self, scheme: Any) -> GroupDROState:
        """All groups weigh the same."""
        groups = len(scheme.groups)
        nothing = np.zeros(groups)
        return GroupDROState(np.full(groups, -np.log(groups)), nothing, nothing)

    def lesson(self, epoch: Epoch, memory: GroupDROState) -> tuple[np.ndarray, GroupDROState]:
        """First the adversary takes its step, then services weigh by their groups.

        A group that nobody belonged to in this epoch keeps its last mean.
        """
        now, n = group_means(epoch.reward, epoch.inside)
        mean = np.where(n > 0, now, memory.mean)
        seen = memory.seen + n
        log_q = dro_step(memory.log_q, -mean, seen, self.rate, self.adjustment)
        weight = service_weights(np.exp(log_q), epoch.inside)
        return weighted(epoch.advantage, epoch.mask, weight), GroupDROState(log_q, mean, seen)

    def value(self, answers: Answers, memory: GroupDROState) -> np.ndarray:
        """Services weigh by their groups, whatever the answer, [n, A]."""
        weight = service_weights(np.exp(memory.log_q), answers.window.inside)
        return answers.over(weight) * answers.reward
