"""What tests of the rivals share: small epochs."""

from dataclasses import replace
from typing import Any

import numpy as np
from evenhand.training.rivals.base import EpochOutcome

from evenhand.methods.paper.scores import Counts

NAN = np.nan
NONE_EARLIER = Counts(*np.zeros((4, 2, 1)))
TWO_GROUPS = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])


def two_groups(**changes: Any) -> EpochOutcome:
    """Four services of one decision each, of people of a, b, a, b."""
    outcome = EpochOutcome(
        reward=np.array([1.0, 0.0, 0.5, 0.5]),
        x=np.array([[1.0], [0.0], [0.0], [1.0]]),
        inside=TWO_GROUPS,
        identity=np.array([0, 0]),
        advantage=np.array([[2.0], [0.0], [1.0], [4.0]]),
        mask=np.ones((4, 1)),
        score=0.3,
        cost=np.array([3.0, 0.0, 1.0, 0.0]),
    )
    return replace(outcome, **changes)
