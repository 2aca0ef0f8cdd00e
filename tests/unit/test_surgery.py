"""Gradient surgery by hand, its laws, and under jit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evenhand.training.surgery import dot, off_bias, surgery


def vectors(*numbers):
    return tuple(jnp.asarray(x, jnp.float32) for x in numbers)


@pytest.mark.parametrize(
    ("fair", "service", "expected"),
    [
        ([1.0, 2.0], [0.0, -4.0], [1.0, 0.0]),  # conflict: the second axis goes
        ([1.0, 2.0], [0.0, 4.0], [1.0, 2.0]),  # agreement
        ([1.0, 2.0], [2.0, -1.0], [1.0, 2.0]),  # right angle
        ([-3.0, 1.0], [1.0, 1.0], [-2.0, 2.0]),  # -2/2 of the service gradient goes
        ([1.0, 2.0], [0.0, 0.0], [1.0, 2.0]),
        ([0.0, 0.0], [1.0, 1.0], [0.0, 0.0]),
    ],
)
def test_fairness_off_service(fair, service, expected):
    np.testing.assert_allclose(surgery(*vectors(fair, service)), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("update", "bias", "expected"),
    [
        ([1.0, 2.0], [0.0, 4.0], [1.0, 0.0]),  # would raise bias
        ([1.0, 2.0], [0.0, -4.0], [1.0, 2.0]),  # lowers it
        ([3.0, -1.0], [1.0, 1.0], [2.0, -2.0]),
        ([1.0, 2.0], [0.0, 0.0], [1.0, 2.0]),
    ],
)
def test_update_off_bias(update, bias, expected):
    np.testing.assert_allclose(off_bias(*vectors(update, bias)), expected, atol=1e-6)


def test_trees_are_one_long_vector():
    rng = np.random.default_rng(0)
    fair, service = rng.normal(size=(2, 10)).astype(np.float32)
    service -= 2 * fair  # surely in conflict

    def tree(x):
        return {"weight": jnp.asarray(x[:6]).reshape(2, 3), "bias": (jnp.asarray(x[6:]),)}

    whole = surgery(*vectors(fair, service))
    parts = jax.jit(surgery)(tree(fair), tree(service))
    np.testing.assert_allclose(parts["weight"].ravel(), whole[:6], rtol=1e-5)
    np.testing.assert_allclose(parts["bias"][0], whole[6:], rtol=1e-5)
    assert dot(tree(fair), tree(service)) == pytest.approx(float(fair @ service), rel=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_neither_is_bought_with_the_other(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        fair, service = vectors(*rng.normal(size=(2, 7)))
        kept = surgery(fair, service)
        assert float(dot(kept, service)) >= -1e-5
        assert float(dot(kept, fair)) >= -1e-5  # evenness still gains, or nothing is done
        together = off_bias(service + kept, -fair)
        assert float(dot(together, -fair)) <= 1e-5
