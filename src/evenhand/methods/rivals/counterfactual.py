"""Counterfactual preprocessing: observations in which nothing depends on whom the robot serves."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.methods.epoch import Answers
from evenhand.methods.guidance import Guidance
from evenhand.methods.registry import PREPROCESSING, method


def without_identity(
    seen: np.ndarray, identity: np.ndarray, effect: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """What would have been seen on average of anybody, s − E[s | identity] + E[s].

    Wang et al. 2025 (arXiv 2501.06366, PyCFRL): states are replaced by the mean over the identities
    that somebody could have had, with the part of the state that identity does not explain kept.
    With effects that add up, that mean is the state without its own identity's effect.

    Args:
        seen: one column of the state, [...].
        identity: one-hot, [..., G].
        effect: of each group at each step less the mean effect of all people, [T, G].
        step: number of the step, int [...].

    Returns:
        [...].
    """
    return seen - (identity * effect[step]).sum(axis=-1)


@method(
    "counterfactual",
    label="counterfactual preprocessing",
    colour=palette.SKY,
    marker="s",
    filled=False,
)
class Counterfactual:
    """Service alone, by a policy that sees what it would see of anybody.

    Identities are hidden, as with ``unaware``, and the part of the distance reading that identity
    explains is taken out. What it explains is measured on walks before training.
    """

    needs = (PREPROCESSING,)

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Any, memory: None) -> tuple[Guidance, None]:
        """The rewards stay as they are."""
        return Guidance(), memory

    def worth(self, answers: Answers, memory: None) -> np.ndarray:
        """What each answer would have earned, [n, A]."""
        return answers.reward
