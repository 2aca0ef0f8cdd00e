"""How long a comparison computed, by its manifest; imports nothing heavy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def computed(noted: Mapping[str, Any]) -> float | None:
    """Seconds of computing of a comparison and of those that it took runs from, if noted."""
    found, one = [], noted
    while isinstance(one, Mapping):
        found.append(one.get("run_seconds"))
        one = one.get("earlier")
    if not all(isinstance(seconds, (int, float)) for seconds in found):
        return None
    return float(sum(found))
