"""The anytime alarm: three bets by hand, Ville's inequality by simulation."""

import numpy as np
import pytest
from scipy.stats import binom

from evenhand.methods.paper.scores import count, signed_gaps
from evenhand.statistics import sequential
from support.refusals import refused

NAN = np.nan


def pairs(p, q, rng, streams, steps):
    """One person in the group less one outside it, [steps, streams]."""
    return (rng.random((steps, streams)) < p) * 1.0 - (rng.random((steps, streams)) < q)


def first_alarm(log_wealth, alpha=0.05, streams=1):
    """Index of the first step at which wealth reached streams/alpha, NaN if it never did."""
    reached = log_wealth >= np.log(streams / alpha)
    return np.where(reached.any(axis=0), reached.argmax(axis=0), NAN)


def batches(x, inside, size):
    """Signed gaps of batches of services in order of time, [n // size, G, K]."""
    parts = (a.reshape(-1, size, a.shape[1]) for a in (x, inside))
    return signed_gaps(count(*parts))


class TestBets:
    def test_by_hand(self):
        # c = 2/(2 − ln 3) = 2.2188. Bets: 0; clip(0 − 2.2188/2) = −.5; then with g = 1:
        # K = 1.5, z = 1/1.5, Σz² = 1.4444, λ = clip(−.5 − 2.2188 · .66667/2.4444) = −.5; with
        # g = −1: K = 1.5 · .5, z = −1/.5 = −2, Σz² = 5.4444,
        # λ = −.5 + 2.2188 · 2/6.4444 = .18860.
        path, now = sequential.watch(np.array([1.0, 1.0, -1.0]))
        np.testing.assert_allclose(np.exp(path), [1, 1.5, 0.75])
        assert now.squares == pytest.approx(1 + 4 / 9 + 4)
        assert now.bet == pytest.approx(-0.5 + 2.21878 * 2 / 6.44444, abs=1e-4)
        assert now.steps == 3

    def test_a_missing_gap_changes_nothing(self):
        path, now = sequential.watch(np.array([0.5, NAN, 0.5]))
        straight, then = sequential.watch(np.array([0.5, 0.5]))
        np.testing.assert_array_equal(path[[0, 2]], straight)
        assert path[1] == path[0]
        assert (now.bet, now.squares, now.steps) == (then.bet, then.squares, then.steps)

    def test_watching_can_go_on_later(self):
        gaps = pairs(0.4, 0.2, np.random.default_rng(0), 3, 40)
        whole, end = sequential.watch(gaps)
        _, half = sequential.watch(gaps[:25])
        rest, later = sequential.watch(gaps[25:], half)
        np.testing.assert_array_equal(whole[25:], rest)
        np.testing.assert_array_equal(end.bet, later.bet)

    def test_either_sign_gains_alike(self):
        gaps = pairs(0.4, 0.2, np.random.default_rng(0), 3, 40)
        np.testing.assert_allclose(sequential.watch(gaps)[0], sequential.watch(-gaps)[0])

    def test_wrong_gaps(self):
        with refused("range gaps", "-1", "1"):
            sequential.watch(np.array([0.0, 1.1]))
        with refused("shape gaps"):
            sequential.bet(sequential.start(2), np.zeros(3))
        with refused("shape gaps"):
            sequential.watch(np.array(0.3))


class TestAlarms:
    @pytest.mark.parametrize("alpha", [0.05, 0.2])
    def test_looking_all_the_time_at_even_streams_seldom_alarms(self, alpha):
        path, _ = sequential.watch(pairs(0.3, 0.3, np.random.default_rng(1), 2000, 1000))
        alarms = int((~np.isnan(first_alarm(path, alpha))).sum())
        assert 0 < alarms <= binom.ppf(0.999, 2000, alpha)

    def test_drift_that_everybody_shares_raises_no_more(self):
        rate = (0.5 + 0.4 * np.sin(np.arange(1000) / 60))[:, None]
        path, _ = sequential.watch(pairs(rate, rate, np.random.default_rng(2), 2000, 1000))
        alarms = int((~np.isnan(first_alarm(path))).sum())
        assert 0 < alarms <= binom.ppf(0.999, 2000, 0.05)

    def test_known_disparities_are_found(self):
        rng = np.random.default_rng(3)
        times = []
        for p in (0.4, 0.5, 0.7):
            path, _ = sequential.watch(pairs(p, 0.3, rng, 300, 1000))
            first = first_alarm(path)
            times.append(np.where(np.isnan(first), 1000, first))
        shares = [(t < 1000).mean() for t in times]
        assert shares[0] > 0.6
        assert shares[1:] == [1, 1]
        assert np.median(times[2]) < np.median(times[1]) < np.median(times[0])


class TestCombined:
    def test_it_is_the_log_of_the_average(self):
        wealth = np.log(np.array([[[1.0, 3.0], [4.0, 8.0]]]))
        np.testing.assert_allclose(sequential.combined(wealth), np.log([4.0]))
        np.testing.assert_allclose(sequential.combined(wealth, axis=-1), np.log([[2.0, 6.0]]))

    def test_nothing_to_combine(self):
        with refused("empty streams"):
            sequential.combined(np.zeros((5, 0, 4)))

    def test_over_groups_that_overlap_it_keeps_its_level(self):
        # Batches of 30 even services, two identities of 3 and 2 categories, two issues.
        rng = np.random.default_rng(4)
        runs, batches = 400, 150
        inside = np.concatenate(
            [np.eye(k)[rng.integers(0, k, (batches, runs, 30))] for k in (3, 2)], axis=-1
        )
        x = (rng.random((batches, runs, 30, 2)) < 0.3) * 1.0
        gaps = signed_gaps(count(x, inside))
        path = sequential.combined(sequential.watch(gaps)[0])
        alarms = int((~np.isnan(first_alarm(path, 0.2))).sum())
        assert 0 < alarms <= binom.ppf(0.999, runs, 0.2)

    def test_one_uneven_group_among_even_ones_is_found(self):
        rng = np.random.default_rng(5)
        inside = np.eye(3)[rng.integers(0, 3, 6000)]
        x = (rng.random((6000, 2)) < 0.2 + 0.3 * inside[:, :1] * [1, 0]) * 1.0
        path, _ = sequential.watch(batches(x, inside, 30))
        assert first_alarm(sequential.combined(path)) < 100
        found = first_alarm(path, streams=6)
        assert not np.isnan(found[0, 0])
        assert np.isnan(found[:, 1]).all()
