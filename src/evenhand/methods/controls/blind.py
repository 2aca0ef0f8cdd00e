"""A cost of issues for everybody alike: better service, and no groups in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError
from evenhand.methods.epoch import Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.registry import method


def blind_pays(x: np.ndarray, price: np.ndarray) -> np.ndarray:
    """-Σ_k price_k x_ik, [n]; an issue that does not apply counts as had, as with level-up.

    Args:
        x: indicators, [n, K], NaN where an issue does not apply.
        price: of each issue, [K].
    """
    return -(np.nan_to_num(x, nan=1.0) @ price)


@method("blind", field="cost", label="blind cost", colour=palette.GREY, marker="^", filled=False)
@dataclass(frozen=True)
class Blind:
    """An issue costs the same whoever has it (control: no groups in it)."""

    cost: float = 0.5
    """c: what an issue costs, beside a service reward of about 1."""

    guarded: bool = True
    """Whether the cost gives way while service is poor or becomes worse for a group, as with
    level-up."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.cost < np.inf:
            raise InputError("range cost", f"cost is {self.cost}: give a finite number from 0 up")

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Epoch, memory: None) -> tuple[Guidance, None]:
        """Every issue costs c τ."""
        return Guidance(evenness=self.pay(epoch, epoch, memory)), memory

    def pay(self, services: Epoch, window: Epoch, memory: None) -> np.ndarray:
        """Every issue costs c τ, [m]."""
        share = services.guard_weight if self.guarded else 1.0
        return blind_pays(services.x, share * self.cost * services.tau)
