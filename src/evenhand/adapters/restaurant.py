"""Evenhand's own restaurant for the adapters: the paper's identities and issues, from its infos."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenhand.adapters.episodes import Ended
from evenhand.restaurant.scheme import SCHEME

__all__ = ["SCHEME", "facts_of"]


def facts_of(ended: Ended) -> dict[str, Any]:
    """What the restaurant's infos say of services that have ended; a facts function."""
    codes = np.stack(list(ended.first_info("identities")))
    facts = {fact.name: ended.info(f"facts.{fact.name}") for fact in SCHEME.facts}
    return facts | {name: codes[:, d] for d, name in enumerate(SCHEME.names)}
