"""One update: its gradient against finite differences, what it learns, what it must not see."""

import itertools

import jax
import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.training.batches import deal
from evenhand.training.policy import response_probability, state_values
from evenhand.training.update import Trajectories, UpdateSettings, update
from support.updates import (
    ALGORITHMS,
    OBS,
    L,
    N,
    Reference,
    assert_same_bits,
    grid,
    learner,
    plain_steps,
    rng,
    services,
    vector,
)


def test_reinforce_steps_down_the_gradient():
    settings = plain_steps("reinforce")
    state, trajectories = learner(settings), services()
    reference = Reference(trajectories, grid(1), grid(2), settings)
    slope = reference.gradient(vector(state), None)
    after, report = update(state, trajectories, grid(1), grid(2), settings, rng())
    np.testing.assert_allclose(vector(after), vector(state) - 2 * slope, rtol=1e-3, atol=2e-6)
    assert float(report.grad_norm) == pytest.approx(np.linalg.norm(slope), rel=1e-4)


def test_ppo_keeps_its_old_policy_over_the_passes():
    # Two passes over all decisions at once; the second starts where ratios have left 1 ± ε.
    settings = plain_steps("ppo", passes=2, minibatches=1, clip=0.05)
    state, trajectories = learner(settings), services()
    reference = Reference(trajectories, grid(1), grid(2), settings)
    start = vector(state)
    old = reference.outputs(start)[0]
    first = reference.gradient(start, old)
    middle = start - 2 * first
    ratios = np.exp(reference.outputs(middle)[0] - old)
    assert np.any(np.abs(ratios - 1) > 0.05)
    second = reference.gradient(middle, old)
    end = middle - 2 * (0.09 * first + 0.1 * second) / 0.19
    after, report = update(state, trajectories, grid(1), grid(2), settings, rng())
    np.testing.assert_allclose(vector(after), end, rtol=1e-3, atol=5e-6)

    # The report's numbers, from the same reference.
    log_prob, log_p, _ = reference.outputs(end)
    ratios = np.exp(log_prob - old)
    value = reference.outputs(start)[2]
    valid_advantage = grid(1)[trajectories.mask > 0].astype(float)
    first_loss = -np.mean(valid_advantage)  # the ratio is 1 before the first step
    later = np.exp(reference.outputs(middle)[0] - old)
    second_loss = -np.mean(
        np.minimum(later * valid_advantage, np.clip(later, 0.95, 1.05) * valid_advantage)
    )
    expected = {
        "policy_loss": (first_loss + second_loss) / 2,
        "entropy": -np.mean((np.exp(log_p) * log_p).sum(axis=1)),
        "approx_kl": np.mean(ratios - 1 - np.log(ratios)),
        "clip_fraction": np.mean(np.abs(ratios - 1) > 0.05),
        "explained_variance": 1 - np.var(reference.target - value) / np.var(reference.target),
        "grad_norm": (np.linalg.norm(first) + np.linalg.norm(second)) / 2,
    }
    for name, number in expected.items():
        assert getattr(report, name) == pytest.approx(number, rel=1e-3, abs=1e-5), name


def test_each_minibatch_averages_over_its_own_decisions():
    # 40 decisions fill all packed places; three minibatches of 14 leave two places over. With a
    # step size of almost nothing every ratio stays 1: each loss is minus the mean advantage.
    settings = UpdateSettings(
        algorithm="ppo", learning_rate=1e-12, passes=1, minibatches=3, normalise_advantage=False
    )
    trajectories = services()._replace(mask=np.tile(np.arange(L) < L // 2, (N, 1)))
    _, report = update(learner(settings), trajectories, grid(1), grid(2), settings, rng())
    hands = deal(40, 40, 1, 3, rng())
    packed = grid(1)[:, : L // 2].reshape(-1).astype(float)
    expected = -np.mean([packed[hand[hand < 40]].mean() for hand in hands])
    assert float(report.policy_loss) == pytest.approx(expected, rel=1e-4)
    assert float(report.approx_kl) == pytest.approx(0.0, abs=1e-7)
    assert float(report.clip_fraction) == 0


def test_long_gradients_are_shortened():
    settings = plain_steps("reinforce", max_grad_norm=0.01)
    state = learner(settings)
    after, report = update(state, services(), grid(1), grid(2), settings, rng())
    assert float(report.grad_norm) > 0.02
    # Twice the shortened gradient.
    assert np.linalg.norm(vector(after) - vector(state)) == pytest.approx(0.02, rel=1e-3)


# --- what is learned ---


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_it_learns_to_respond_where_responding_pays(algorithm):
    # A bandit: responding pays 1 where the first number is positive and costs 1 elsewhere,
    # walking pays nothing. The untrained robot responds to 4 % of either.
    settings = UpdateSettings(algorithm=algorithm, learning_rate=0.01)
    state, draw = learner(settings), rng(3)
    mask = np.ones((N, L), np.float32)
    mask[:, L // 2 :] = 0
    for _ in range(150):
        obs = draw.choice(np.array([-1.0, 1.0], np.float32), size=(N, L, OBS))
        action = (draw.random((N, L)) < response_probability(state.policy, obs)).astype(np.int32)
        reward = action * obs[..., 0]
        advantage = reward - np.asarray(state_values(state.policy, obs))
        trajectories = Trajectories(obs, action, mask)
        state, report = update(state, trajectories, advantage, reward, settings, draw)
    corners = np.array(list(itertools.product((-1, 1), repeat=OBS)), np.float32)
    costs, pays = np.split(np.asarray(response_probability(state.policy, corners)), 2)
    assert pays.min() > 0.9
    assert costs.max() < 0.1
    # The critic has learned what to expect: 1 where it pays, 0 elsewhere.
    assert float(report.explained_variance) > 0.8


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_one_update_raises_what_was_good_and_lowers_what_was_bad(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    state, trajectories = learner(settings), services()
    good = np.where(trajectories.action == 1, 1.0, -1.0)  # responding was good, walking bad
    after, _ = update(state, trajectories, good, np.zeros((N, L)), settings, rng())
    obs = trajectories.obs[trajectories.mask > 0]
    before = response_probability(state.policy, obs).mean()
    assert response_probability(after.policy, obs).mean() > before


# --- what must not matter ---


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_masked_decisions_have_no_influence(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    trajectories, advantage, target = services(), grid(1), grid(2)
    state = learner(settings)
    clean = update(state, trajectories, advantage, target, settings, rng())
    after = trajectories.mask == 0
    for rubbish in (17.0, np.nan):
        soiled = Trajectories(
            obs=np.where(after[..., None], np.float32(rubbish), trajectories.obs),
            action=np.where(after, 1 - trajectories.action, trajectories.action),
            mask=trajectories.mask,
        )
        a = np.where(after, np.float32(rubbish), advantage)
        t = np.where(after, np.float32(rubbish), target)
        found = update(state, soiled, a, t, settings, rng())
        assert_same_bits(clean[0], found[0])
        assert clean[1] == found[1]


def doubled(x):
    """As many empty places again behind every service."""
    return np.concatenate([x, np.zeros_like(x)], axis=1)


def test_empty_places_behind_all_services_change_nothing():
    settings = UpdateSettings(algorithm="reinforce")
    short = services()
    wide = Trajectories(doubled(short.obs), doubled(short.action), doubled(short.mask))
    state = learner(settings)
    once, _ = update(state, short, grid(1), grid(2), settings, rng())
    again, _ = update(state, wide, doubled(grid(1)), doubled(grid(2)), settings, rng())
    np.testing.assert_allclose(vector(once), vector(again), rtol=1e-4, atol=1e-6)


def test_advantages_scaled_alike_give_the_same_update():
    # Four times is exact in binary, so even the bits agree: a constant λ changes nothing.
    settings = UpdateSettings(algorithm="ppo")
    state = learner(settings)
    once, _ = update(state, services(), grid(1), grid(2), settings, rng())
    again, _ = update(state, services(), 4 * grid(1), grid(2), settings, rng())
    assert_same_bits(once, again)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_two_runs_agree_bit_for_bit(algorithm):
    def run(seed):
        settings = UpdateSettings(algorithm=algorithm)
        state, draw = learner(settings), rng(seed)
        reports = []
        for epoch in range(3):
            state, report = update(state, services(epoch), grid(1), grid(2), settings, draw)
            reports.append(report)
        return state, reports

    first, again = run(0), run(0)
    assert_same_bits(first[0], again[0])
    assert first[1] == again[1]
    assert int(first[0].step) == 3


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_only_ppo_draws_from_the_generator(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    state, draw = learner(settings), rng(0)
    one, _ = update(state, services(), grid(1), grid(2), settings, draw)
    two, _ = update(state, services(), grid(1), grid(2), settings, rng(1))
    unused = draw.random() == rng(0).random()
    assert unused == np.array_equal(vector(one), vector(two)) == (algorithm == "reinforce")


def test_an_update_leaves_the_state_before_as_it_was():
    settings = UpdateSettings(algorithm="reinforce")
    state = learner(settings)
    before = [np.array(leaf) for leaf in jax.tree.leaves(state)]
    update(state, services(), grid(1), grid(2), settings, rng())
    for a, b in zip(before, jax.tree.leaves(state), strict=True):
        np.testing.assert_array_equal(a, b)


# --- settings ---


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"algorithm": "pppo"}, "did you mean 'ppo'"),
        ({"learning_rate": 0.0}, "learning_rate is 0.0; give a number above 0"),
        ({"adam_eps": -1.0}, "adam_eps is -1.0"),
        ({"clip": float("nan")}, "clip is nan"),
        ({"max_grad_norm": float("inf")}, "max_grad_norm is inf"),
        ({"entropy_coefficient": -0.1}, "entropy_coefficient is -0.1; give 0 or"),
        ({"value_coefficient": float("nan")}, "value_coefficient is nan"),
        ({"gamma": 1.01}, "gamma is 1.01; give a number from 0 to 1"),
        ({"gae_lambda": -0.5}, "gae_lambda is -0.5"),
        ({"passes": 0}, "passes is 0: give a whole number from 1 to 10000"),
        ({"passes": 100_000_000_000}, "passes is 100000000000"),
        ({"minibatches": -3}, "minibatches is -3"),
        ({"minibatches": 1_000_000}, "minibatches is 1000000"),
    ],
)
def test_impossible_settings_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        UpdateSettings(**wrong)


def test_the_usual_step_size_depends_on_the_algorithm():
    assert UpdateSettings(algorithm="ppo").step_size == 0.001
    assert UpdateSettings(algorithm="reinforce").step_size == 0.003
    assert UpdateSettings(algorithm="reinforce", learning_rate=0.5).step_size == 0.5


@pytest.mark.parametrize("algorithm", ["reinforce", "ppo"])
def test_the_annealed_step_size_falls_evenly_to_nothing(algorithm):
    """Adam's first step has the length of its step size: of 2 annealed updates the second gets
    half of it, and the third none.
    """
    sizes = {"passes": 1, "minibatches": 1, "adam_eps": 1e-12, "entropy_coefficient": 0.0}
    plain = UpdateSettings(algorithm=algorithm, learning_rate=0.01, **sizes)
    annealed = UpdateSettings(algorithm=algorithm, learning_rate=0.01, anneal_updates=2, **sizes)
    batch, advantage, target = services(), grid(1), grid(2)
    start = learner(plain)
    once, _ = update(start, batch, advantage, target, plain, rng())
    states = [learner(annealed)]
    for _ in range(3):
        states.append(update(states[-1], batch, advantage, target, annealed, rng())[0])
    moved = [np.abs(vector(b) - vector(a)).max() for a, b in itertools.pairwise(states)]
    assert_same_bits(states[1].policy, once.policy)
    assert moved[0] == pytest.approx(0.01, rel=1e-3)
    assert 0.0 < moved[1] < 0.0075
    assert moved[2] == 0.0
