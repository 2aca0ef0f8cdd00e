"""How a policy and a critic are doing: entropy, divergences, and what the critic foresees.

Shapes and masks as in `evenhand.methods.paper.losses`.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from evenhand.methods.paper.losses import masked_mean, ratio, spread


def entropy(log_probabilities: jax.Array, mask: ArrayLike) -> jax.Array:
    """Mean entropy of the policy in nats; log-probabilities of all actions, [..., 2]."""
    each = -jnp.sum(jnp.exp(log_probabilities) * log_probabilities, axis=-1)
    return masked_mean(each, mask)


def divergence(anchor: jax.Array, log_probabilities: jax.Array, mask: ArrayLike) -> jax.Array:
    """Mean of KL(anchor ‖ policy) in nats, from log-probabilities of all actions, [..., 2]."""
    each = jnp.sum(jnp.exp(anchor) * (anchor - log_probabilities), axis=-1)
    return masked_mean(each, mask)


def approx_kl(log_prob: ArrayLike, old_log_prob: ArrayLike, mask: ArrayLike) -> jax.Array:
    """How far the policy moved: mean of (r - 1) - log r, an estimate of KL(old ‖ new), >= 0."""
    difference = jnp.subtract(log_prob, old_log_prob)
    return masked_mean(jnp.expm1(difference) - difference, mask)


def clip_fraction(
    log_prob: ArrayLike, old_log_prob: ArrayLike, mask: ArrayLike, clip: float
) -> jax.Array:
    """Share of valid decisions whose ratio left [1-ε, 1+ε]."""
    outside = jnp.abs(ratio(log_prob, old_log_prob, mask) - 1.0) > clip
    return masked_mean(outside, mask)


def explained_variance(value: ArrayLike, target: ArrayLike, mask: ArrayLike) -> jax.Array:
    """1 - Var(target - V) / Var(target): 1 is a perfect critic, 0 no better than a constant.

    Not a number when all targets are alike.
    """
    _, residual = spread(jnp.subtract(target, value), mask)
    _, total = spread(target, mask)
    return jnp.where(total > 0, 1.0 - jnp.square(residual / total), jnp.nan)
