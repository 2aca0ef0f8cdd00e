"""The gradient over all answers: against finite differences, and the mean of the sampled one."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from jax.flatten_util import ravel_pytree

from evenhand.core.errors import InputError
from evenhand.training import all_answers
from evenhand.training.policy import PolicySettings
from evenhand.training.update import Anchor, UpdateSettings, make_learner

N, L, OBS = 5, 4, 3


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def policy(seed: int = 1, algorithm: str = "reinforce", **changes):
    settings = UpdateSettings(algorithm, "all_answers", anneal_updates=0, **changes)  # type: ignore
    return make_learner(OBS, PolicySettings(hidden=(4, 4)), settings, rng(seed)), settings


def walks(seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    made = rng(seed)
    return made.normal(size=(N, L, OBS)).astype(np.float32), made.normal(size=(N, L + 1))


def responding(state, seen: np.ndarray) -> np.ndarray:
    return np.exp(np.asarray(state.policy.log_probabilities(jnp.asarray(seen)), float))[..., 1]


def enumerated(h: np.ndarray) -> np.ndarray:
    """P of every answer by going through all courses of a service, [N, L + 1]."""
    out = np.zeros((len(h), L + 1))
    for i, course in itertools.product(range(len(h)), itertools.product((0, 1), repeat=L)):
        # every decision is drawn, whether or not it is reached
        chance = np.prod(np.where(course, h[i], 1 - h[i]))
        out[i, course.index(1) if 1 in course else L] += chance
    return out


def test_probabilities_of_answers_are_those_of_all_courses():
    state, _ = policy()
    seen, _ = walks()
    answers, reach = all_answers.log_answers(state.policy.log_probabilities(jnp.asarray(seen)))
    h = responding(state, seen)
    np.testing.assert_allclose(np.exp(answers), enumerated(h), rtol=1e-5)
    np.testing.assert_allclose(np.exp(answers).sum(axis=1), 1.0, rtol=1e-6)
    # reached: no response at any decision before
    before = np.cumprod(np.concatenate([np.ones((N, 1)), 1 - h], axis=1), axis=1)[:, :-1]
    np.testing.assert_allclose(np.exp(reach), before, rtol=1e-5)


def test_expected_worth_by_hand():
    # h = 0.2, then 0.5: 0.2 · 3 + 0.8 · 0.5 · 1 + 0.4 · -2; the second service does not count
    log = jnp.log(jnp.array([[[0.8, 0.2], [0.5, 0.5]], [[0.5, 0.5], [0.5, 0.5]]]))
    worth = jnp.array([[3.0, 1.0, -2.0], [9.0, 9.0, 9.0]])
    found = all_answers.expected_worth(log, worth, jnp.array([1.0, 0.0]))
    assert float(found) == pytest.approx(0.6 + 0.4 - 0.8, abs=1e-6)


def objective(flat, unravel, seen, worth, coefficient, anchor, held):
    """The whole loss in NumPy; the weight of entropy and pull is ``held``: it does not move."""
    log = np.asarray(unravel(flat).log_probabilities(seen), float)
    h = np.exp(log[..., 1])
    value = (enumerated(h) * worth).sum(axis=1).mean()
    entropy = -(np.exp(log) * log).sum(axis=-1)
    total = -value - coefficient * (entropy * held).sum() / held.sum()
    if anchor is not None:
        kept = np.asarray(anchor.policy.log_probabilities(seen), float)
        kl = (np.exp(kept) * (kept - log)).sum(axis=-1)
        total += anchor.weight * (kl * held).sum() / held.sum()
    return total


@pytest.mark.parametrize("pulled", [False, True])
def test_the_step_is_down_the_numerical_gradient(pulled):
    """One step of plain descent, against central differences of the enumerated objective."""
    state, settings = policy(passes=1, entropy_coefficient=0.3)
    seen, worth = walks()
    anchor = Anchor(policy(7)[0].policy, 0.4) if pulled else None
    services = all_answers.Weighed(
        seen, worth.astype(np.float32), np.zeros((N, L + 1), np.float32), np.ones(N, np.float32)
    )
    gradient = jax.grad(lambda p: all_answers._objective(p, services, anchor, settings)[0])
    found, _ = ravel_pytree(gradient(state.policy))
    flat, unravel = ravel_pytree(state.policy)
    h = responding(state, seen)
    held = np.cumprod(np.concatenate([np.ones((N, 1)), 1 - h], axis=1), axis=1)[:, :-1]
    rest = (unravel, seen, worth, settings.entropy_coefficient, anchor, held)
    step = 2e-2
    slopes = [
        (objective(flat.at[j].add(step), *rest) - objective(flat.at[j].add(-step), *rest))
        / (2 * step)
        for j in range(len(flat))
    ]
    np.testing.assert_allclose(found, slopes, rtol=2e-2, atol=2e-3)
    actor = np.abs(slopes) > 0
    assert actor.sum() > len(flat) // 3  # the critic has no part in it


def test_it_is_the_mean_of_the_sampled_gradient():
    """Score-function estimates of 40,000 sampled epochs, within 4 standard errors."""
    state, settings = policy(3, entropy_coefficient=0.0)
    seen, worth = walks(4)
    services = all_answers.Weighed(
        seen, worth.astype(np.float32), np.zeros((N, L + 1), np.float32), np.ones(N, np.float32)
    )
    gradient = jax.grad(lambda p: all_answers._objective(p, services, None, settings)[0])
    exact = -np.asarray(ravel_pytree(gradient(state.policy))[0])
    flat, unravel = ravel_pytree(state.policy)

    def log_of(values, observation):
        return unravel(values).log_probabilities(observation)

    slopes = np.asarray(jax.jacrev(log_of)(flat, jnp.asarray(seen)), float)  # [N, L, 2, W]
    h, made, runs = responding(state, seen), rng(9), 40_000
    drawn = made.random((runs, N, L)) < h
    answer = np.where(drawn.any(axis=2), drawn.argmax(axis=2), L)
    # ∇ log π of a whole service by its answer
    walked = np.concatenate(
        [np.zeros((N, 1, len(flat))), np.cumsum(slopes[:, :, 0], axis=1)], axis=1
    )
    whole = walked.copy()
    whole[:, :L] += slopes[:, :, 1]
    each = whole * worth[..., None]  # [N, L + 1, W]
    estimates = np.mean([each[i][answer[:, i]] for i in range(N)], axis=0)
    error = estimates.std(axis=0) / np.sqrt(runs)
    assert (np.abs(estimates.mean(axis=0) - exact) <= 4 * error + 1e-6).all()
    # and half of it would not pass
    assert (np.abs(estimates.mean(axis=0) - exact / 2) > 4 * error).any()


@pytest.mark.parametrize("algorithm", ["reinforce", "ppo"])
def test_it_learns_the_best_moment(algorithm):
    state, settings = policy(5, algorithm, learning_rate=0.05)
    seen = np.tile(np.eye(L, OBS, dtype=np.float32), (N, 1, 1))
    worth = np.tile([0.0, 0.1, 1.0, 0.2, -0.5], (N, 1))
    made = rng(1)
    for _ in range(60):
        state, report = all_answers.update(state, seen, worth, settings, made)
    h = responding(state, seen)
    assert np.exp(np.log(1 - h[0, :2]).sum()) * h[0, 2] > 0.9
    assert float(report.policy_loss) < -0.9
    assert np.isnan(float(report.value_loss))


def test_ppo_deals_services_and_reinforce_takes_all():
    calls = {}
    for algorithm in ("reinforce", "ppo"):
        state, settings = policy(6, algorithm, passes=3, minibatches=2)
        seen, worth = walks()
        after, _ = all_answers.update(state, seen, worth, settings, rng(1))
        calls[algorithm] = int(optax.tree.get(after.opt_state, "count"))
        assert settings.gradient_steps == calls[algorithm]
    assert calls == {"reinforce": 3, "ppo": 6}


def test_left_over_places_change_nothing():
    # 5 services in 2 minibatches of 3 places: one place is left over
    state, settings = policy(6, "ppo", passes=1, minibatches=2)
    seen, worth = walks()
    first, _ = all_answers.update(state, seen, worth, settings, rng(1))
    alone, settings = policy(6, "ppo", passes=1, minibatches=1)
    second, _ = all_answers.update(alone, seen[:1], worth[:1], settings, rng(1))
    for found in (first, second):
        assert np.isfinite(ravel_pytree(found.policy)[0]).all()


def test_surgery_lowers_unevenness_without_hurting_service():
    state, settings = policy(8, passes=1, learning_rate=1e-3, entropy_coefficient=0.0)
    seen, worth = walks(11)
    fair = rng(12).normal(size=worth.shape)

    def value(found, of):
        log = found.policy.log_probabilities(seen)
        return float(all_answers.expected_worth(log, jnp.asarray(of), jnp.ones(N)))

    plain, _ = all_answers.update(state, seen, worth, settings, rng())
    with_it, _ = all_answers.update(state, seen, worth, settings, rng(), fair)
    assert value(with_it, fair) > value(plain, fair)
    assert value(with_it, fair) >= value(state, fair) - 1e-6
    assert value(with_it, worth) > value(state, worth)


def test_what_does_not_fit_is_refused():
    state, settings = policy()
    seen, worth = walks()
    with pytest.raises(ValueError, match="worth has shape"):
        all_answers.update(state, seen, worth[:, :-1], settings, rng())
    worth[0, 0] = np.nan
    with pytest.raises(ValueError, match="worth is not finite"):
        all_answers.update(state, seen, worth, settings, rng())
    with pytest.raises(InputError) as wrong:
        UpdateSettings(credit="all")  # type: ignore[arg-type]
    assert wrong.value.field == "credit"
