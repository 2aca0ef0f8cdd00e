"""The rivals by hand: the formulas, what is remembered, and the one form of calling them."""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp

from evenhand import issues
from evenhand.errors import InputError
from evenhand.learn import rival_epoch, rivals
from evenhand.learn import rival_formulas as formulas
from evenhand.learn.rival_epoch import EpochOutcome

NAN = np.nan
NONE_EARLIER = issues.Counts(*np.zeros((4, 2, 1)))
TWO_GROUPS = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])


def two_groups(**changes: Any) -> EpochOutcome:
    """Four services of one decision each, of people of a, b, a, b."""
    outcome = EpochOutcome(
        reward=np.array([1.0, 0.0, 0.5, 0.5]),
        x=np.array([[1.0], [0.0], [0.0], [1.0]]),
        inside=TWO_GROUPS,
        identity=np.array([0, 0]),
        advantage=np.array([[2.0], [0.0], [1.0], [4.0]]),
        mask=np.ones((4, 1)),
        score=0.3,
        cost=np.array([3.0, 0.0, 1.0, 0.0]),
    )
    return replace(outcome, **changes)


class TestLagrangian:
    def test_the_multiplier_by_hand(self):
        # 0.1 + 2 (0.3 - 0.2), and 0.1 + 2 (0 - 0.2) = -0.3, which is not allowed
        assert formulas.multiplier(0.1, 0.3, limit=0.2, rate=2.0) == pytest.approx(0.3)
        assert formulas.multiplier(0.1, 0.0, limit=0.2, rate=2.0) == 0.0

    def test_an_unknown_score_leaves_the_multiplier(self):
        assert formulas.multiplier(0.7, NAN, limit=0.2, rate=2.0) == 0.7

    def test_the_advantage_by_hand(self):
        # of three decisions the mean cost is (3 + 3 + 0) / 3 = 2, so A_c is 1, 1, -2:
        # (2 - 0.5) / 1.5, (1 - 0.5) / 1.5, (-1 + 1) / 1.5
        advantage = np.array([[2.0, 1.0], [-1.0, NAN]])
        mask = np.array([[1.0, 1.0], [1.0, 0.0]])
        mixed = formulas.lagrangian_advantage(advantage, mask, np.array([3.0, 0.0]), 0.5)
        np.testing.assert_allclose(mixed, [[1.0, 1 / 3], [0.0, 0.0]], atol=1e-15)

    def test_lambda_steps_before_it_is_used(self):
        # λ = 0 + 5 (0.3 - 0.1) = 1; the mean cost is 1: (2 - 2)/2, (0 + 1)/2, (1 - 0)/2, (4 + 1)/2
        method = rivals.Lagrangian(limit=0.1, rate=5.0)
        advantage, state = method.shape(two_groups(), method.begin(2, 1))
        assert state.lam == pytest.approx(1.0)
        np.testing.assert_allclose(advantage[:, 0], [0.0, 0.5, 0.5, 2.5], atol=1e-15)
        # and again from there: 1 + 5 (0.2 - 0.1)
        _, state = method.shape(two_groups(score=0.2), state)
        assert state.lam == pytest.approx(1.5)


class TestRunningScore:
    # a has the issue, b not, a not, b: rates a 1, b -; a 1, b 0; a 1/2, b 0; a 1/2, b 1/2
    X = np.array([[1.0], [0.0], [0.0], [1.0]])

    def test_by_hand(self):
        score = formulas.running_scores(self.X, TWO_GROUPS, NONE_EARLIER)
        np.testing.assert_allclose(score, [0.0, 0.0, 1.0, 0.5, 0.0])

    def test_earlier_services_are_pooled(self):
        # before: one of a without the issue, one of b with it. a 0, b 1; a 1/2, b 1; a 1/2, b 1/2;
        # a 1/3, b 1/2; a 1/3, b 2/3
        earlier = issues.count(np.array([[0.0], [1.0]]), TWO_GROUPS[:2])
        score = formulas.running_scores(self.X, TWO_GROUPS, earlier)
        np.testing.assert_allclose(score, [1.0, 1 / 2, 0.0, 1 / 6, 1 / 3])

    def test_issues_add_up_and_some_do_not_apply(self):
        x = np.array([[1.0, NAN], [0.0, 0.0], [NAN, 1.0]])
        score = formulas.running_scores(x, TWO_GROUPS[:3], issues.Counts(*np.zeros((4, 2, 2))))
        # the second issue can be compared from the third service on: 1 + 1
        np.testing.assert_allclose(score, [0.0, 0.0, 1.0, 2.0])

    def test_unknown_people_count_nowhere(self):
        inside = TWO_GROUPS.copy()
        inside[1] = NAN
        score = formulas.running_scores(self.X, inside, NONE_EARLIER)
        # only the last is of b: a 1/2, b 1
        np.testing.assert_allclose(score, [0.0, 0.0, 0.0, 0.0, 0.5])


class TestAPPO:
    def test_by_hand(self):
        # Δ 0, 1, 0.5, 0 after the people, δΔ 0, 1, -0.5, -0.5, ω = 0.25
        # A 2, 0, 1, 4 -> 0.5, 0, 0.25, 1
        # min(0, ω - Δ) = 0, -0.75, -0.25, 0 -> 1, 0, 2/3, 1
        # min(0, -1[Δ > ω] δΔ) = 0, -1, 0, 0 -> 1, 0, 1, 1
        method = rivals.APPO(beta=(1.0, 0.25, 0.5), omega=0.25)
        advantage, _ = method.shape(two_groups(), method.begin(2, 1))
        expected = [
            0.5 + 0.25 + 0.5,
            0.0,
            0.25 + 0.25 * 2 / 3 + 0.5,
            1.0 + 0.25 + 0.5,
        ]
        np.testing.assert_allclose(advantage[:, 0], expected)

    def test_masked_places_change_no_scale(self):
        advantage = np.array([[1.0, 3.0], [2.0, NAN]])
        mask = np.array([[1.0, 1.0], [1.0, 0.0]])
        # Δ 1 then 0: over ω = 0.5 by 0.5, 0 -> 0, 1; worse by 1, 0 -> 0, 1
        shaped = formulas.a_ppo_advantage(
            advantage, mask, np.array([0.0, 1.0, 0.0]), 0.5, (1.0, 2.0, 4.0)
        )
        np.testing.assert_allclose(shaped, [[0.0, 1.0], [0.5 + 2.0 + 4.0, 0.0]])

    def test_growth_that_stays_within_omega_is_free(self):
        # Δ 0.5, 1, 0.75 with ω = 0.5: only the second is worse beyond ω -> 0, -0.5, 0 -> 1, 0, 1
        shaped = formulas.a_ppo_advantage(
            np.zeros((3, 1)),
            np.ones((3, 1)),
            np.array([0.25, 0.5, 1.0, 0.75]),
            0.5,
            (0.0, 0.0, 1.0),
        )
        np.testing.assert_allclose(shaped[:, 0], [1.0, 0.0, 1.0])

    def test_the_weights_of_the_source(self):
        assert rivals.APPO().beta == (1.0, 0.25, 0.25)

    def test_earlier_epochs_are_pooled_and_forgotten(self):
        method = rivals.APPO(beta=(0.0, 1.0, 0.0), omega=0.0, windows=2)
        even = two_groups(x=np.zeros((4, 1)))
        uneven = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.shape(uneven, method.begin(2, 1))
        # after an epoch with rates 1 and 0: a 2/3, 2/3, 2/4, 2/4 against 0, so that -Δ scales to
        # 0, 0, 1, 1
        advantage, state = method.shape(even, state)
        np.testing.assert_allclose(advantage[:, 0], [0.0, 0.0, 1.0, 1.0])
        # one epoch later the uneven one is out of the window
        advantage, _ = method.shape(even, state)
        np.testing.assert_allclose(advantage[:, 0], 0.0)


class TestRPPO:
    def test_by_hand(self):
        # Δ 0, 1, 0.5, 0: the first, third and last are below ω = 0.6
        method = rivals.RPPO(zeta=3.0, omega=0.6)
        advantage, _ = method.shape(two_groups(), method.begin(2, 1))
        np.testing.assert_allclose(advantage[:, 0], [2.0, 0.0 - 3.0, 1.0, 4.0])

    def test_a_score_at_omega_costs(self):
        penalty = formulas.r_ppo_penalty(np.array([9.0, 0.5, 0.4]), 0.5, 2.0)
        np.testing.assert_allclose(penalty, [-1.0, 0.0])

    def test_one_window_remembers_nothing(self):
        method = rivals.RPPO(windows=1)
        first, state = method.shape(two_groups(), method.begin(2, 1))
        second, _ = method.shape(two_groups(), state)
        np.testing.assert_array_equal(first, second)


class TestSoftBias:
    def test_two_groups_are_compared_by_themselves(self):
        b, gradient = formulas.soft_bias(np.array([0.2, 0.5]), 20.0)
        assert b == pytest.approx(0.3)
        np.testing.assert_array_equal(gradient, [-1.0, 1.0])

    def test_three_groups_by_hand(self):
        # with β = 1 and z = 0, 0, 1: log(2 + e) = 1.551445, -log(2 + 1/e) = -0.861995;
        # 1/(2 + e) - 1/(2 + 1/e) = 0.211942 - 0.422319, e/(2 + e) - (1/e)/(2 + 1/e) = 0.420754
        b, gradient = formulas.soft_bias(np.array([0.0, 0.0, 1.0]), 1.0)
        assert b == pytest.approx(2.413440, abs=2e-6)
        np.testing.assert_allclose(gradient, [-0.210377, -0.210377, 0.420754], atol=2e-6)

    @pytest.mark.parametrize("z", [[], [0.7]])
    def test_fewer_than_two_groups_cannot_differ(self, z):
        b, gradient = formulas.soft_bias(np.array(z), 20.0)
        assert b == 0.0
        np.testing.assert_array_equal(gradient, np.zeros(len(z)))


def soft(beta: float, z: list[float]) -> float:
    return float(np.asarray(logsumexp(beta * np.array(z))))


def h_of(weight: np.ndarray, x: np.ndarray, inside: np.ndarray, identity: np.ndarray, beta: float):
    """ELBERT's h of services that count `weight` times, written down anew."""
    total = 0.0
    for one in set(identity.tolist()):
        for k in range(x.shape[1]):
            z = []
            for g in np.flatnonzero(identity == one):
                demand = weight * (inside[:, g] == 1) * ~np.isnan(x[:, k])
                if demand.sum() > 0:
                    z.append((demand * np.nan_to_num(x[:, k])).sum() / demand.sum())
            if len(z) == 2:
                total += (z[0] - z[1]) ** 2
            elif len(z) > 2:
                total += ((soft(beta, z) + soft(-beta, z)) / beta) ** 2
    return total


class TestElbert:
    def test_by_hand(self):
        # rates a 1/2, b 0, b = 1/2, ∂h/∂z = 2 · 1/2 · ±1, demand of each is 1/2 of all services:
        # credit of a (1 - 1/2) / (1/2) and (0 - 1/2) / (1/2), of b 0
        method = rivals.Elbert(alpha=2.0)
        outcome = two_groups(x=np.array([[1.0], [0.0], [0.0], [0.0]]))
        advantage, state = method.shape(outcome, method.begin(2, 1))
        np.testing.assert_allclose(advantage[:, 0], [2.0 - 2.0, 0.0, 1.0 + 2.0, 4.0])
        np.testing.assert_array_equal(state.ratio, [[0.5], [0.0]])

    def test_a_service_without_demand_has_no_part(self):
        # the issue applies to the last two only: rates 0 and 1, demand 1/4 each; nobody who
        # demanded differs from the rate of the own group
        x = np.array([[NAN], [NAN], [0.0], [1.0]])
        method = rivals.Elbert()
        advantage, _ = method.shape(two_groups(x=x), method.begin(2, 1))
        np.testing.assert_allclose(advantage, two_groups().advantage)

    @pytest.mark.parametrize("sharpness", [3.0, 20.0])
    def test_the_derivative_of_h(self, sharpness):
        rng = np.random.default_rng(5)
        n = 40
        x = (rng.random((n, 3)) < [0.3, 0.5, 0.2]).astype(float)
        x[rng.random(n) < 0.4, 1:] = NAN
        a, b = rng.integers(0, 4, n), rng.integers(0, 2, n)
        inside = np.concatenate(
            [a[:, None] == np.arange(4), b[:, None] == np.arange(2)], axis=1
        ).astype(float)
        inside[3, :4] = NAN
        identity = np.array([0, 0, 0, 0, 1, 1])
        outcome = EpochOutcome(
            reward=np.zeros(n),
            x=x,
            inside=inside,
            identity=identity,
            advantage=np.zeros((n, 1)),
            mask=np.ones((n, 1)),
            score=0.0,
            cost=np.zeros(n),
        )
        method = rivals.Elbert(alpha=1.0, sharpness=sharpness)
        advantage, _ = method.shape(outcome, method.begin(6, 3))
        # a mean over n services has n times the derivative by the weight of one
        step = 1e-5 * np.eye(n)
        change = [
            h_of(1 + e, x, inside, identity, sharpness)
            - h_of(1 - e, x, inside, identity, sharpness)
            for e in step
        ]
        np.testing.assert_allclose(-advantage[:, 0], n * np.array(change) / 2e-5, atol=1e-6)
        assert np.abs(advantage).max() > 0.1

    def test_earlier_epochs_are_pooled(self):
        # eight services: a 4 with 3 issues, b 4 with 0. z = 3/4, ∂h/∂z = ±3/2, demand 1/2:
        # credit of a with the issue 3/2 · 1/4 · 2, without -3/2 · 3/4 · 2
        method = rivals.Elbert()
        uneven = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.shape(uneven, method.begin(2, 1))
        now = two_groups(x=np.array([[1.0], [0.0], [0.0], [0.0]]))
        advantage, _ = method.shape(now, state)
        np.testing.assert_allclose(advantage[:, 0], [2.0 - 0.75, 0.0, 1.0 + 2.25, 4.0])

    def test_an_empty_group_keeps_its_last_rate(self):
        method = rivals.Elbert(windows=1)
        outcome = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.shape(outcome, method.begin(2, 1))
        only_b = np.tile([0.0, 1.0], (4, 1))
        # b now has 1/2 against 1 of a: ∂h/∂z_b = -1, demand 1: credit -(1 - 1/2) and 1/2
        advantage, state = method.shape(two_groups(inside=only_b), state)
        np.testing.assert_array_equal(state.ratio, [[1.0], [0.5]])
        np.testing.assert_allclose(advantage[:, 0], [2.5, -0.5, 0.5, 4.5])

    def test_a_group_never_seen_is_left_out(self):
        method = rivals.Elbert()
        only_b = np.tile([0.0, 1.0], (4, 1))
        advantage, _ = method.shape(two_groups(inside=only_b), method.begin(2, 1))
        np.testing.assert_array_equal(advantage, two_groups().advantage)


class TestGroupDRO:
    def test_by_hand(self):
        # means 3/4 and 1/4; exp(η/2) = 3, so the shares are 1/4 and 3/4;
        # weights 4 · 1/4 / 2 and 4 · 3/4 / 2
        method = rivals.GroupDRO(rate=2 * np.log(3.0))
        advantage, state = method.shape(two_groups(), method.begin(2, 1))
        np.testing.assert_allclose(np.exp(state.log_q), [0.25, 0.75])
        np.testing.assert_allclose(advantage[:, 0], [0.5 * 2, 0.0, 0.5 * 1, 1.5 * 4])

    def test_the_adjustment_by_hand(self):
        # C / √n = 2/1 and 2/2 with the same loss: a ratio of exp(η) = 2
        log_q = formulas.dro_step(
            np.log([0.5, 0.5]), np.zeros(2), np.array([1.0, 4.0]), np.log(2.0), 2.0
        )
        np.testing.assert_allclose(np.exp(log_q), [2 / 3, 1 / 3])

    def test_an_empty_group_keeps_its_mean_and_counts_all_services(self):
        method = rivals.GroupDRO(rate=2 * np.log(3.0), adjustment=0.0)
        _, state = method.shape(two_groups(), method.begin(2, 1))
        only_b = np.tile([0.0, 1.0], (4, 1))
        advantage, state = method.shape(two_groups(inside=only_b), state)
        # b now earns 1/2, a still 3/4: exp(η/4) = √3 to shares of 1 : 3
        np.testing.assert_array_equal(state.mean, [0.75, 0.5])
        np.testing.assert_array_equal(state.seen, [2.0, 6.0])
        q = 3 * np.sqrt(3.0) / (1 + 3 * np.sqrt(3.0))
        np.testing.assert_allclose(np.exp(state.log_q), [1 - q, q])
        np.testing.assert_allclose(advantage[:, 0], q * two_groups().advantage[:, 0])

    def test_a_group_never_seen_keeps_its_share(self):
        # of the other two, 2/3 in all, the worse gets exp(ln 3) = 3 times as much
        log_q = formulas.dro_step(
            np.full(3, -np.log(3.0)), np.array([0.0, 1.0, 7.0]), np.array([5.0, 5.0, 0.0]),
            np.log(3.0), 0.0,
        )  # fmt: skip
        np.testing.assert_allclose(np.exp(log_q), [1 / 6, 1 / 2, 1 / 3])

    def test_nobody_known_changes_nothing(self):
        method = rivals.GroupDRO()
        nobody = two_groups(inside=np.full((4, 2), NAN))
        advantage, state = method.shape(nobody, method.begin(2, 1))
        np.testing.assert_allclose(np.exp(state.log_q), [0.5, 0.5])
        np.testing.assert_array_equal(advantage, 0.0)

    def test_equal_shares_of_equal_groups_weigh_everybody_alike(self):
        weight = formulas.service_weights(np.array([0.5, 0.5]), TWO_GROUPS)
        np.testing.assert_allclose(weight, 1.0)

    def test_weights_of_two_identities_add_up(self):
        # groups a (2 people), b (1) of one identity, c (3) of another
        inside = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
        weight = formulas.service_weights(np.array([0.2, 0.3, 0.5]), inside)
        # 3 (0.2/2 + 0.5/3), the same, 3 (0.3/1 + 0.5/3)
        np.testing.assert_allclose(weight, [0.8, 0.8, 1.4])


class TestGGF:
    def test_weights_go_by_rank(self):
        # 1 : 1/2 : 1/4 for 0.2, 0.5, 0.8; an order that is not its own inverse
        weight = formulas.gini_weights(np.array([0.5, 0.8, 0.2]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [2 / 7, 1 / 7, 4 / 7])

    def test_equals_share(self):
        weight = formulas.gini_weights(np.array([0.3, 0.9, 0.3]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [3 / 7, 1 / 7, 3 / 7])

    def test_unknown_groups_are_left_out(self):
        known = np.array([True, False, True])
        weight = formulas.gini_weights(np.array([0.9, 0.0, 0.1]), known, 0.5)
        np.testing.assert_allclose(weight, [1 / 3, 0.0, 2 / 3])
        np.testing.assert_array_equal(formulas.gini_weights(np.zeros(3), ~known & known, 0.5), 0.0)

    def test_by_hand(self):
        # means 3/4 and 1/4: weights 1/3 and 2/3; services 4 · 1/3 / 2 and 4 · 2/3 / 2
        method = rivals.GGF()
        advantage, state = method.shape(two_groups(), method.begin(2, 1))
        np.testing.assert_allclose(state.mean, [0.75, 0.25])
        np.testing.assert_allclose(
            advantage[:, 0], np.array([2 / 3, 4 / 3, 2 / 3, 4 / 3]) * [2.0, 0.0, 1.0, 4.0]
        )

    def test_the_mean_is_remembered(self):
        method = rivals.GGF(memory=0.5)
        _, state = method.shape(two_groups(), method.begin(2, 1))
        # then a earns 0 and b 1/2: (3/4 + 0)/2 and (1/4 + 1/2)/2
        later = two_groups(reward=np.array([0.0, 0.5, 0.0, 0.5]))
        _, state = method.shape(later, state)
        np.testing.assert_allclose(state.mean, [0.375, 0.375])
        # and only b is served: a keeps its mean
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.shape(two_groups(inside=only_b, reward=np.zeros(4)), state)
        np.testing.assert_allclose(state.mean, [0.375, 0.1875])

    def test_the_first_mean_counts_whole_even_later(self):
        method = rivals.GGF(memory=0.5)
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.shape(two_groups(inside=only_b), method.begin(2, 1))
        np.testing.assert_array_equal(state.seen, [0.0, 1.0])
        _, state = method.shape(two_groups(), state)
        # b: 1/2 before, 1/4 now
        np.testing.assert_allclose(state.mean, [0.75, 0.375])


class TestUnaware:
    def test_only_identities_are_hidden(self):
        seen = np.arange(1.0, 13.0, dtype=np.float32).reshape(2, 1, 6)
        blind = formulas.unaware(seen, 4)
        np.testing.assert_array_equal(blind[:, 0], [[0, 0, 0, 0, 5, 6], [0, 0, 0, 0, 11, 12]])
        assert blind.dtype == np.float32
        assert seen[0, 0, 0] == 1.0

    @pytest.mark.parametrize("groups", [-1, 26])
    def test_more_groups_than_columns(self, groups):
        with pytest.raises(InputError, match=r"25 numbers has no -?\d+ columns of identities"):
            formulas.unaware(np.zeros(25), groups)


def restaurant(rng: np.random.Generator, n: int = 12, **changes: Any) -> EpochOutcome:
    """A made-up epoch of the restaurant's size, in which some groups are empty."""
    sizes = (6, 3, 5, 2, 6)
    inside = np.concatenate([np.eye(k)[rng.integers(0, k, n)] for k in sizes], axis=1)
    x = (rng.random((n, 4)) < 0.3).astype(float)
    x[x[:, 0] == 1, 1:3] = NAN
    mask = (np.arange(7) < rng.integers(1, 8, n)[:, None]).astype(float)
    advantage = np.where(mask > 0, rng.normal(size=(n, 7)), NAN)
    outcome = EpochOutcome(
        reward=rng.uniform(-0.5, 1.0, n),
        x=x,
        inside=inside,
        identity=np.repeat(np.arange(5), sizes),
        advantage=advantage,
        mask=mask,
        score=float(rng.random()),
        cost=rng.normal(size=n),
    )
    return replace(outcome, **changes)


EDGES: dict[str, Callable[[EpochOutcome], dict[str, Any]]] = {
    "as_it_comes": lambda _: {},
    "no_responses": lambda o: {"x": np.tile([1.0, NAN, NAN, 0.0], (len(o.x), 1))},
    "all_responses": lambda o: {"x": np.nan_to_num(o.x) * [0.0, 1.0, 1.0, 1.0]},
    "one_group": lambda o: {"inside": np.tile(o.inside[:1], (len(o.x), 1))},
    "nobody_known": lambda o: {"inside": np.full(o.inside.shape, NAN)},
    "score_unknown": lambda _: {"score": NAN},
    "all_alike": lambda o: {"advantage": np.zeros(o.mask.shape), "cost": np.zeros(len(o.x))},
}


class TestEveryRival:
    @pytest.mark.parametrize("name", rivals.RIVALS)
    @pytest.mark.parametrize("edge", EDGES)
    def test_advantages_are_numbers_whatever_happens(self, name, edge):
        rng = np.random.default_rng(3)
        method = rivals.rival(name)
        state = method.begin(22, 4)
        for _ in range(3):
            outcome = restaurant(rng)
            outcome = replace(outcome, **EDGES[edge](outcome))
            advantage, state = method.shape(outcome, state)
            assert advantage.shape == outcome.mask.shape
            assert np.isfinite(advantage).all()
            assert (advantage[outcome.mask == 0] == 0).all()
            assert all(np.isfinite(a).all() for a in rival_epoch.to_arrays(state).values())

    @pytest.mark.parametrize("name", rivals.RIVALS)
    def test_what_it_remembers_survives_json(self, name):
        rng = np.random.default_rng(4)
        method = rivals.rival(name)
        first = method.begin(22, 4)
        _, state = method.shape(restaurant(rng), first)
        text = json.dumps({k: a.tolist() for k, a in rival_epoch.to_arrays(state).items()})
        back = rival_epoch.from_arrays(first, json.loads(text))
        assert type(back) is type(state)
        following = restaurant(rng)
        went_on, _ = method.shape(following, state)
        resumed, _ = method.shape(following, back)
        np.testing.assert_array_equal(went_on, resumed)

    @pytest.mark.parametrize("name", rivals.RIVALS)
    def test_what_it_remembers_has_one_shape(self, name):
        method = rivals.rival(name)
        state = method.begin(22, 4)
        before = {k: a.shape for k, a in rival_epoch.to_arrays(state).items()}
        _, state = method.shape(restaurant(np.random.default_rng(2)), state)
        assert {k: a.shape for k, a in rival_epoch.to_arrays(state).items()} == before

    def test_one_window_survives_json_too(self):
        method = rivals.Elbert(windows=1)
        first = method.begin(22, 4)
        saved = {k: a.tolist() for k, a in rival_epoch.to_arrays(first).items()}
        back = rival_epoch.from_arrays(first, saved)
        assert back.counts.shape == (0, 4, 22, 4)

    def test_no_two_have_settings_of_the_same_names(self):
        # A fingerprint of settings holds names and values, not the class.
        kinds: list[Any] = list(rivals.RIVALS.values())
        names = [frozenset(field.name for field in fields(kind)) for kind in kinds]
        assert len(set(names)) == len(names)

    @pytest.mark.parametrize("other", [rivals.Elbert(windows=3), rivals.GGF()])
    def test_what_another_remembered_is_refused(self, other):
        saved = rival_epoch.to_arrays(other.begin(22, 4))
        with pytest.raises(InputError, match="belongs to other settings: resume with the settings"):
            rival_epoch.from_arrays(rivals.Elbert(windows=4).begin(22, 4), saved)


class TestWrongInput:
    @pytest.mark.parametrize(
        ("name", "settings", "said"),
        [
            ("lagrangian", {"limit": -0.1}, "limit is -0.1: give a number from 0"),
            ("lagrangian", {"rate": NAN}, "rate is nan"),
            ("lagrangian", {"start": np.inf}, "start is inf"),
            ("a_ppo", {"beta": (1.0, 2.0)}, "beta is .*: give three numbers"),
            ("a_ppo", {"beta": (1.0, 2.0, -1.0)}, "beta is -1.0"),
            ("a_ppo", {"omega": -1.0}, "omega is -1.0"),
            ("a_ppo", {"windows": 0}, "windows is 0: give a whole number from 1"),
            ("r_ppo", {"zeta": -1.0}, "zeta is -1.0"),
            ("r_ppo", {"omega": NAN}, "omega is nan"),
            ("r_ppo", {"windows": 0}, "windows is 0"),
            ("elbert", {"alpha": -1.0}, "alpha is -1.0"),
            ("elbert", {"sharpness": 0.0}, "sharpness is 0.0: give a number from 0.001"),
            ("elbert", {"windows": 0}, "windows is 0"),
            ("group_dro", {"rate": -1.0}, "rate is -1.0"),
            ("group_dro", {"adjustment": np.inf}, "adjustment is inf"),
            ("ggf", {"decay": 0.0}, "decay is 0.0: give a number from 0.001 to 1"),
            ("ggf", {"decay": 1.1}, "decay is 1.1"),
            ("ggf", {"memory": 1.1}, "memory is 1.1"),
            ("elbret", {}, "unknown rival 'elbret': did you mean 'elbert'"),
            ("elbert", {"sharpnes": 1.0}, "unknown setting of elbert 'sharpnes': did you mean"),
        ],
    )
    def test_settings(self, name, settings, said):
        with pytest.raises(InputError, match=said):
            rivals.rival(name, **settings)

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"reward": np.zeros(3)}, "reward of the epoch has shape .3,.: give .4,."),
            ({"x": np.zeros((3, 1))}, "x of the epoch has shape"),
            ({"identity": np.zeros(3)}, "identity of the epoch has shape"),
            ({"advantage": np.zeros((4, 2))}, "advantage of the epoch has shape"),
            ({"mask": np.ones((3, 1)), "advantage": np.ones((3, 1))}, "mask of the epoch has"),
            ({"cost": np.zeros(1)}, "cost of the epoch has shape"),
            ({"reward": np.array([0.0, NAN, 0.0, 0.0])}, "reward of the epoch is not finite"),
            ({"cost": np.array([0.0, np.inf, 0.0, 0.0])}, "cost of the epoch is not finite"),
            ({"advantage": np.full((4, 1), NAN)}, "advantage of the epoch is not finite"),
        ],
    )
    def test_epochs(self, changes, said):
        with pytest.raises(InputError, match=said):
            two_groups(**changes)
