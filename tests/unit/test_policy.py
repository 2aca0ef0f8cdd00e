"""The policy: first behaviour, weights, and the NumPy twin that acts."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.training.policy import (
    Actor,
    ActorCritic,
    Network,
    PolicySettings,
    make_policy,
    orthogonal,
    response_probability,
    state_values,
)
from support.refusals import refused

OBS = 25


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def tiny_policy() -> ActorCritic:
    """One input, one hidden unit, weights chosen by hand."""

    def network(head, bias):
        return Network(
            weights=(jnp.array([[2.0]]), jnp.array([head])),
            biases=(jnp.array([-1.0]), jnp.array(bias)),
            activation="tanh",
        )

    return ActorCritic(actor=network([1.0, 4.0], [0.5, 0.0]), critic=network([3.0], [0.25]))


def test_a_forward_pass_by_hand():
    # s = 1: hidden h = tanh(2 - 1); logits (h + 0.5, 4h); π(respond) = 1 / (1 + exp(0.5 - 3h)).
    h = math.tanh(1.0)
    p = 1 / (1 + math.exp(0.5 - 3 * h))
    obs = np.ones((1, 1), np.float32)
    policy = tiny_policy()
    assert response_probability(policy, obs)[0] == pytest.approx(p, rel=1e-6)
    assert Actor(policy).probability(obs)[0] == pytest.approx(p, rel=1e-6)
    assert state_values(policy, obs)[0] == pytest.approx(3 * h + 0.25, rel=1e-6)
    both = policy.log_probabilities(jnp.asarray(obs))[0]
    np.testing.assert_allclose(both, [math.log(1 - p), math.log(p)], rtol=1e-5)


def test_hidden_layers_of_relu_cut_off_what_is_negative():
    # s = -1: 2·(-1) - 1 = -3 becomes 0; logits (0.5, 0).
    tiny = tiny_policy()
    actor = Network(weights=tiny.actor.weights, biases=tiny.actor.biases, activation="relu")
    policy = ActorCritic(actor=actor, critic=tiny.critic)
    obs = -np.ones((1, 1), np.float32)
    expected = 1 / (1 + math.exp(0.5))
    assert response_probability(policy, obs)[0] == pytest.approx(expected, rel=1e-6)
    assert Actor(policy).probability(obs)[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("rate", [0.04, 0.5, 0.9])
def test_the_untrained_robot_responds_at_the_initial_rate(rate):
    # The head adds at most |w_respond - w_walk|·|h| to the log odds: two orthonormal columns
    # times 0.01 differ by 0.01·√2, and 64 units of tanh are at most 8 long, so 0.1132.
    policy = make_policy(OBS, PolicySettings(initial_response_rate=rate), rng())
    obs = rng(1).normal(size=(30, OBS)).astype(np.float32)
    odds = math.log(rate / (1 - rate))
    low, high = (1 / (1 + math.exp(-odds - change)) for change in (-0.1132, 0.1132))
    found = response_probability(policy, obs)
    assert np.all((found > low) & (found < high))


@pytest.mark.parametrize(("rows", "columns"), [(25, 64), (64, 25), (64, 64), (64, 1)])
def test_orthogonal_matrices_are(rows, columns):
    w = orthogonal(rows, columns, 3.0, rng()).astype(float)
    product = w.T @ w if rows >= columns else w @ w.T
    np.testing.assert_allclose(product, 9.0 * np.eye(min(rows, columns)), atol=1e-5)


def test_orthogonal_draws_have_no_favourite_sign():
    # Without the sign correction QR makes every diagonal entry of a square matrix lean one way.
    signs = [np.sign(orthogonal(1, 1, 1.0, rng(seed))[0, 0]) for seed in range(40)]
    assert 8 < signs.count(1.0) < 32


@pytest.mark.parametrize(("part", "head_gain", "outputs"), [("actor", 0.01, 2), ("critic", 1.0, 1)])
def test_layers_have_the_usual_gains(part, head_gain, outputs):
    network = getattr(make_policy(OBS, PolicySettings(hidden=(64, 32)), rng()), part)
    assert [w.shape for w in network.weights] == [(OBS, 64), (64, 32), (32, outputs)]
    gains = [np.linalg.svd(np.asarray(w), compute_uv=False) for w in network.weights]
    for found, gain in zip(gains, [math.sqrt(2), math.sqrt(2), head_gain], strict=True):
        np.testing.assert_allclose(found, gain, rtol=1e-5)
    for bias in network.biases[:-1]:
        np.testing.assert_array_equal(bias, 0)


def test_all_weights_are_single_precision():
    leaves = jax.tree.leaves(make_policy(OBS, PolicySettings(), rng()))
    assert {leaf.dtype for leaf in leaves} == {np.dtype("float32")}


def test_the_same_seed_gives_the_same_policy_and_another_gives_another():
    first, again, other = (make_policy(OBS, PolicySettings(), rng(seed)) for seed in (5, 5, 6))
    for a, b in zip(jax.tree.leaves(first), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first.actor.weights[0], other.actor.weights[0])


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("services", [1, 30])
def test_the_numpy_actor_is_the_policy(activation, services):
    policy = make_policy(OBS, PolicySettings(activation=activation), rng())
    # Trained heads are far larger than the first one: test over the whole range of answers.
    head = jnp.asarray(rng(2).normal(size=(64, 2)), jnp.float32)
    weights = (*policy.actor.weights[:-1], head)
    actor = Network(weights=weights, biases=policy.actor.biases, activation=activation)
    policy = ActorCritic(actor=actor, critic=policy.critic)
    obs = rng(1).normal(size=(services, OBS)).astype(np.float32)
    found = Actor(policy).probability(obs)
    assert found.dtype == np.float32
    assert found.shape == (services,)
    np.testing.assert_allclose(found, response_probability(policy, obs), atol=1e-6)


def test_the_numpy_actor_leaves_the_observations_alone():
    obs = rng(1).normal(size=(4, OBS)).astype(np.float32)
    before = obs.copy()
    Actor(make_policy(OBS, PolicySettings(), rng())).probability(obs)
    np.testing.assert_array_equal(obs, before)


def test_certainty_does_not_overflow():
    policy = tiny_policy()
    actor = Network(
        weights=(policy.actor.weights[0], jnp.array([[-1e4, 1e4]])),
        biases=policy.actor.biases,
        activation="tanh",
    )
    sure = Actor(ActorCritic(actor=actor, critic=policy.critic))
    np.testing.assert_array_equal(sure.probability(np.array([[9.0], [-9.0]])), [1.0, 0.0])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"hidden": ()}, "hidden is"),
        ({"hidden": (64, 0)}, "hidden is"),
        ({"hidden": (1_000_000_000,)}, "give 1 to 16 layers, each of 1 to 4,096 units"),
        ({"hidden": (1,) * 17}, "give 1 to 16 layers"),
        ({"activation": "tanhh"}, "did you mean 'tanh'"),
        ({"initial_response_rate": 0.0}, "initial_response_rate is 0.0"),
        ({"initial_response_rate": 1.0}, "initial_response_rate is 1.0"),
        ({"initial_response_rate": float("nan")}, "initial_response_rate is nan"),
    ],
)
def test_impossible_settings_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        PolicySettings(**wrong)


def test_an_observation_without_numbers_is_refused():
    with refused("range obs_size", "0"):
        make_policy(0, PolicySettings(), rng())
