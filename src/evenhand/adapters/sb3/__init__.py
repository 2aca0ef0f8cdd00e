"""Evenhand for Stable-Baselines3: its PPO and A2C in the restaurant, guided and examined.

Needs the extra ``sb3``. ``restaurant`` makes the restaurant as an environment of
Stable-Baselines3, ``ServiceVecEnv`` any vector environment of Gymnasium, and ``EvennessCallback``
judges what is served in training, on any environment of theirs.
"""

from __future__ import annotations

from evenhand.core import extras

extras.require("sb3", "an adapter for Stable-Baselines3")

from evenhand.adapters.sb3.loading import triton_first  # noqa: E402 - after the check

triton_first()

from evenhand.adapters.sb3.callback import EvennessCallback  # noqa: E402 - after the check
from evenhand.adapters.sb3.vec_env import ServiceVecEnv, restaurant  # noqa: E402

__all__ = ["EvennessCallback", "ServiceVecEnv", "restaurant"]
