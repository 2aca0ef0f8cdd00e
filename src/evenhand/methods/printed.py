"""The paper's methods, rewards of Eq. 4 and 5, and training on service alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError, unknown
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.paper.rewards import CREDITS, person_rewards
from evenhand.methods.registry import VERDICT, method


@method("service", label="service alone", colour=palette.BLACK, marker="o", filled=False)
class Service:
    """Nothing is paid for evenness."""

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Any, memory: None) -> tuple[Guidance, None]:
        """The rewards stay as they are."""
        return Guidance(), memory

    def worth(self, answers: Answers, memory: None) -> np.ndarray:
        """What each answer would have earned, [n, A]."""
        return answers.reward


@method("score", label="score (Eq. 4)", colour=palette.VERMILLION, marker="o")
@dataclass(frozen=True)
class Score:
    """Eq. 4: the more even an epoch, the more its services earn."""

    strength: float = 2.0
    """Greatest reward beside a perfect service's 1; no matter where evenness is all that pays."""

    credit: Literal["own_groups", "epoch"] = "own_groups"
    """Whose disparity the reward for a person counts.
    own_groups: of the groups this person belongs to.
    epoch: of all groups, the same for everybody."""

    def __post_init__(self) -> None:
        if self.credit not in CREDITS:
            raise unknown("credit", self.credit, CREDITS)
        if not 0.0 <= self.strength < np.inf:
            raise InputError(
                "range strength", f"strength is {self.strength}: give a finite number from 0 up"
            )

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Epoch, memory: None) -> tuple[Guidance, None]:
        """A service earns by the epoch that it belongs to."""
        return Guidance(evenness=self.pay(epoch, epoch, memory)), memory

    def pay(self, services: Epoch, window: Epoch, memory: None) -> np.ndarray:
        """What services earn by the scores of a window that is over, [m]."""
        if not services.tau.any():  # people mind nothing
            return np.zeros(len(services))
        paid = self._rewards(services, window)
        return self.strength * paid / services.tau.sum()

    def alone(self, epoch: Epoch) -> np.ndarray:
        """The printed reward and nothing else, [n]."""
        return self._rewards(epoch, epoch)

    def _rewards(self, services: Epoch, window: Epoch) -> np.ndarray:
        return person_rewards(window.scores, services.inside, services.tau, self.credit)


@method("penalty", label="penalty (Eq. 5)", colour=palette.ORANGE, marker="s")
@dataclass(frozen=True)
class Penalty(Score):
    """Eq. 4 and 5: as score, and all rewards of an epoch that looks biased are lowered."""

    strength: float = 1.0
    """Greatest reward beside a perfect service's 1; no matter where evenness is all that pays."""

    lam: float = 0.5
    """Lambda of Eq. 5, by which rewards of a biased epoch are multiplied, 0 to 1."""

    needs = (VERDICT,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.lam <= 1.0:
            raise InputError(
                "range lam", f"lam is {self.lam}: lambda multiplies rewards, give 0 to 1"
            )

    def _rewards(self, services: Epoch, window: Epoch) -> np.ndarray:
        reward = super()._rewards(services, window)
        return self.lam * reward if window.biased else reward
