"""The guard over time, on histories made by hand."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.methods.guard import Guard, GuardSettings, watch, weight, worse
from evenhand.methods.paper.scores import Counts

SETTINGS = GuardSettings()


def epoch(with_issue, services=6.0) -> Counts:
    """One epoch of some groups and one issue."""
    x = np.asarray(with_issue, float)[:, None]
    n = np.broadcast_to(services, x.shape).astype(float)
    return Counts(n, x, np.zeros_like(n), np.zeros_like(n))


def strengths(history, settings=SETTINGS, services=6.0) -> list[float]:
    guard = Guard.new(len(history[0]), 1, settings)
    out = []
    for with_issue in history:
        guard, _ = watch(guard, epoch(with_issue, services), settings)
        out.append(guard.strength)
    return out


class TestWorse:
    def test_against_another_beta_binomial(self):
        rng = np.random.default_rng(0)
        n = rng.integers(0, 40, (6, 5))
        x = rng.integers(0, n + 1)
        before_n = rng.random((6, 5)) * 100
        before_x = rng.random((6, 5)) * before_n
        expected = stats.betabinom.sf(x - 1, n, 0.5 + before_x, 0.5 + before_n - before_x)
        found = worse(n.astype(float), x.astype(float), before_n, before_x)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)

    def test_by_hand_from_an_even_prior(self):
        # one issue in one service, before: half a service with, half without on each side
        one = np.ones((1, 1))
        assert worse(one, one, 0 * one, 0 * one) == pytest.approx(1 / 2)
        assert worse(one, one, 3 * one, 3 * one) == pytest.approx(3.5 / 4)

    def test_no_issue_is_never_worse(self):
        full = np.full((2, 2), 9.0)
        np.testing.assert_allclose(worse(full, 0 * full, full, 0 * full), 1.0)


class TestWatch:
    STEADY = tuple([(1, 2)] * 40)

    def test_steady_service_leaves_evenness_its_strength(self):
        assert set(strengths(self.STEADY)) == {1.0}

    def test_it_halves_while_a_group_is_served_worse(self):
        found = strengths([*self.STEADY, *[(5, 2)] * 4])
        assert found[39] == 1.0
        assert found[-1] < 0.5
        assert all(a >= b for a, b in itertools.pairwise(found))

    def test_the_rule_step_by_step(self):
        found = strengths([*self.STEADY, *[(6, 2)] * 3, *[(1, 2)] * 30])
        alarms = [b < a for a, b in itertools.pairwise(found)]
        for before, after, alarm in zip(found, found[1:], alarms, strict=False):
            assert after == pytest.approx(before * 0.5 if alarm else min(1.0, before + 0.05))
        assert any(alarms)
        assert found[-1] == 1.0

    def test_a_group_that_is_served_better_raises_no_alarm(self):
        assert set(strengths([*[(5, 5)] * 40, *[(0, 5)] * 20])) == {1.0}

    def test_few_services_prove_nothing(self):
        # one bad service of a group that is met once an epoch
        history = [*[(0, 0)] * 40, (1, 0), *[(0, 0)] * 5]
        assert set(strengths(history, services=1.0)) == {1.0}

    def test_a_lasting_change_is_got_used_to(self):
        found = strengths([*self.STEADY, *[(4, 2)] * 200])
        assert min(found) < 0.1
        assert found[-1] == 1.0

    def test_nothing_to_compare_with_at_first(self):
        guard = Guard.new(2, 1, SETTINGS)
        for _ in range(4):
            guard, chance = watch(guard, epoch((6, 6)), SETTINGS)
            assert (chance == 1.0).all()
        guard, chance = watch(guard, epoch((6, 6)), SETTINGS)
        assert (guard.reference[:, 0] == 6.0).all()
        assert (chance < 1.0).all()

    def test_the_reference_forgets(self):
        settings = GuardSettings(windows=1, keep=0.5)
        guard = Guard.new(1, 1, settings)
        for with_issue in (2, 4, 6, 0):
            guard, _ = watch(guard, epoch((with_issue,)), settings)
        # 2/4 + 4/2 + 6 issues, 6/4 + 6/2 + 6 services
        np.testing.assert_allclose(guard.reference[0, 0], [10.5, 8.5])

    def test_false_alarms_at_a_single_look_stay_below_the_level(self):
        # 2,000 runs side by side: as many groups, but one level for each
        rng = np.random.default_rng(3)
        runs, settings = 2000, GuardSettings(level=0.05, windows=4)
        guard, chance = Guard.new(runs, 1, settings), np.ones((runs, 1))
        for _ in range(60):
            guard, chance = watch(guard, epoch(rng.binomial(6, 0.2, runs)), settings)
        alarms = np.count_nonzero(chance < settings.level)
        assert 0 < alarms <= stats.binom.ppf(0.999, runs, settings.level)


@pytest.mark.parametrize(
    "wrong", [{"level": 0.0}, {"level": 1.0}, {"windows": 0}, {"keep": 1.0}, {"keep": -0.1}]
)
def test_wrong_settings(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        GuardSettings(**wrong)


def test_evenness_weighs_as_much_as_there_is_service():
    """60 services of everybody in two epochs, 15 and 30 of them imperfect: a quarter is good."""
    watched = Guard.new(2, 1, SETTINGS)
    assert weight(watched) == 0.0
    for imperfect in (15.0, 30.0):
        sides = (np.array([[10.0], [30.0]]), np.array([[0.0], [imperfect]]), *np.zeros((2, 2, 1)))
        watched, _ = watch(watched, Counts(*sides), SETTINGS)
    assert watched.strength == 1.0
    assert weight(watched) == pytest.approx(0.25)
    assert weight(replace(watched, strength=0.5)) == pytest.approx(0.125)
