"""Unawareness: training on service alone by a policy that does not see whom it serves."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError
from evenhand.methods.epoch import Answers
from evenhand.methods.guidance import Guidance
from evenhand.methods.registry import BLINDNESS, method


def unaware(observation: np.ndarray, groups: int) -> np.ndarray:
    """The observation without whom one serves: its first columns, the identities, are 0.

    Args:
        observation: [..., O], identities first.
        groups: number of identity columns, at most O.

    Returns:
        A copy, [..., O].

    Raises:
        InputError: when the observation has fewer columns.
    """
    seen = np.array(observation)
    if not 0 <= groups <= seen.shape[-1]:
        raise InputError(
            "shape observation",
            f"an observation of {seen.shape[-1]} numbers has no {groups} columns of identities: "
            "give the number of groups that it begins with",
        )
    seen[..., :groups] = 0
    return seen


@method("unaware", label="unaware", colour=palette.GREY, marker="s", filled=False)
class Unaware:
    """Service alone, and the policy does not see whom it serves."""

    needs = (BLINDNESS,)

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Any, memory: None) -> tuple[Guidance, None]:
        """The rewards stay as they are."""
        return Guidance(), memory

    def worth(self, answers: Answers, memory: None) -> np.ndarray:
        """What each answer would have earned, [n, A]."""
        return answers.reward
