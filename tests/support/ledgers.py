"""Services of a home-made scheme, written into a ledger without any environment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenhand.adapters import Ended, Fact, Identity, Ledger, Scheme, own_issue

SCHEME = Scheme(
    (Identity("side", ("left", "right")),),
    (Fact("late", bool), Fact("loud", bool)),
    (
        own_issue("late", ["late"], lambda late: late == 1),
        own_issue("loud", ["loud"], lambda loud: loud == 1),
    ),
)
LEFT, RIGHT = 0, 1
# Of four services: late on the left 2 of 2 and on the right 0 of 2; loud 1 of 2 against 0 of 2.
FIRST = ([LEFT, LEFT, RIGHT, RIGHT], [1, 1, 0, 0], [1, 0, 0, 0])


def ended(side: Sequence[int], first: int = 0) -> Ended:
    """Episodes of people of these sides."""
    n = len(side)
    return Ended(
        episode=first + np.arange(n),
        lane=np.zeros(n, np.int64),
        reward=np.zeros(n),
        steps=np.ones(n, np.int64),
        terminated=np.ones(n, bool),
        truncated=np.zeros(n, bool),
        observation=np.zeros((n, 1)),
        people=np.array(side)[:, None],
        raw=[({}, {}, -1)] * n,
    )


def add(
    ledger: Ledger,
    side: Sequence[int],
    late: Sequence[int],
    loud: Sequence[int],
    *,
    afterwards: bool = False,
) -> np.ndarray:
    """Write services down; what evenness pays for each."""
    told = {"late": np.array(late, bool), "loud": np.array(loud, bool)}
    return ledger.add(ended(side, len(ledger)), told, afterwards=afterwards)
