"""Makes the restaurant known to Gymnasium; imports nothing heavy."""

from __future__ import annotations

import gymnasium


def register() -> None:
    """Register ``evenhand/Restaurant-v0`` for ``gymnasium.make`` and ``make_vec``, once."""
    if "evenhand/Restaurant-v0" in gymnasium.registry:
        return
    gymnasium.register(
        id="evenhand/Restaurant-v0",
        entry_point="evenhand.restaurant.env:RestaurantEnv",
        vector_entry_point="evenhand.restaurant.vector:RestaurantVectorEnv",
    )
