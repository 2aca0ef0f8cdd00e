"""Losses against arithmetic done by hand; the working stands beside each number."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evenhand.methods.paper import losses
from evenhand.training import diagnostics

NAN = float("nan")


def test_masked_mean_counts_only_what_is_valid():
    assert losses.masked_mean(np.array([1.0, 3.0, NAN]), np.array([1, 1, 0])) == 2.0
    assert losses.masked_mean(np.array([NAN]), np.array([0])) == 0.0


# --- Eq. 6 ---


def test_people_returns_are_eq_6_with_the_repaired_exponent():
    # T = 3, γ = 1/2, C(S_T) = 8:
    #   t = 2: 4 + 8/2             = 8
    #   t = 1: 2 + 4/2 + 8/4       = 6
    #   t = 0: 1 + 2/2 + 4/4 + 8/8 = 4   (the printed exponent T-t+1 on r_2 would give 3.25)
    found = losses.people_returns(np.array([1.0, 2.0, 4.0]), 8.0, 0.5)
    np.testing.assert_array_equal(found, [4.0, 6.0, 8.0])


def test_people_advantages_compare_the_return_of_the_person_with_each_state():
    # Returns 4, 6, 8 from above; each minus the critic at the two decisions of that person.
    value = np.array([[1.0, 4.0], [0.0, 10.0], [8.0, -2.0]])
    found = losses.people_advantages(np.array([1.0, 2.0, 4.0]), value, 8.0, 0.5)
    np.testing.assert_array_equal(found, [[3.0, 0.0], [6.0, -4.0], [0.0, 10.0]])


# --- generalised advantage estimates ---


def test_gae_by_hand():
    # γ = λ = 1/2, so γλ = 1/4.
    # Row 0, r = 1 2 4, V = 2 4 2:  δ2 = 4 - 2         = 2     Â2 = 2
    #                               δ1 = 2 + 2/2 - 4   = -1    Â1 = -1 + 2/4 = -1/2
    #                               δ0 = 1 + 4/2 - 2   = 1     Â0 = 1 - 1/8  = 7/8
    # Row 1 ends after two:         δ1 = 2 - 4         = -2    Â1 = -2
    #                               δ0 = 1 + 4/2 - 2   = 1     Â0 = 1 - 2/4  = 1/2
    reward = np.array([[1.0, 2.0, 4.0], [1.0, 2.0, NAN]])
    value = np.array([[2.0, 4.0, 2.0], [2.0, 4.0, NAN]])
    mask = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
    advantage = losses.gae(reward, value, mask, 0.5, 0.5)
    np.testing.assert_array_equal(advantage, [[0.875, -0.5, 2.0], [0.5, -2.0, 0.0]])


def test_nothing_is_added_after_the_last_decision():
    # One decision, r = 3, V = 1: Â = 2, whatever γ and λ are and whatever value stands behind it.
    mask = np.array([[1.0, 0.0]])
    found = losses.gae(np.array([[3.0, 7.0]]), np.array([[1.0, 100.0]]), mask, 1.0, 1.0)
    np.testing.assert_array_equal(found, [[2.0, 0.0]])


# --- normalising ---


def test_normalise_by_hand():
    # Valid 1 and 3: mean 2, standard deviation 1.
    found = losses.normalise(np.array([1.0, 3.0, 100.0]), np.array([1, 1, 0]))
    np.testing.assert_allclose(found, [-1.0, 1.0, 0.0], rtol=1e-6)


@pytest.mark.parametrize("constant", [0.0, 0.1, -1234.567])
def test_advantages_that_are_all_alike_say_nothing(constant):
    # The rounding of a float32 mean must not be blown up into a direction.
    found = losses.normalise(np.full(1800, constant, np.float32), np.ones(1800))
    np.testing.assert_array_equal(found, np.zeros(1800))


# --- REINFORCE ---


def test_reinforce_by_hand():
    # (ln ½)·1 + (ln ¼)·(-2) = -ln 2 + 4 ln 2 = 3 ln 2; the mean of two is 1.5 ln 2.
    log_prob = np.log([0.5, 0.25, 0.9])
    found = losses.reinforce_loss(log_prob, np.array([1.0, -2.0, NAN]), np.array([1, 1, 0]))
    assert found == pytest.approx(-1.5 * math.log(2), rel=1e-6)


# --- Eq. 7 and 8 ---

PPO_CASES = {
    # old 0.5, ε = 0.2: (new probability, Â) -> min(r Â, clip(r) Â)
    "too likely, good: gain cut off at 1.2": (0.75, 2.0, 2.4),
    "too likely, bad: full loss of 1.5": (0.75, -2.0, -3.0),
    "too unlikely, good: full loss of 0.5": (0.25, 2.0, 1.0),
    "too unlikely, bad: gain cut off at 0.8": (0.25, -2.0, -1.6),
    "within: untouched": (0.55, 2.0, 2.2),
}


def ppo(log_prob, old, advantage, mask=None):
    ones = np.ones(len(old)) if mask is None else mask
    return losses.ppo_loss(log_prob, old, np.asarray(advantage), ones, 0.2)


def test_ratio_by_hand():
    found = losses.ratio(np.log([0.75, 0.25, 0.5]), np.log([0.5, 0.5, 0.5]), np.array([1, 1, 0]))
    np.testing.assert_allclose(found, [1.5, 0.5, 1.0], rtol=1e-6)


@pytest.mark.parametrize(("new", "advantage", "expected"), PPO_CASES.values(), ids=PPO_CASES)
def test_ppo_by_hand(new, advantage, expected):
    found = ppo(np.log([new]), np.log([0.5]), [advantage])
    assert found == pytest.approx(-expected, rel=1e-6)


def test_ppo_averages_over_valid_decisions():
    # (2.4 - 3 + 1 - 1.6) / 4 = -0.3
    new = np.log([0.75, 0.75, 0.25, 0.25, 0.9])
    old = np.log([0.5, 0.5, 0.5, 0.5, 0.1])
    found = ppo(new, old, [2.0, -2.0, 2.0, -2.0, NAN], np.array([1, 1, 1, 1, 0]))
    assert found == pytest.approx(0.3, rel=1e-5)


def test_ppo_with_an_unchanged_policy_is_minus_the_mean_advantage():
    old = np.log([0.5, 0.9, 0.04])
    assert ppo(old, old, [3.0, -1.0, 4.0]) == -2.0


def test_ppo_stops_pushing_only_where_the_gain_is_cut_off():
    # d(-r Â)/d log π = -r Â: for r = 1.5 and Â = -2 it is 3; for Â = 2 it is cut off, 0.
    def slope(advantage: float) -> float:
        return float(jax.grad(lambda x: ppo(x[None], np.log([0.5]), [advantage]))(jnp.log(0.75)))

    assert slope(-2.0) == pytest.approx(3.0, rel=1e-5)
    assert slope(2.0) == 0.0


# --- critic, entropy, diagnostics ---


def test_value_loss_by_hand():
    # Half of (1 + 4) / 2.
    value, target = np.array([1.0, 3.0, NAN]), np.array([2.0, 1.0, 0.0])
    assert losses.value_loss(value, target, np.array([1, 1, 0])) == 1.25


def test_entropy_by_hand():
    # Even odds: ln 2. Odds 1:3: ¼ ln 4 + ¾ ln(4/3) = ln 4 - ¾ ln 3.
    both = jnp.log(jnp.array([[0.5, 0.5], [0.25, 0.75], [0.1, 0.9]]))
    expected = (math.log(2) + math.log(4) - 0.75 * math.log(3)) / 2
    assert diagnostics.entropy(both, np.array([1, 1, 0])) == pytest.approx(expected, rel=1e-6)


def test_approx_kl_by_hand():
    # r = 2: 1 - ln 2; r = ½: -½ + ln 2; their mean is ¼.
    found = diagnostics.approx_kl(np.log([0.5, 0.25]), np.log([0.25, 0.5]), np.ones(2))
    assert found == pytest.approx(0.25, rel=1e-6)


def test_clip_fraction_by_hand():
    # Ratios 1.5, 0.5, 1.1, 1 and a masked 9: two of four are outside 1 ± 0.2.
    new, old = np.log([0.75, 0.25, 0.55, 0.5, 0.9]), np.log([0.5, 0.5, 0.5, 0.5, 0.1])
    assert diagnostics.clip_fraction(new, old, np.array([1, 1, 1, 1, 0]), 0.2) == 0.5


def test_explained_variance_by_hand():
    # Var(0, 2, 4) = 8/3; residuals 0, 0, 3 have mean 1 and variance 2; 1 - 2 / (8/3) = ¼.
    target, mask = np.array([0.0, 2.0, 4.0, NAN]), np.array([1, 1, 1, 0])
    found = diagnostics.explained_variance(np.array([0.0, 2.0, 1.0, 5.0]), target, mask)
    assert found == pytest.approx(0.25, rel=1e-6)
    assert diagnostics.explained_variance(target, target, mask) == 1.0


def test_explained_variance_of_a_constant_is_not_a_number():
    target = np.full(7, 0.1, np.float32)
    assert math.isnan(diagnostics.explained_variance(np.arange(7.0), target, np.ones(7)))
