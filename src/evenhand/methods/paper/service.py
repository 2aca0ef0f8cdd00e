"""Training on service alone: what every method is compared with."""

from __future__ import annotations

from typing import Any

from evenhand.core import palette
from evenhand.methods.guidance import Guidance
from evenhand.methods.registry import method


@method("service", label="service alone", colour=palette.BLACK, marker="o", filled=False)
class Service:
    """Nothing is paid for evenness."""

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Any, memory: None) -> tuple[Guidance, None]:
        """The rewards stay as they are."""
        return Guidance(), memory
