"""Gradient surgery: evenness not at the cost of service, service not at the cost of evenness.

Functions on trees of arrays of one structure, a flat vector included; they may run under jit.
"""

from __future__ import annotations

from typing import TypeVar

import jax
import jax.numpy as jnp

Tree = TypeVar("Tree")


def dot(a: Tree, b: Tree) -> jax.Array:
    """Inner product over all leaves, a scalar."""
    products = jax.tree.map(lambda x, y: jnp.sum(x * y), a, b)
    return sum(jax.tree.leaves(products), jnp.zeros(()))


def _without(a: Tree, b: Tree, amount: jax.Array) -> Tree:
    """``a - amount b / |b|²``; ``a`` itself when b is 0."""
    square = dot(b, b)
    share = jnp.where(square > 0, amount / jnp.where(square > 0, square, 1.0), 0.0)
    return jax.tree.map(lambda x, y: x - share * y, a, b)


def surgery(fair: Tree, service: Tree) -> Tree:
    """The fairness gradient without what works against service (PCGrad, Yu et al. 2020).

    Both point where their objective rises. Where the two conflict (a negative inner product) the
    fairness gradient is projected onto the plane at a right angle to the service gradient: to
    first order, service is not made worse. Otherwise it stays as it is.
    """
    return _without(fair, service, jnp.minimum(dot(fair, service), 0.0))


def off_bias(update: Tree, bias: Tree) -> Tree:
    """An update without what raises bias.

    Args:
        update: what is about to be added to the weights.
        bias: gradient of the total issue score.

    Returns:
        The update, projected onto the plane at a right angle to ``bias`` if it would have raised
        the score to first order, else as it was: service is not bought with more bias.
    """
    return _without(update, bias, jnp.maximum(dot(update, bias), 0.0))
