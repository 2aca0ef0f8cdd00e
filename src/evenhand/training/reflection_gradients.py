"""Gradients behind self-reflection, of Evenhand's own learner: `methods.beyond.reflection`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from evenhand.methods.beyond.influence import Influence
from evenhand.methods.beyond.reflection import (
    Directions,
    Past,
    Reflection,
    ReflectionSettings,
    conclude,
)
from evenhand.training.batches import Trajectories
from evenhand.training.policy import ActorCritic, Network, of_networks


@jax.jit
def _examine(
    actor: Network, after: Network, trajectories: Trajectories, weights: Any
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """<step, ∇ log π> of each service [n], length of each direction [D], length of the step.

    One backward pass over the services; all directions are sums of its n gradients.
    """
    valid = jnp.asarray(trajectories.mask) > 0
    # What stands at masked places may be anything, also for the backward pass.
    obs = jnp.where(valid[..., None], trajectories.obs, 0.0)
    action = jnp.where(valid, trajectories.action, 0)

    def log_prob(network: Network, seen: jax.Array, did: jax.Array, happened: jax.Array) -> Any:
        each = jax.nn.log_softmax(network(seen))
        return jnp.sum(jnp.take_along_axis(each, did[:, None], axis=1)[:, 0] * happened)

    gradients = jax.vmap(jax.grad(log_prob), in_axes=(None, 0, 0, 0))(actor, obs, action, valid)
    flat = jnp.concatenate([x.reshape(len(obs), -1) for x in jax.tree.leaves(gradients)], axis=1)
    moved = jax.tree.map(jnp.subtract, after, actor)
    step = jnp.concatenate([jnp.ravel(x) for x in jax.tree.leaves(moved)])
    directions = jnp.asarray(weights, jnp.float32).T @ flat
    return flat @ step, jnp.sqrt(jnp.sum(jnp.square(directions), axis=1)), jnp.linalg.norm(step)


@dataclass(frozen=True, eq=False)
class Examination:
    """One update along the bias gradient, perhaps still being computed while Python goes on.

    Attributes:
        directions: in which bias rises.
        products: what ``_examine`` returns.
    """

    directions: Directions
    products: tuple[jax.Array, jax.Array, jax.Array]

    def conclude(self, past: Past, settings: ReflectionSettings) -> tuple[Reflection, Past]:
        """Wait for the products, and say what was found.

        Args:
            past: of the earlier updates.
            settings: when an update is abnormal.

        Returns:
            What was found, and the past of the next update.
        """
        along, lengths, step = (np.asarray(x, float) for x in self.products)
        return conclude(self.directions, along, lengths, float(step), past, settings)


def examine(
    before: ActorCritic,
    after: ActorCritic,
    trajectories: Trajectories,
    influence: Influence,
    groups: Sequence[tuple[str, str]],
    issues: Sequence[str],
    tau: Sequence[float],
) -> Examination:
    """Examine one update along the bias gradient.

    Args:
        before: the policy that served the epoch.
        after: the same after the update.
        trajectories: the services of the epoch.
        influence: of these services, see :meth:`Directions.of`.
        groups: (identity, category) of each group.
        issues: names of the issues.
        tau: weight of each issue.

    Raises:
        ValueError: the influence is of another number of services.
    """
    n = len(np.asarray(trajectories.mask))
    if len(influence.total) != n:
        raise ValueError(f"influence of {len(influence.total)} services, but {n} were given")
    directions = Directions.of(influence, groups, issues, tau)
    return Examination(
        directions, _examine(_actor(before), _actor(after), trajectories, directions.flat)
    )


def _actor(policy: Any) -> Any:
    """The part of a policy that acts, as a function of observations."""
    return policy.actor if of_networks(policy) else _Whole(policy)


class _Whole(eqx.Module):
    """A policy without an actor of its own."""

    policy: Any

    def __call__(self, obs: jax.Array) -> jax.Array:
        return self.policy.log_probabilities(obs)
