"""Counts of the last epochs, pooled: 30 services alone say little about 22 groups."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError, whole
from evenhand.methods.paper.scores import Counts


@dataclass(frozen=True)
class Pool:
    """Counts of the last epochs.

    Attributes:
        windows: inside_n, inside_x, outside_n, outside_x of each epoch, the newest last,
            [W, G, K, 4]; zeros where there was no epoch yet.
        filled: epochs that it holds, 0 to W.
    """

    windows: np.ndarray
    filled: int = 0

    @classmethod
    def empty(cls, windows: int, groups: int, issues: int) -> Pool:
        """A pool of nothing, with places for W epochs."""
        whole("windows", windows, 1, 1_000)
        return cls(np.zeros((windows, groups, issues, 4)))


def remember(pool: Pool, counts: Counts) -> Pool:
    """The pool after one more epoch; the oldest is dropped when it is full.

    Raises:
        InputError: when the counts have other groups or issues.
    """
    sides = (counts.inside_n, counts.inside_x, counts.outside_n, counts.outside_x)
    newest = np.stack(sides, axis=-1)
    if newest.shape != pool.windows.shape[1:]:
        raise InputError(
            "shape counts",
            f"counts of {newest.shape[:-1]} groups and issues do not fit a pool of "
            f"{pool.windows.shape[1:-1]}: begin a new one",
        )
    windows = np.concatenate([pool.windows[1:], newest[None]])
    return Pool(windows, min(pool.filled + 1, len(windows)))


def pooled(pool: Pool) -> Counts:
    """The sum over all epochs that it holds, [G, K]."""
    return Counts(*np.moveaxis(pool.windows.sum(axis=0), -1, 0))
