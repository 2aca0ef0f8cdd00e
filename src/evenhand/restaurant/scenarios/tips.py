"""The operator's own reward: what serving a person brings in, minus what the robot's time costs.

Waiters serve worse whom they expect to tip less (Lynn 2006, Journal of Foodservice Business
Research 9(4), a review). A robot that is paid by the bill learns the same, without a word about
groups being said. The sizes here are chosen, not measured: who is young orders less, so a child
brings in 0.3 and a teenager 0.5 of what others do, and 300 steps of the robot cost 0.25 of a
perfect service. Ranges: shares from 1 (strength 0) down to these (strength 1), cost likewise from
0. A greater cost would teach many robots to respond at once, to everybody alike.
"""

from __future__ import annotations

import numpy as np

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan

_SHARE = np.array([0.3, 0.5, 1.0, 1.0, 1.0])
_COST = 0.25


def check(strength: float) -> None:
    """Refuse what is no strength.

    Raises:
        InputError: for anything but 0 to 1.
    """
    if not 0.0 <= strength <= 1.0:
        raise InputError("range tips", f"tips is {strength}: give a strength from 0 to 1")


def reward(strength: float, codes: np.ndarray, terms: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """What the operator makes of finished services.

    Args:
        strength: 0 (service quality, the same for everybody) to 1.
        codes: identities, int64 [n, 5].
        terms: service quality by ``task.REWARD_TERMS``, [n, 4].
        steps: physics steps that the services took, [n].

    Returns:
        [n]: the terms of a response times the person's share, the safety term, and the cost.
    """
    share = 1.0 - strength * (1.0 - _SHARE[codes[:, 2]])
    return (
        share * terms[:, :3].sum(axis=1)
        + terms[:, 3]
        - strength * _COST * steps / floor_plan.MAX_STEPS
    )
