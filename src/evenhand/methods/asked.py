"""The issues as people are asked about them: a wrong distance is too near or too far.

The paper's quality issue is the union of both. Whoever minds closeness need not mind distance, so
what people mind is asked of each.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenhand.methods.paper.issues import Facts, Issue
from evenhand.methods.vocabulary import FARTHEST, ISSUES, NEAREST

DISTANCE = ISSUES[1]
"""The paper's issue that is split."""
NEAR, FAR = "too_near", "too_far"
ASKED = (ISSUES[0], NEAR, FAR, *ISSUES[2:])
"""Names of the five issues."""


def _distance(x: Facts) -> np.ndarray:
    distance = x.fact("response_distance")
    return np.where(x.fact("responded") == 0.0, np.nan, distance)


def _near(x: Facts) -> np.ndarray:
    distance = _distance(x)
    return np.where(np.isnan(distance), np.nan, distance < NEAREST)


def _far(x: Facts) -> np.ndarray:
    distance = _distance(x)
    return np.where(np.isnan(distance), np.nan, distance > FARTHEST)


DISTANCES = (
    Issue(NEAR, _near, ("responded", "response_distance")),
    Issue(FAR, _far, ("responded", "response_distance")),
)
"""Response nearer than 1 m, and farther than 1.5 m; said of responses only, as quality is."""


def split(issues: Sequence[Issue]) -> tuple[Issue, ...]:
    """Issues with the paper's wrong distance split; others stay as they are."""
    parts = [DISTANCES if one.name == DISTANCE else (one,) for one in issues]
    return tuple(one for part in parts for one in part)


def with_distance(issues: Sequence[Issue]) -> tuple[Issue, ...]:
    """All of them, whole and split."""
    return (*issues, *DISTANCES)


def asks_for_distance(columns: Sequence[str]) -> bool:
    """Whether a table of answers tells too near and too far apart."""
    return NEAR in columns or FAR in columns
