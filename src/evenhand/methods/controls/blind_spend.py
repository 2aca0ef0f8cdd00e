"""What a method spends on evenness, spread over everybody: its size without its aim."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.methods.controls.blind import blind_pays
from evenhand.methods.epoch import Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.registry import method


@method("blind_spend", label="blind spending", colour=palette.GREY, marker="v", filled=False)
@dataclass(frozen=True)
class BlindSpend:
    """In every epoch what level-up would spend on each issue, from everybody who had it (control).

    The method is taught the same epochs, so that the two differ in one thing: who pays.
    """

    strength: float = 5.0
    """Of the method whose spending it is."""

    of: str = "levelup"
    """That method."""

    def __post_init__(self) -> None:
        found = registry.create(self.of)
        if not hasattr(found, "pay") or registry.strength_of(found) is None:
            raise InputError(
                "unsupported of",
                f"{self.of} does not say what it pays each service, or has no strength: name one "
                "that does, such as levelup",
            )
        _ = self._method

    @property
    def _method(self) -> Any:
        found = registry.create(self.of)
        field = registry.entry_of(found).strength
        assert field is not None
        return replace(found, **{field: self.strength})

    @property
    def needs(self) -> tuple[str, ...]:
        """What the method needs."""
        return tuple(registry.needs_of(self._method))

    def begin(self, scheme: Any) -> Any:
        """Memory of the method."""
        return self._method.begin(scheme)

    def teach(self, epoch: Epoch, memory: Any) -> tuple[Guidance, Any]:
        """What the method would have paid, spread."""
        _, memory = self._method.teach(epoch, memory)
        return Guidance(evenness=self.pay(epoch, epoch, memory)), memory

    def pay(self, services: Epoch, window: Epoch, memory: Any) -> np.ndarray:
        """By the prices of the window, [m]."""
        # a window that is over may have been restored, and the guard has gone on since then
        return blind_pays(services.x, self.price(replace(window, guard=services.guard), memory))

    def price(self, window: Epoch, memory: Any) -> np.ndarray:
        """Of each issue for everybody: what the method takes for it over who had it, [K]."""
        chosen, had = self._method, np.nan_to_num(window.x, nan=1.0).sum(axis=0)
        spent = np.zeros(len(had))
        for k in range(len(had)):
            tau = np.where(np.arange(len(had)) == k, window.tau, 0.0)
            alone = replace(window, tau=tau)
            spent[k] = -chosen.pay(alone, alone, memory).sum()
        return spent / np.maximum(had, 1.0)
