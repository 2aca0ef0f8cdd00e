"""Credit by hand, by numerical differentiation and by enumerating a whole policy."""

import itertools

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods import pooling
from evenhand.methods.beyond import gaps, levelup
from evenhand.methods.beyond import influence as credit
from evenhand.methods.beyond.influence import CreditSettings
from evenhand.methods.paper import scores as paper_scores
from evenhand.methods.paper.scores import Counts, count
from evenhand.methods.pooling import Pool
from support.refusals import refused

NAN = np.nan
RAW = CreditSettings(shrink=0.0)
TAU = (1.0, 2.0)

# Three services of A, two of B; the second issue does not apply to the third service of A.
X = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, NAN], [0.0, 0.0], [0.0, 0.0]])
A_OR_B = np.array([[1.0, 0.0]] * 3 + [[0.0, 1.0]] * 2)


def counts(n, x, m, y) -> Counts:
    """Of one group and one issue: x of n inside, y of m outside."""
    return Counts(*(np.array([[float(number)]]) for number in (n, x, m, y)))


def window(seed: int, n: int = 40, issue_count: int = 4):
    """A window with two identities, unknown sides and issues that do not apply."""
    rng = np.random.default_rng(seed)
    one, two = rng.integers(-1, 3, n), rng.integers(0, 4, n)
    inside = np.concatenate(
        [(one[:, None] == np.arange(3)).astype(float), (two[:, None] == np.arange(4)) * 1.0], axis=1
    )
    inside[one < 0, :3] = NAN
    x = (rng.random((n, issue_count)) < 0.4).astype(float)
    x[x[:, 0] == 1, 1:3] = NAN
    return x, inside


class TestInfluenceByHand:
    # Issue 1: p(A) = 2/3, p(B) = 0, s = 1 for A and -1 for B; both groups say the same.
    # Issue 2: p(A) = 1/2 of two services, p(B) = 0.
    def test_each_issue(self):
        found = credit.influence(X, A_OR_B, TAU, settings=RAW)
        first = [1 / 9, -2 / 9, 1 / 9, 0.0, 0.0]
        second = [-1 / 4, 1 / 4, 0.0, 0.0, 0.0]
        np.testing.assert_allclose(found.issue.T, [first, second], atol=1e-15)
        np.testing.assert_allclose(found.total, np.add(first, np.multiply(2, second)), atol=1e-15)
        np.testing.assert_array_equal(found.push, [[1.0, 1.0], [-1.0, -1.0]])

    def test_a_missing_gap_leaves_the_mean(self):
        with_empty = np.concatenate([A_OR_B, np.zeros((5, 1))], axis=1)
        found = credit.influence(X, with_empty, TAU, settings=RAW)
        np.testing.assert_allclose(found.issue[0], [1 / 9, -1 / 4], atol=1e-15)
        assert np.isnan(found.push[2]).all()
        assert (found.gap[:, 2] == 0).all()

    def test_without_any_gap_nobody_gets_weight(self):
        found = credit.influence(X, np.ones((5, 1)), TAU, settings=RAW)
        assert (found.total == 0).all()
        assert np.isnan(found.push).all()

    def test_no_response_at_all_leaves_the_other_issue(self):
        silent = np.array([[1.0, NAN], [1.0, NAN], [0.0, NAN]])
        inside = np.array([[1.0], [0.0], [0.0]])
        found = credit.influence(silent, inside, TAU, settings=RAW)
        np.testing.assert_allclose(found.issue, [[0, 0], [-1 / 4, 0], [1 / 4, 0]])

    def test_pooled_rates_current_numbers(self):
        # pooled: p(A) = 3/4, p(B) = 1/4; now two of A and one of B
        pool = counts(8, 6, 4, 1)
        x, inside = np.array([[1.0], [0.0], [1.0]]), np.array([[1.0], [1.0], [0.0]])
        found = credit.influence(x, inside, (1.0,), pool, RAW)
        np.testing.assert_allclose(found.issue[:, 0], [1 / 8, -3 / 8, -3 / 4])

    def test_a_gap_that_pooling_brings_weighs_the_side_that_is_there(self):
        pool = counts(4, 4, 4, 0)
        found = credit.influence(np.array([[0.0]]), np.array([[1.0]]), (1.0,), pool, RAW)
        assert found.total == pytest.approx([-1.0])

    def test_shrinking(self):
        # d = 1/2, p = 1/2, se² = 1/4 (1/8 + 1/8) = 1/16, so half of it: 1 - (c/2)²
        pool = counts(8, 6, 8, 2)
        x, inside = np.array([[1.0]]), np.array([[1.0]])
        for c, share in ((0.0, 1.0), (1.0, 3 / 4), (1.5, 7 / 16), (2.0, 0.0), (9.0, 0.0)):
            found = credit.influence(x, inside, (1.0,), pool, CreditSettings(shrink=c))
            assert found.push[0, 0] == pytest.approx(share)
            assert found.total == pytest.approx([share / 4])


@pytest.mark.parametrize("seed", range(5))
class TestInfluenceIsTheDerivative:
    """d/dθ of scores whose rates are means with weights exp(θ · score) of the services."""

    TAU = np.array([1.0, 0.5, 2.0, 1.5])

    @staticmethod
    def gaps(x, inside, weight):
        """Signed gaps of Eq. 1 by plain loops over weighted means."""
        out = np.full((inside.shape[1], x.shape[1]), NAN)
        for g, k in itertools.product(*map(range, out.shape)):
            sides = [(inside[:, g] == side) & ~np.isnan(x[:, k]) for side in (1.0, 0.0)]
            if all(side.any() for side in sides):
                a, b = (np.average(x[side, k], weights=weight[side]) for side in sides)
                out[g, k] = a - b
        return out

    def slope(self, seed, of):
        x, inside = window(seed)
        direction = np.random.default_rng([seed, 1]).normal(size=len(x))
        h = 1e-5
        up, down = (of(self.gaps(x, inside, np.exp(t * direction))) for t in (h, -h))
        return x, inside, direction, (up - down) / (2 * h)

    def test_of_the_total_score(self, seed):
        def total(d):
            return self.TAU @ np.nanmean(np.abs(d), axis=0)

        x, inside, direction, expected = self.slope(seed, total)
        found = credit.influence(x, inside, self.TAU, settings=RAW)
        assert found.total @ direction == pytest.approx(expected, abs=1e-6)
        assert abs(expected) > 1e-3

    def test_of_one_identity(self, seed):
        def score(d):
            return np.nanmean(np.abs(d[3:]), axis=0)

        x, inside, direction, expected = self.slope(seed, score)
        found = credit.influence(x, inside, self.TAU, settings=RAW).over([3, 4, 5, 6])
        np.testing.assert_allclose(direction @ found, expected, atol=1e-6)

    def test_of_each_signed_gap(self, seed):
        x, inside, direction, expected = self.slope(seed, lambda d: d)
        found = credit.influence(x, inside, self.TAU, settings=RAW)
        np.testing.assert_allclose(np.tensordot(direction, found.gap, (0, 0)), expected, atol=1e-6)

    def test_of_squared_gaps(self, seed):
        def squares(d):
            return self.TAU @ np.nanmean(d**2, axis=0)

        x, inside, direction, expected = self.slope(seed, squares)
        settings = CreditSettings(shrink=0.0, objective="squared")
        found = credit.influence(x, inside, self.TAU, settings=settings)
        assert found.total @ direction == pytest.approx(expected, abs=1e-6)

    def test_identities_together_give_all_groups(self, seed):
        # by the numbers of their groups: 3 and 4 of 7
        found = credit.influence(*window(seed), self.TAU, settings=RAW)
        both = (3 * found.over([0, 1, 2]) + 4 * found.over([3, 4, 5, 6])) / 7
        np.testing.assert_allclose(both, found.issue, atol=1e-15)


class TestPolicyGradient:
    """Two groups, a response with chance r_g and then, if there is one, a bad one with chance q_g.

    Every outcome of m services a group is enumerated with its probability, so that expectations
    are exact. Logits: θ = (logit r_A, logit r_B, logit q_A, logit q_B).
    """

    M = 3
    THETA = np.array([0.8, 2.0, 0.4, -0.7])

    @classmethod
    def expected_gradient(cls, pool: Counts) -> np.ndarray:
        """E[Σ_i w_i ∇log π_i] over all epochs, [4, K], with w of each issue."""
        r, q = (1 / (1 + np.exp(-cls.THETA))).reshape(2, 2)
        inside = np.repeat([[1.0], [0.0]], cls.M, axis=0)
        total = np.zeros((4, 2))
        # a service: 0 no response, 1 good response, 2 bad response
        for outcome in itertools.product(range(3), repeat=2 * cls.M):
            x = np.array([[[1.0, NAN], [0.0, 0.0], [0.0, 1.0]][o] for o in outcome])
            chance, score = 1.0, np.zeros((len(x), 4))
            for i, o in enumerate(outcome):
                g = i // cls.M
                chance *= [1 - r[g], r[g] * (1 - q[g]), r[g] * q[g]][o]
                score[i, g] = (o > 0) - r[g]
                score[i, 2 + g] = 0.0 if o == 0 else (o == 2) - q[g]
            found = credit.influence(x, inside, (1.0, 1.0), pool, RAW)
            total += chance * score.T @ found.issue
        return total

    def test_in_expectation_it_is_the_gradient_of_the_score(self):
        # True I of the two issues is |r_A - r_B| and |q_A - q_B|. Pooled counts so large that
        # they hold the true rates.
        r, q = (1 / (1 + np.exp(-self.THETA))).reshape(2, 2)
        big = 1e9
        pool = Counts(
            big * np.array([[1.0, r[0]]]),
            big * np.array([[1 - r[0], r[0] * q[0]]]),
            big * np.array([[1.0, r[1]]]),
            big * np.array([[1 - r[1], r[1] * q[1]]]),
        )
        found = self.expected_gradient(pool)
        # A ignores more (r_A < r_B) and serves worse (q_A > q_B)
        slope_r, slope_q = r * (1 - r), q * (1 - q)
        willingness = [-slope_r[0], slope_r[1], 0.0, 0.0]
        # n_g is the number of responses, which may be 0: then this epoch has nothing to say
        seen = 1 - (1 - r) ** self.M
        quality = [0.0, 0.0, slope_q[0] * seen[0], -slope_q[1] * seen[1]]
        np.testing.assert_allclose(found, np.transpose([willingness, quality]), atol=1e-7)


class TestNoise:
    def test_standard_error_by_hand(self):
        # p = 6/16, 15/64 · (1/4 + 1/12) = 5/64
        assert gaps.standard_error(counts(4, 3, 12, 3))[0, 0] == pytest.approx((5 / 64) ** 0.5)

    def test_rates_of_0_and_1_are_not_certain(self):
        # 1 of 1 against 0 of 4: p = 1/5, se² = 4/25 · 5/4 = 1/5, so 1 - 1/5 of the gap counts
        assert gaps.beyond_noise(counts(1, 1, 4, 0), 1.0)[0, 0] == pytest.approx(4 / 5)
        assert gaps.beyond_noise(counts(3, 3, 4, 4), 1.0)[0, 0] == 0.0

    @pytest.mark.parametrize("sides", [(0, 0, 5, 2), (5, 2, 0, 0), (0, 0, 0, 0)])
    def test_an_empty_side_is_missing(self, sides):
        assert np.isnan(gaps.standard_error(counts(*sides))).all()
        assert np.isnan(gaps.beyond_noise(counts(*sides), 1.0)).all()
        assert np.isnan(credit.push(counts(*sides), CreditSettings())).all()

    def test_chance_gaps_of_an_even_robot_hardly_steer(self):
        # 4 windows of 30 services, 5 groups: what is left of |d| is a third or less
        rng = np.random.default_rng(1)
        n, m = 24.0, 96.0
        sides = rng.binomial(24, 0.3, (2000, 1)), rng.binomial(96, 0.3, (2000, 1))
        full = np.full((2000, 1), n)
        c = Counts(full, sides[0] * 1.0, np.full((2000, 1), m), sides[1] * 1.0)
        gap = paper_scores.gaps(c)
        assert (gap * gaps.beyond_noise(c, 1.0)).mean() < gap.mean() / 3
        assert (gaps.beyond_noise(c, 2.0) > 0).mean() < 0.06


class TestMemory:
    @staticmethod
    def epoch(number: int) -> Counts:
        return Counts(*(np.full((2, 3), float(number * side)) for side in (1, 10, 100, 1000)))

    def test_it_holds_the_last_windows(self):
        memory = Pool.empty(3, 2, 3)
        sums = []
        for number in range(1, 6):
            memory = pooling.remember(memory, self.epoch(number))
            sums.append((memory.filled, pooling.pooled(memory).inside_n[0, 0]))
        assert sums == [(1, 1), (2, 3), (3, 6), (3, 9), (3, 12)]
        pool = pooling.pooled(memory)
        for name, factor in (("inside_x", 10), ("outside_n", 100), ("outside_x", 1000)):
            np.testing.assert_array_equal(getattr(pool, name), np.full((2, 3), 12.0 * factor))

    def test_it_stays_as_it_was(self):
        empty = Pool.empty(2, 2, 3)
        pooling.remember(empty, self.epoch(1))
        assert empty.filled == 0
        assert (empty.windows == 0).all()

    def test_one_window_is_the_current_one(self):
        memory = Pool.empty(1, 2, 3)
        for number in (5, 7):
            memory = pooling.remember(memory, self.epoch(number))
        assert (pooling.pooled(memory).inside_n == 7).all()

    def test_other_groups_do_not_fit(self):
        with refused("shape counts"):
            pooling.remember(Pool.empty(2, 5, 3), self.epoch(1))


class TestRewards:
    # Pooled: A has the first issue in 3 of 4, B in 1 of 4; the second the other way round.
    POOL = Counts(
        np.full((2, 2), 8.0),
        np.array([[6.0, 2.0], [2.0, 6.0]]),
        np.full((2, 2), 8.0),
        np.array([[2.0, 6.0], [6.0, 2.0]]),
    )
    INSIDE = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])

    def reward(self, x, tau, **settings):
        chosen = CreditSettings(shrink=0.0, **settings)
        return credit.influence_reward(np.array(x), self.INSIDE, tau, self.POOL, chosen)

    def test_influence_reward_by_hand(self):
        # -2 · 4 services · (x - 3/4) / 2 for the worse-off, nothing for the others
        x = [[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]
        np.testing.assert_allclose(self.reward(x, (1.0, 0.0), strength=2.0), [-1.0, 3.0, 0.0, 0.0])
        # the second issue is B's: 2 · 4 · 3/4 / 2 for both of B, who had none
        np.testing.assert_allclose(self.reward(x, (0.0, 1.0), strength=2.0), [0.0, 0.0, 3.0, 3.0])

    def test_without_the_guard_the_better_off_would_be_paid(self):
        x = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
        raw = -credit.influence(x, self.INSIDE, (1.0, 0.0), self.POOL, RAW).total
        assert raw[2] > 0 > raw[3]

    def test_ignoring_somebody_does_not_spare_the_cost_of_a_bad_response(self):
        bad = [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
        none = [[0.0, 0.0], [0.0, 0.0], [0.0, NAN], [0.0, 0.0]]
        assert self.reward(bad, (0.0, 1.0))[2] == pytest.approx(-4 * (1 - 3 / 4) / 2)
        assert self.reward(none, (0.0, 1.0))[2] == self.reward(bad, (0.0, 1.0))[2]

    def test_levelup_by_hand(self):
        # gaps of 1/2 weigh the issues of those who are worse off; no response counts as bad
        x = np.array([[1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [1.0, NAN]])
        settings = CreditSettings(strength=3.0, shrink=0.0)
        reward = levelup.levelup_reward(x, self.INSIDE, (1.0, 2.0), self.POOL, settings)
        np.testing.assert_allclose(reward, [-1.5, 0.0, -3.0, -3.0])

    def test_levelup_shrinks(self):
        x = np.ones((4, 2))
        settings = CreditSettings(shrink=1.0)
        reward = levelup.levelup_reward(x, self.INSIDE, (1.0, 0.0), self.POOL, settings)
        np.testing.assert_allclose(reward, [-3 / 8, -3 / 8, 0.0, 0.0])

    def test_no_strength_no_reward(self):
        x = np.ones((4, 2))
        none = CreditSettings(strength=0.0)
        for function in (credit.influence_reward, levelup.levelup_reward):
            assert (function(x, self.INSIDE, TAU, self.POOL, none) == 0).all()

    def test_it_lowers_the_score_of_a_softmax_of_services(self):
        # weights exp(θ · reward): a first step towards better paid services evens the rates
        x = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 1.0]])
        inside = np.repeat([[1.0, 0.0], [0.0, 1.0]], 3, axis=0)
        reward = credit.influence_reward(x, inside, (1.0, 1.0), settings=RAW)
        slope = credit.influence(x, inside, (1.0, 1.0), settings=RAW).total @ reward
        assert slope < 0


class TestWrongInput:
    @pytest.mark.parametrize(
        "wrong",
        [
            {"strength": -1.0},
            {"strength": NAN},
            {"strength": np.inf},
            {"shrink": -0.1},
            {"windows": 0},
            {"objective": "square"},
        ],
    )
    def test_settings(self, wrong):
        with pytest.raises(InputError, match=next(iter(wrong))):
            CreditSettings(**wrong)

    @pytest.mark.parametrize("tau", [(1.0,), (1.0, -1.0), (1.0, NAN), (1.0, np.inf), 1.0])
    @pytest.mark.parametrize(
        "function", [credit.influence, credit.influence_reward, levelup.levelup_reward]
    )
    def test_tau(self, function, tau):
        with refused("range tau", "2"):
            function(X, A_OR_B, tau)

    def test_rows_that_do_not_fit(self):
        with refused("shape issues"):
            credit.influence(X, A_OR_B[:4], TAU)

    def test_counts_of_other_groups(self):
        with refused("shape pooled"):
            credit.influence(X, A_OR_B, TAU, counts(9, 1, 9, 1))

    def test_counts_without_the_epoch(self):
        with refused("range pooled"):
            credit.influence(X, A_OR_B, TAU, count(X[:3], A_OR_B[:3]))
