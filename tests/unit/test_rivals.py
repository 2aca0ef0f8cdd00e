"""The rivals that pay or charge a service for evenness, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from sklearn.linear_model import Ridge

from evenhand.methods.paper import losses, scores
from evenhand.methods.rivals import a_ppo, critic, elbert, fair_ppo, lagrangian, r_ppo, shared
from evenhand.methods.rivals.critic import standardised
from support.rivals import NAN, NONE_EARLIER, TWO_GROUPS, epoch_of, scheme, two_groups


class TestLagrangian:
    def test_the_multiplier_by_hand(self):
        # 0.1 + 2 (0.3 - 0.2), and 0.1 + 2 (0 - 0.2) = -0.3, which is not allowed
        assert lagrangian.multiplier(0.1, 0.3, limit=0.2, rate=2.0) == pytest.approx(0.3)
        assert lagrangian.multiplier(0.1, 0.0, limit=0.2, rate=2.0) == 0.0

    def test_an_unknown_score_leaves_the_multiplier(self):
        assert lagrangian.multiplier(0.7, NAN, limit=0.2, rate=2.0) == 0.7

    def test_the_advantage_by_hand(self):
        # A_r 2, 1, -1 has mean 2/3 and variance 14/9; of the costs 3, 1, -1 the mean is 1
        advantage = np.array([[2.0, 1.0], [-1.0, NAN]])
        mask = np.array([[1.0, 1.0], [1.0, 0.0]])
        cost = np.array([[3.0, 1.0], [-1.0, NAN]])
        mixed = lagrangian.lagrangian_advantage(advantage, mask, cost, 0.5)
        scaled = np.array([4.0, 1.0, -5.0]) / np.sqrt(14.0)
        expected = (scaled - 0.5 * np.array([2.0, 0.0, -2.0])) / 1.5
        np.testing.assert_allclose(mixed, [expected[:2], [expected[2], 0.0]], atol=1e-12)

    def test_lambda_steps_before_it_is_used(self):
        # λ = 0 + 5 (0.3 - 0.1) = 1; both rates are 1/2, so that nobody moves the gap and costs:
        # half of 2, 0, 1, 4 less their mean 7/4 over their spread √35 / 4
        method = lagrangian.Lagrangian(limit=0.1, rate=5.0)
        advantage, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        assert state.lam == pytest.approx(1.0)
        expected = np.array([1.0, -7.0, -3.0, 9.0]) / np.sqrt(35.0) / 2
        np.testing.assert_allclose(advantage[:, 0], expected, atol=1e-12)
        # and again from there: 1 + 5 (0.2 - 0.1)
        _, state = method.teach(two_groups(excess=0.2), state)
        assert state.lam == pytest.approx(1.5)

    def test_a_cost_that_the_critic_foresees_is_no_surprise(self):
        """With the same people and costs again and again, A_c fades; without a critic it stays."""
        method = lagrangian.Lagrangian(limit=0.0, rate=0.0, start=5.0)
        x = np.array([[1.0], [0.0], [0.0], [0.0]])
        seen = np.zeros((4, 1, 5))
        seen[:, 0, :2] = TWO_GROUPS
        seen[0, 0, 2:], seen[2, 0, 2:] = 1.0, -1.0  # told apart by distance, time and age
        epoch = replace(two_groups(x=x), observation=seen)
        state = method.begin(scheme(2, 1))
        first, state = method.teach(epoch, state)
        for _ in range(60):
            later, state = method.teach(epoch, state)
        alone = standardised(epoch.advantage, epoch.mask) / 6.0
        assert np.abs(later - alone).max() < 0.2 * np.abs(first - alone).max()


class TestCritic:
    def test_estimates_are_those_of_the_learner(self):
        rng = np.random.default_rng(3)
        mask = (np.arange(5) < np.array([5, 1, 3])[:, None]).astype(float)
        outcome, value = rng.normal(size=(3, 2)), rng.normal(size=(3, 5, 2))
        found = critic.estimates(outcome, value, mask, 0.9)
        for m in range(2):
            reward = np.zeros((3, 5))
            reward[np.arange(3), mask.sum(axis=1).astype(int) - 1] = outcome[:, m]
            theirs = losses.gae(reward, value[..., m], mask, 1.0, 0.9)
            np.testing.assert_allclose(found[..., m], theirs, atol=1e-5)

    def test_it_is_the_ridge_regression_of_another_library(self):
        rng = np.random.default_rng(4)
        seen, mask = rng.normal(size=(6, 3, 5)), np.ones((6, 3))
        outcome = rng.normal(size=(6, 2))
        fitted = critic.Critic.none(2, 2).after(seen, mask, outcome)
        flat = critic.features(seen).reshape(18, -1)
        theirs = Ridge(alpha=1.0, fit_intercept=False).fit(flat, np.repeat(outcome, 3, axis=0))
        np.testing.assert_allclose(
            fitted.values(seen).reshape(18, 2), theirs.predict(flat), atol=1e-8
        )

    def test_it_begins_with_nothing_and_forgets(self):
        seen, mask = np.random.default_rng(5).normal(size=(6, 3, 5)), np.ones((6, 3))
        made = critic.Critic.none(2, 1)
        np.testing.assert_array_equal(made.values(seen), 0.0)
        made = made.after(seen, mask, np.ones((6, 1)))
        for _ in range(80):
            made = made.after(seen, mask, np.zeros((6, 1)))
        assert np.abs(made.values(seen)).max() < 1e-3

    def test_standardised_by_hand(self):
        found = critic.standardised(np.array([[1.0, 3.0], [5.0, NAN]]), np.array([[1, 1], [1, 0]]))
        np.testing.assert_allclose(found, [[-(1.5**0.5), 0.0], [1.5**0.5, 0.0]])
        np.testing.assert_array_equal(critic.standardised(np.full((2, 1), 0.1), np.ones((2, 1))), 0)


class TestFairPPO:
    def test_by_hand(self):
        # a earned 1 and 1/2, b 0 and 1/2: both gaps point to a, so ± 1/2 each; a: 4 (1/2 + 1/2) / 2
        method = fair_ppo.FairPPO(strength=0.25, prospective=0.0)
        advantage, _ = method.teach(two_groups(), method.begin(scheme(2, 1)))
        np.testing.assert_allclose(advantage[:, 0], [2.0 * 0.5, 0.0, 1.0 * 0.5, 4.0 * 1.5])

    def test_the_derivative_of_the_gaps(self):
        rng = np.random.default_rng(6)
        reward, inside = rng.normal(size=12), np.eye(3)[rng.integers(0, 3, 12)]
        method = fair_ppo.FairPPO(prospective=0.0)

        def gaps(weight):
            earned = [
                abs(reward[s] @ weight[s] / s.sum() - reward[~s] @ weight[~s] / (~s).sum())
                for s in (inside.T == 1)
            ]
            return np.mean(earned)

        step = 1e-6 * np.eye(12)
        slope = [(gaps(1 + e) - gaps(1 - e)) / 2e-6 for e in step]
        weights = fair_ppo.parity_weights(method._slope(reward, inside), inside)
        np.testing.assert_allclose(weights * reward / 12, slope, atol=1e-8)

    def test_it_looks_at_what_the_critic_expects(self):
        # the critic expects more for b: the penalty turns round
        value = np.array([[0.0], [1.0], [0.0], [1.0]])
        method = fair_ppo.FairPPO(strength=0.25, prospective=1.0)
        epoch = replace(two_groups(), value=value)
        advantage, _ = method.teach(epoch, method.begin(scheme(2, 1)))
        np.testing.assert_allclose(advantage[:, 0], [2.0 * 1.5, 0.0, 1.0 * 1.5, 4.0 * 0.5])


class TestGuarded:
    @pytest.mark.parametrize(
        "kind",
        [a_ppo.APPO, r_ppo.RPPO, elbert.Elbert, lagrangian.Lagrangian, fair_ppo.FairPPO],
    )
    def test_the_guard_leaves_so_much_of_the_method(self, kind):
        class Half:
            weight = 0.25

        epoch = replace(two_groups(), guard=Half())
        free, guarded = kind(), kind(guarded=True)
        whole, _ = free.teach(epoch, free.begin(scheme(2, 1)))
        part, _ = guarded.teach(epoch, guarded.begin(scheme(2, 1)))
        np.testing.assert_allclose(part, 0.75 * epoch.advantage + 0.25 * whole)


class TestRunningScore:
    # a has the issue, b not, a not, b: rates a 1, b -; a 1, b 0; a 1/2, b 0; a 1/2, b 1/2
    X = np.array([[1.0], [0.0], [0.0], [1.0]])

    def test_by_hand(self):
        score = shared.running_scores(self.X, TWO_GROUPS, NONE_EARLIER)
        np.testing.assert_allclose(score, [0.0, 0.0, 1.0, 0.5, 0.0])

    def test_earlier_services_are_pooled(self):
        # before: one of a without the issue, one of b with it. a 0, b 1; a 1/2, b 1; a 1/2, b 1/2;
        # a 1/3, b 1/2; a 1/3, b 2/3
        earlier = scores.count(np.array([[0.0], [1.0]]), TWO_GROUPS[:2])
        score = shared.running_scores(self.X, TWO_GROUPS, earlier)
        np.testing.assert_allclose(score, [1.0, 1 / 2, 0.0, 1 / 6, 1 / 3])

    def test_issues_add_up_and_some_do_not_apply(self):
        x = np.array([[1.0, NAN], [0.0, 0.0], [NAN, 1.0]])
        score = shared.running_scores(x, TWO_GROUPS[:3], scores.Counts(*np.zeros((4, 2, 2))))
        # the second issue can be compared from the third service on: 1 + 1
        np.testing.assert_allclose(score, [0.0, 0.0, 1.0, 2.0])

    def test_unknown_people_count_nowhere(self):
        inside = TWO_GROUPS.copy()
        inside[1] = NAN
        score = shared.running_scores(self.X, inside, NONE_EARLIER)
        # only the last is of b: a 1/2, b 1
        np.testing.assert_allclose(score, [0.0, 0.0, 0.0, 0.0, 0.5])


class TestAPPO:
    def test_by_hand(self):
        # Δ 0, 1, 0.5, 0 after the people, δΔ 0, 1, -0.5, -0.5, ω = 0.25
        # A 2, 0, 1, 4 -> 0.5, 0, 0.25, 1
        # min(0, ω - Δ) = 0, -0.75, -0.25, 0 -> 1, 0, 2/3, 1
        # min(0, -1[Δ > ω] δΔ) = 0, -1, 0, 0 -> 1, 0, 1, 1
        method = a_ppo.APPO(strength=0.25, omega=0.25)
        advantage, _ = method.teach(two_groups(), method.begin(scheme(2, 1)))
        expected = [
            0.5 + 0.25 + 0.25,
            0.0,
            0.25 + 0.25 * 2 / 3 + 0.25,
            1.0 + 0.25 + 0.25,
        ]
        np.testing.assert_allclose(advantage[:, 0], expected)

    def test_masked_places_change_no_scale(self):
        advantage = np.array([[1.0, 3.0], [2.0, NAN]])
        mask = np.array([[1.0, 1.0], [1.0, 0.0]])
        # Δ 1 then 0: over ω = 0.5 by 0.5, 0 -> 0, 1; worse by 1, 0 -> 0, 1
        shaped = a_ppo.a_ppo_advantage(
            advantage, mask, np.array([0.0, 1.0, 0.0]), 0.5, (1.0, 2.0, 4.0)
        )
        np.testing.assert_allclose(shaped, [[0.0, 1.0], [0.5 + 2.0 + 4.0, 0.0]])

    def test_growth_that_stays_within_omega_is_free(self):
        # Δ 0.5, 1, 0.75 with ω = 0.5: only the second is worse beyond ω -> 0, -0.5, 0 -> 1, 0, 1
        shaped = a_ppo.a_ppo_advantage(
            np.zeros((3, 1)),
            np.ones((3, 1)),
            np.array([0.25, 0.5, 1.0, 0.75]),
            0.5,
            (0.0, 0.0, 1.0),
        )
        np.testing.assert_allclose(shaped[:, 0], [1.0, 0.0, 1.0])

    def test_earlier_epochs_are_pooled_and_forgotten(self):
        method = a_ppo.APPO(strength=1.0, omega=0.0, windows=2)
        # neither advantage nor growth differ, so that only Δ itself counts
        none = np.zeros((4, 1))
        even = two_groups(x=none, advantage=none)
        uneven = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.teach(uneven, method.begin(scheme(2, 1)))
        # after an epoch with rates 1 and 0: a 2/3, 2/3, 2/4, 2/4 against 0, so that -Δ scales to
        # 0, 0, 1, 1
        advantage, state = method.teach(even, state)
        np.testing.assert_allclose(advantage[:, 0], [0.0, 0.0, 1.0, 1.0])
        # one epoch later the uneven one is out of the window
        advantage, _ = method.teach(even, state)
        np.testing.assert_allclose(advantage[:, 0], 0.0)


class TestRPPO:
    def test_by_hand(self):
        # Δ 0, 1, 0.5, 0: the first, third and last are below ω = 0.6
        method = r_ppo.RPPO(zeta=3.0, omega=0.6)
        advantage, _ = method.teach(two_groups(), method.begin(scheme(2, 1)))
        np.testing.assert_allclose(advantage[:, 0], [2.0, 0.0 - 3.0, 1.0, 4.0])

    def test_a_score_at_omega_costs(self):
        penalty = r_ppo.r_ppo_penalty(np.array([0.5, 0.4]), 0.5, 2.0)
        np.testing.assert_allclose(penalty, [-1.0, 0.0])

    def test_one_window_remembers_nothing(self):
        method = r_ppo.RPPO(windows=1)
        first, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        second, _ = method.teach(two_groups(), state)
        np.testing.assert_array_equal(first, second)


class TestSoftBias:
    def test_two_groups_are_compared_by_themselves(self):
        b, gradient = elbert.soft_bias(np.array([0.2, 0.5]), 20.0)
        assert b == pytest.approx(0.3)
        np.testing.assert_array_equal(gradient, [-1.0, 1.0])

    def test_three_groups_by_hand(self):
        # with β = 1 and z = 0, 0, 1: log(2 + e) = 1.551445, -log(2 + 1/e) = -0.861995;
        # 1/(2 + e) - 1/(2 + 1/e) = 0.211942 - 0.422319, e/(2 + e) - (1/e)/(2 + 1/e) = 0.420754
        b, gradient = elbert.soft_bias(np.array([0.0, 0.0, 1.0]), 1.0)
        assert b == pytest.approx(2.413440, abs=2e-6)
        np.testing.assert_allclose(gradient, [-0.210377, -0.210377, 0.420754], atol=2e-6)

    @pytest.mark.parametrize("z", [[], [0.7]])
    def test_fewer_than_two_groups_cannot_differ(self, z):
        b, gradient = elbert.soft_bias(np.array(z), 20.0)
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
        method = elbert.Elbert(alpha=2.0, standardise=False)
        outcome = two_groups(x=np.array([[1.0], [0.0], [0.0], [0.0]]))
        advantage, state = method.teach(outcome, method.begin(scheme(2, 1)))
        np.testing.assert_allclose(advantage[:, 0], [2.0 - 2.0, 0.0, 1.0 + 2.0, 4.0])
        np.testing.assert_array_equal(state.ratio, [[0.5], [0.0]])

    def test_advantages_are_standardised_before_they_are_combined(self):
        """As in the source, of one decision each: rates 1/2 and 0, ∂h/∂z = ±1, demand 1/2."""
        x = np.array([[1.0], [0.0], [0.0], [0.0]])
        method = elbert.Elbert(alpha=2.0)
        advantage, _ = method.teach(two_groups(x=x), method.begin(scheme(2, 1)))
        main = np.array([1.0, -7.0, -3.0, 9.0]) / np.sqrt(35.0)
        # supply of a 1, 0, 0, 0: mean 1/4, spread √3 / 4; of b never; demand ± 1
        supply_a = np.array([3.0, -1.0, -1.0, -1.0]) / np.sqrt(3.0)
        demand_a, demand_b = np.array([1.0, -1.0, 1.0, -1.0]), np.array([-1.0, 1.0, -1.0, 1.0])
        # S / D² = 1 of a and 0 of b
        bias = 1.0 * (supply_a / 0.5 - demand_a * (0.25 / 0.25)) - 1.0 * (0.0 - 0.0 * demand_b)
        np.testing.assert_allclose(advantage[:, 0], main - 2.0 * bias, atol=1e-12)

    def test_a_service_without_demand_has_no_part(self):
        # the issue applies to the last two only: rates 0 and 1, demand 1/4 each; nobody who
        # demanded differs from the rate of the own group
        x = np.array([[NAN], [NAN], [0.0], [1.0]])
        method = elbert.Elbert(alpha=1.0, standardise=False)
        advantage, _ = method.teach(two_groups(x=x), method.begin(scheme(2, 1)))
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
        outcome = epoch_of(
            reward=np.zeros(n),
            x=x,
            inside=inside,
            identity=identity,
            advantage=np.zeros((n, 1)),
            mask=np.ones((n, 1)),
        )
        method = elbert.Elbert(alpha=1.0, sharpness=sharpness, standardise=False)
        advantage, _ = method.teach(outcome, method.begin(scheme(6, 3)))
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
        method = elbert.Elbert(alpha=1.0, standardise=False)
        uneven = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.teach(uneven, method.begin(scheme(2, 1)))
        now = two_groups(x=np.array([[1.0], [0.0], [0.0], [0.0]]))
        advantage, _ = method.teach(now, state)
        np.testing.assert_allclose(advantage[:, 0], [2.0 - 0.75, 0.0, 1.0 + 2.25, 4.0])

    def test_an_empty_group_keeps_its_last_rate(self):
        method = elbert.Elbert(alpha=1.0, windows=1, standardise=False)
        outcome = two_groups(x=np.array([[1.0], [0.0], [1.0], [0.0]]))
        _, state = method.teach(outcome, method.begin(scheme(2, 1)))
        only_b = np.tile([0.0, 1.0], (4, 1))
        # b now has 1/2 against 1 of a: ∂h/∂z_b = -1, demand 1: credit -(1 - 1/2) and 1/2
        advantage, state = method.teach(two_groups(inside=only_b), state)
        np.testing.assert_array_equal(state.ratio, [[1.0], [0.5]])
        np.testing.assert_allclose(advantage[:, 0], [2.5, -0.5, 0.5, 4.5])

    def test_a_group_never_seen_is_left_out(self):
        method = elbert.Elbert(alpha=1.0, standardise=False)
        only_b = np.tile([0.0, 1.0], (4, 1))
        advantage, _ = method.teach(two_groups(inside=only_b), method.begin(scheme(2, 1)))
        np.testing.assert_array_equal(advantage, two_groups().advantage)
