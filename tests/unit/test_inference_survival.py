"""Waiting: Freireich's trial as published, hand numbers, statsmodels, full enumeration."""

import itertools
from typing import Any

import numpy as np
import pytest
from statsmodels.duration.survfunc import SurvfuncRight, survdiff

from evenhand.core.errors import InputError
from evenhand.methods.services import Interactions
from evenhand.statistics import survival

NAN = np.nan

# Weeks of remission (Freireich et al., Blood 1963): treated and placebo, 0 where censored.
TREATED = np.array([6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35.0])
ENDED = np.array([1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0.0])
PLACEBO = np.array([1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23.0])
WEEKS, HAPPENED = np.r_[TREATED, PLACEBO], np.r_[ENDED, np.ones(21)]
GROUP = np.r_[np.ones(21), np.zeros(21)][:, None]


class TestKaplanMeier:
    def test_the_published_curve(self):
        found = survival.kaplan_meier(TREATED, ENDED)
        np.testing.assert_array_equal(found.steps, [0, 6, 7, 10, 13, 16, 22, 23])
        np.testing.assert_allclose(
            found.share[:, 0], [1, 0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448], atol=5e-4
        )
        np.testing.assert_array_equal(found.at_risk[:, 0], [21, 21, 17, 15, 12, 11, 7, 6])
        # Log-log limits at 10 weeks, as printed by common packages.
        np.testing.assert_allclose([found.low[3, 0], found.high[3, 0]], [0.503, 0.889], atol=5e-4)

    def test_shares_and_greenwood_against_statsmodels(self):
        rng = np.random.default_rng(0)
        waited, responded = rng.integers(1, 60, 200) * 5.0, (rng.random(200) < 0.7) * 1.0
        inside = (rng.random((200, 2)) < 0.4) * 1.0
        found = survival.kaplan_meier(waited, responded, inside, level=0.9)
        for g in range(2):
            mine = inside[:, g] == 1
            other: Any = SurvfuncRight(waited[mine], responded[mine])
            at = np.isin(found.steps, other.surv_times)
            known = (other.surv_prob > 0) & (other.surv_prob < 1)
            np.testing.assert_allclose(found.share[at, g], other.surv_prob, atol=1e-12)
            s, se = other.surv_prob[known], other.surv_prob_se[known]
            half = 1.6448536269514722 * se / (s * np.abs(np.log(s)))
            np.testing.assert_allclose(found.low[at, g][known], s ** np.exp(half))
            np.testing.assert_allclose(found.high[at, g][known], s ** np.exp(-half))

    def test_what_was_not_seen_to_happen_is_not_certain(self):
        # Nobody answered within 200; all within 10. Wilson's limits of 4 of 4 and 0 of 4.
        none = survival.kaplan_meier(np.full(4, 300.0), np.zeros(4), steps=np.array([200.0]))
        assert none.share.item() == none.high.item() == 1
        assert none.low.item() == pytest.approx(4 / (4 + 1.959964**2), abs=1e-6)
        every = survival.kaplan_meier(np.full(4, 10.0), np.ones(4), steps=np.array([200.0]))
        assert every.share.item() == every.low.item() == 0
        assert every.high.item() == pytest.approx(1.959964**2 / (4 + 1.959964**2), abs=1e-6)

    def test_past_the_last_person_seen_the_share_is_not_known(self):
        found = survival.kaplan_meier(
            np.array([10.0, 50.0]), np.array([1.0, 0.0]), steps=np.array([50.0, 51.0])
        )
        assert found.share[0, 0] == 0.5
        assert np.isnan([found.share[1, 0], found.low[1, 0], found.high[1, 0]]).all()

    def test_a_column_without_people_is_missing(self):
        found = survival.kaplan_meier(np.array([10.0]), np.array([1.0]), np.zeros((1, 1)))
        assert np.isnan(found.share).all()
        assert (found.at_risk == 0).all()

    def test_no_service_at_all(self):
        found = survival.kaplan_meier(np.zeros(0), np.zeros(0))
        assert np.isnan(found.share).all()

    def test_rows_that_are_not_known_count_nowhere(self):
        found = survival.kaplan_meier(
            np.array([10, NAN, 20, 30.0]), np.array([1, 1, NAN, 0.0]), steps=np.array([10.0])
        )
        assert found.share.item() == 0.5


class TestWaitingGap:
    def test_without_censoring_it_is_a_gap_of_rates(self):
        # Late: 2 of 4 against 1 of 5; the services without a response were seen for 300 steps.
        waited = np.array([100, 150, 250, 300, 50, 60, 200, 70, 300.0])
        responded = np.array([1, 1, 1, 0, 1, 1, 1, 1, 0.0])
        inside = (np.arange(9) < 4)[:, None] * 1.0
        found = survival.waiting_gap(waited, responded, inside)
        assert found.inside.item() == pytest.approx(0.5)
        assert found.outside.item() == pytest.approx(0.2)
        assert found.gap.item() == pytest.approx(0.3)
        assert found.low.item() < 0.3 < found.high.item()

    def test_ignoring_slow_cases_does_not_look_fast(self):
        # Among those answered nobody in the group waited long; but half were never answered.
        waited = np.r_[np.full(20, 100.0), np.full(20, 300.0), np.full(40, 100.0)]
        responded = np.r_[np.ones(20), np.zeros(20), np.ones(40)]
        inside = (np.arange(80) < 40)[:, None] * 1.0
        found = survival.waiting_gap(waited, responded, inside)
        assert found.gap.item() == pytest.approx(0.5)
        assert found.low.item() > 0.3

    def test_sides_mirror_each_other_and_unknown_is_on_neither(self):
        inside = np.c_[GROUP, 1 - GROUP, GROUP]
        inside[0, 2] = NAN
        found = survival.waiting_gap(WEEKS, HAPPENED, inside, step=10)
        assert found.gap[0] == -found.gap[1]
        assert found.low[0] == -found.high[1]
        only = survival.waiting_gap(WEEKS[1:], HAPPENED[1:], GROUP[1:], step=10)
        assert found.inside[2] == only.inside[0]

    def test_one_group_is_missing(self):
        found = survival.waiting_gap(TREATED, ENDED, np.ones((21, 1)), step=10)
        assert np.isnan([found.gap, found.low, found.high]).all()

    def test_the_limits_hold_the_truth_about_as_often_as_stated(self):
        # Geometric waiting, ended at random; true shares .9^10 and .95^10 after 10 steps.
        rng = np.random.default_rng(3)
        truth, held = 0.95**10 - 0.9**10, 0
        for _ in range(400):
            inside = (np.arange(120) < 60)[:, None] * 1.0
            t = rng.geometric(np.where(inside[:, 0] == 1, 0.05, 0.1)).astype(float)
            end = rng.integers(3, 60, 120)
            found = survival.waiting_gap(np.minimum(t, end), (t <= end) * 1.0, inside, step=10)
            held += bool(found.low.item() <= truth <= found.high.item())
        assert 0.92 <= held / 400 <= 0.98


class TestLogRank:
    def test_the_published_test(self):
        found = survival.log_rank(WEEKS, HAPPENED, GROUP)
        assert found.observed.item() == 9
        assert found.expected.item() == pytest.approx(19.25, abs=5e-3)
        assert found.z.item() ** 2 == pytest.approx(16.79, abs=5e-3)
        assert found.z.item() < 0  # ended later

    def test_against_statsmodels(self):
        rng = np.random.default_rng(1)
        waited, responded = rng.integers(1, 30, 150) * 10.0, (rng.random(150) < 0.6) * 1.0
        inside = (rng.random((150, 3)) < [0.1, 0.5, 0.8]) * 1.0
        found = survival.log_rank(waited, responded, inside)
        for g in range(3):
            chi2, p = survdiff(waited, responded, inside[:, g])
            assert found.z[g] ** 2 == pytest.approx(chi2)
            assert found.p[g] == pytest.approx(p)

    def test_all_orders_against_plain_sums(self):
        # The scores by hand: of 6 at risk one answered at 1; of 5 two at 2; of 2 one at 4.
        waited, responded = np.array([1, 2, 2, 3, 4, 5.0]), np.array([1, 1, 1, 0, 1, 0.0])
        h1, h2, h4 = 1 / 6, 1 / 6 + 2 / 5, 1 / 6 + 2 / 5 + 1 / 2
        score = np.array([1 - h1, 1 - h2, 1 - h2, -h2, 1 - h4, -h4])
        inside = np.array([1, 1, 0, 0, 0, 0.0])[:, None]
        sums = np.array([abs(score[list(o[:2])].sum()) for o in itertools.permutations(range(6))])
        exact = (sums >= abs(score[:2].sum()) - 1e-9).mean()
        found = survival.log_rank_permutation(
            waited, responded, inside, np.random.default_rng(0), 20_000
        )
        assert found.p.item() == pytest.approx(exact, abs=4 * np.sqrt(0.25 / 20_000))
        assert found.p_adjusted.item() == found.p.item()

    def test_permutations_come_close_to_the_normal_p_and_adjust_upwards(self):
        rng = np.random.default_rng(4)
        waited, responded = rng.integers(1, 60, 300) * 5.0, (rng.random(300) < 0.8) * 1.0
        inside = (rng.random((300, 4)) < 0.4) * 1.0
        inside[rng.random((300, 4)) < 0.1] = NAN
        found = survival.log_rank_permutation(waited, responded, inside, rng, 4000)
        np.testing.assert_allclose(
            found.p, survival.log_rank(waited, responded, inside).p, atol=0.04
        )
        assert (found.p_adjusted >= found.p).all()
        assert (found.p_adjusted > found.p).any()

    def test_a_clear_difference_is_found(self):
        found = survival.log_rank_permutation(WEEKS, HAPPENED, GROUP, np.random.default_rng(0))
        assert found.p.item() < 0.005

    def test_sides_that_are_empty_are_missing_and_nothing_seen_is_no_difference(self):
        inside = np.c_[GROUP, np.ones(42), np.full(42, NAN)]
        rng = np.random.default_rng(0)
        for p in (
            survival.log_rank(WEEKS, np.zeros(42), inside).p,
            survival.log_rank_permutation(WEEKS, np.zeros(42), inside, rng).p,
        ):
            np.testing.assert_array_equal(p, [1, NAN, NAN])


def test_waiting_of_services():
    table = Interactions.build(
        {"disability": (np.array([0, 1, 0]), ("Yes", "No"))},
        {"responded": [True, False, None], "response_step": [40, None, 10], "steps": [40, 300, 10]},
    )
    waited, responded = survival.waiting(table)
    np.testing.assert_array_equal(waited[:2], [40, 300])
    np.testing.assert_array_equal(responded, [1, 0, NAN])


def test_waiting_needs_the_end_of_services():
    table = Interactions.build(
        {"disability": (np.array([0]), ("Yes", "No"))},
        {"responded": [True], "response_step": [40]},
    )
    with pytest.raises(InputError, match="steps"):
        survival.waiting(table)


@pytest.mark.parametrize(
    ("waited", "responded", "member", "message"),
    [
        ([1, 2], [1], [[1], [1]], "do not match"),
        ([1, 2], [1, 0], [[1]], "do not match"),
        ([-1, 2], [1, 0], [[1], [1]], "negative"),
        ([np.inf, 2], [1, 0], [[1], [1]], "endless"),
        ([1, 2], [1, 2], [[1], [1]], "responses hold other"),
        ([1, 2], [1, 0], [[1], [-1]], "members hold other"),
    ],
)
def test_rows_that_cannot_be(waited, responded, member, message):
    with pytest.raises(InputError, match=message):
        survival.kaplan_meier(
            np.array(waited, float), np.array(responded, float), np.array(member, float)
        )
