"""What tests of the published methods share: small epochs."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from evenhand.methods.epoch import Epoch
from evenhand.methods.paper.scores import Counts

NAN = np.nan
NONE_EARLIER = Counts(*np.zeros((4, 2, 1)))
TWO_GROUPS = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])


def scheme(groups: int, n_issues: int) -> Any:
    """As much of a scheme as methods ask for."""
    return SimpleNamespace(groups=range(groups), issues=range(n_issues))


def epoch_of(
    x: np.ndarray,
    inside: np.ndarray,
    reward: np.ndarray,
    advantage: np.ndarray,
    mask: np.ndarray,
    identity: np.ndarray,
    excess: float = 0.3,
) -> Epoch:
    """An epoch; its advantages are those given, whatever the rewards."""
    return Epoch(
        x=x,
        inside=inside,
        reward=reward,
        mask=mask,
        groups=[(str(number), str(g)) for g, number in enumerate(identity)],
        issues=[str(k) for k in range(x.shape[1])],
        tau=np.ones(x.shape[1]),
        advantages_of=lambda rewards: advantage,
        corrected_of=lambda counts: excess,
    )


def two_groups(**changes: Any) -> Epoch:
    """Four services of one decision each, of people of a, b, a, b."""
    made: dict[str, Any] = {
        "reward": np.array([1.0, 0.0, 0.5, 0.5]),
        "x": np.array([[1.0], [0.0], [0.0], [1.0]]),
        "inside": TWO_GROUPS,
        "identity": np.array([0, 0]),
        "advantage": np.array([[2.0], [0.0], [1.0], [4.0]]),
        "mask": np.ones((4, 1)),
    }
    return epoch_of(**made | changes)
