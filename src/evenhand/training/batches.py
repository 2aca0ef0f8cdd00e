"""From the services of an epoch to the arrays that gradient steps use.

Compiled functions want fixed shapes, services differ in length: the decisions that happened are
packed into arrays of one of two sizes, and dealt into minibatches that hold equally many.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Trajectories(NamedTuple):
    """What the robot saw and did in the N services of one epoch, in the order of service.

    Attributes:
        obs: float32 [N, L, O], what the policy saw at each decision.
        action: int32 [N, L], 0 walk or 1 respond.
        mask: [N, L], 1 for decisions that happened; in each row these come first.
    """

    obs: Any
    action: Any
    mask: Any


class Decisions(NamedTuple):
    """Packed decisions: those that happened, service by service, then zeros with mask 0.

    Attributes:
        obs: float32 [C, O].
        action: int32 [C].
        advantage: float32 [C].
        target: float32 [C], what the critic should have said.
        fair: float32 [C], advantage towards evenness, for gradient surgery; 0 without it.
        mask: float32 [C].
    """

    obs: Any
    action: Any
    advantage: Any
    target: Any
    fair: Any
    mask: Any


def pack(
    trajectories: Trajectories, advantage: Any, target: Any, fair: Any = None
) -> tuple[Decisions, int]:
    """The decisions that happened, in half of the N x L places if they fit, else in all.

    Args:
        trajectories: the services of the epoch.
        advantage: [N, L].
        target: [N, L].
        fair: [N, L], or None for 0.

    Returns:
        The packed decisions and how many happened.

    Raises:
        ValueError: no decision happened, shapes differ, an action is neither 0 nor 1, or a number
            at a decision that happened is not finite.
    """
    valid = np.asarray(trajectories.mask) > 0
    count = int(valid.sum())
    if count == 0:
        raise ValueError("no decision happened: the mask is 0 everywhere")
    half = (valid.size + 1) // 2
    capacity = half if count <= half else valid.size

    def put(name: str, x: Any, dtype: type, ndim: int) -> np.ndarray:
        array = np.asarray(x)
        if array.ndim != ndim or array.shape[:2] != valid.shape:
            raise ValueError(f"{name} has shape {array.shape}, the mask has {valid.shape}")
        chosen = array[valid]
        if not np.isfinite(chosen).all():
            raise ValueError(f"{name} is not finite at a decision that happened")
        packed = np.zeros((capacity, *array.shape[2:]), dtype)
        packed[:count] = chosen
        return packed

    decisions = Decisions(
        obs=put("obs", trajectories.obs, np.float32, 3),
        action=put("action", trajectories.action, np.int32, 2),
        advantage=put("advantage", advantage, np.float32, 2),
        target=put("target", target, np.float32, 2),
        fair=np.zeros(capacity, np.float32) if fair is None else put("fair", fair, np.float32, 2),
        mask=(np.arange(capacity) < count).astype(np.float32),
    )
    if not np.isin(decisions.action, (0, 1)).all():
        raise ValueError("an action is neither 0 (walk) nor 1 (respond)")
    return decisions, count


def deal(
    count: int, capacity: int, passes: int, minibatches: int, rng: np.random.Generator
) -> np.ndarray:
    """Which packed decisions each gradient step uses.

    In every pass each decision is used once and the minibatches differ by at most one decision;
    only when there are fewer decisions than minibatches some are used again, since a step on
    nothing would still move the weights by Adam's momentum. Places that are left over hold
    ``capacity``, which no decision has.

    Args:
        count: decisions that happened; they are packed first.
        capacity: places for packed decisions.
        passes: times that each decision is used.
        minibatches: steps in one pass.
        rng: shuffles each pass.

    Returns:
        int32 [passes * minibatches, size], with one size for all counts of a capacity.
    """
    size = -(-capacity // minibatches)
    used = max(count, minibatches)
    deals = np.full((passes, size * minibatches), capacity, np.int32)
    for row in deals:
        row[:used] = np.resize(rng.permutation(count), used)
    # Dealt like cards: card j goes to minibatch j mod minibatches.
    return deals.reshape(passes, size, minibatches).swapaxes(1, 2).reshape(-1, size)
