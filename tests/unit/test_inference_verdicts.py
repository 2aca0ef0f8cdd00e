"""Three-state verdicts, how many services would be enough, and simulated windows."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, hypergeom, norm
from statsmodels.stats.proportion import samplesize_proportions_2indep_onetail

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, count
from evenhand.statistics import permutation, power, verdicts
from evenhand.statistics.verdicts import DISPARITY, INSUFFICIENT, NO_EVIDENCE, VerdictSettings
from support.refusals import refused

NAN = np.nan


def counts(*cells) -> Counts:
    """Cells (n, x, m, y) as groups of one issue."""
    return Counts(*np.array(cells, float).T[..., None])


def judge_counts(counts: Counts, settings: VerdictSettings | None = None) -> verdicts.Verdicts:
    """Verdicts from counts alone, by Fisher's exact test and Holm's adjustment."""
    n, x, m, y = (getattr(counts, f.name) for f in fields(counts))
    tails = hypergeom.cdf(x, n + m, x + y, n), hypergeom.sf(x - 1, n + m, x + y, n)
    p = np.where((n > 0) & (m > 0), np.minimum(1.0, 2 * np.minimum(*tails)), NAN)
    adjusted = permutation.holm(p.ravel()).reshape(p.shape)
    chosen = settings or VerdictSettings()
    return verdicts._verdicts(counts, p, adjusted, adjusted, chosen)


class TestNeeded:
    def test_against_statsmodels(self):
        # One comparison; 196 of 996 + 2 of 4 added is a rate of .198, so .298 on the smaller side.
        cell = counts((200, 40, 796, 156))
        # It names the first side's size; ratio is the second over the first.
        ratio: Any = 796 / 200
        expected = samplesize_proportions_2indep_onetail(0.1, 0.198, power=0.8, ratio=ratio)
        assert verdicts.needed_side(cell).item() == np.ceil(expected)

    def test_so_many_find_the_difference_with_the_stated_power(self):
        settings = VerdictSettings(delta=0.2)
        n = int(verdicts.needed_side(counts((500, 150, 500, 150)), settings).item())
        x = np.arange(n + 1)
        p, q = x[:, None] / n, x / n
        pooled = (p + q) / 2
        error = np.sqrt(2 * pooled * (1 - pooled) / n)
        z = np.abs(p - q) / np.where(error > 0, error, np.inf)
        weight = binom.pmf(x, n, 0.5)[:, None] * binom.pmf(x, n, 0.3)
        assert weight[z > norm.isf(0.025)].sum() == pytest.approx(0.8, abs=0.02)

    def test_more_comparisons_smaller_differences_and_more_power_need_more(self):
        one, many = counts((50, 15, 50, 15)), counts(*[(50, 15, 50, 15)] * 88)
        plain = verdicts.needed_side(one).item()
        assert (verdicts.needed_side(many) > 1.5 * plain).all()
        assert verdicts.needed_side(one, VerdictSettings(delta=0.05)).item() > 3 * plain
        assert verdicts.needed_side(one, VerdictSettings(power=0.95)).item() > plain

    def test_it_is_never_missing(self):
        cells = counts((0, 0, 0, 0), (0, 0, 9, 9), (9, 0, 0, 0), (1, 1, 1, 1), (9, 9, 9, 9))
        found = verdicts.needed_side(cells, VerdictSettings(delta=0.9))
        assert np.isfinite(found).all()
        assert (found >= 2).all()

    def test_a_window_that_saw_no_issue_does_not_need_fewer_than_one_that_saw_few(self):
        none, few = (verdicts.needed_side(counts((9, x, 9, x))).item() for x in (0, 1))
        assert 20 < none <= few


class TestVerdicts:
    def test_the_three_states_from_counts(self):
        found = judge_counts(
            counts(
                (2000, 900, 2000, 600),  # a clear difference
                (2000, 600, 2000, 600),  # none, and many services
                (20, 6, 3980, 1200),  # none, and few
                (0, 0, 4000, 1200),  # an empty side
            )
        )
        states = [DISPARITY, NO_EVIDENCE, INSUFFICIENT, INSUFFICIENT]
        assert found.verdict[:, 0].tolist() == states
        assert found.gap[0, 0] == pytest.approx(0.15)
        assert found.low[0, 0] > 0
        np.testing.assert_array_equal(np.isnan(found.gap[:, 0]), [False, False, False, True])
        np.testing.assert_array_equal(np.isnan(found.needed[:, 0]), [False, False, False, True])
        assert np.isnan(found.p_adjusted[3, 0])
        # Both sides of the second are alike, so it needs twice its smaller side.
        assert found.needed[1, 0] == 2 * found.needed_side[1, 0]
        # The third's smaller side is a 200th of the window.
        assert found.needed[2, 0] == 200 * found.needed_side[2, 0]

    def test_a_disparity_in_few_services_is_a_disparity(self):
        found = judge_counts(counts((12, 12, 12, 0)))
        assert found.verdict.item() == DISPARITY
        assert found.needed_side.item() > 12

    def test_limits_hold_together(self):
        alone = judge_counts(counts((50, 15, 50, 20)))
        among = judge_counts(counts((50, 15, 50, 20), (50, 15, 50, 15)))
        assert among.low[0, 0] < alone.low[0, 0] < alone.high[0, 0] < among.high[0, 0]

    def test_rows_and_counts_agree_on_clear_windows(self):
        rng = np.random.default_rng(0)
        inside = np.eye(2)[np.arange(400) // 200]
        x = np.stack([np.arange(400) < 100, np.arange(400) % 2 == 0, np.arange(400) < 0], 1) * 1.0
        rows = verdicts.judge(x, inside, rng, VerdictSettings(delta=0.3))
        alone = judge_counts(count(x, inside), VerdictSettings(delta=0.3))
        expected = [[DISPARITY, NO_EVIDENCE, NO_EVIDENCE]] * 2
        assert rows.verdict.tolist() == alone.verdict.tolist() == expected
        np.testing.assert_array_equal(rows.gap[:, 0], [0.5, -0.5])
        np.testing.assert_array_equal(rows.needed_side, alone.needed_side)

    def test_the_error_of_drawing_is_added(self):
        # Exactly one of 252 assignments and its mirror reach this: p = 2/252 = .0079, which 99
        # draws cannot settle below .01.
        x, inside = (np.arange(10) < 5)[:, None] * 1.0, (np.arange(10) < 5)[:, None] * 1.0
        few = VerdictSettings(alpha=0.01, permutations=99)
        many = VerdictSettings(alpha=0.01, permutations=9999)
        seeds = [np.random.default_rng(s) for s in range(5)]
        assert {verdicts.judge(x, inside, s, few).verdict.item() for s in seeds} == {INSUFFICIENT}
        assert {verdicts.judge(x, inside, s, many).verdict.item() for s in seeds} == {DISPARITY}

    @pytest.mark.parametrize(
        ("x", "inside"),
        [
            (np.full((9, 1), NAN), np.eye(3)[np.arange(9) % 3]),  # nothing applies: no responses
            (np.ones((9, 1)), np.ones((9, 2))),  # one group
            (np.ones((9, 1)), np.full((9, 2), NAN)),  # nobody's side is known
            (np.ones((1, 1)), np.ones((1, 1))),  # one service
            (np.ones((6, 1)), np.eye(2)[np.arange(6) % 2]),  # every service has the issue
        ],
    )
    def test_windows_that_say_nothing_are_insufficient_data(self, x, inside):
        found = verdicts.judge(x, inside, np.random.default_rng(0))
        assert set(found.verdict.ravel()) == {INSUFFICIENT}
        assert np.isfinite(found.needed_side).all()

    def test_services_are_compared_within_strata(self):
        place = np.repeat([0, 1], 40)
        x = (place == 0).astype(float)[:, None]
        inside = np.r_[np.arange(40) < 30, np.arange(40) < 10].astype(float)[:, None]
        rng = np.random.default_rng(2)
        assert verdicts.judge(x, inside, rng).verdict.item() == DISPARITY
        assert verdicts.judge(x, inside, rng, strata=place).verdict.item() == INSUFFICIENT

    @pytest.mark.parametrize("shared", [0, 10])
    def test_services_that_have_no_others_to_be_compared_with_do_not_count(self, shared):
        """2,000 here and 2,000 there, of whom at most ten have others of their own place."""
        place = np.repeat([0, 1], 2000)
        place[:shared] = 1
        inside = (np.arange(4000) < 2000).astype(float)[:, None]
        x = (np.arange(4000) % 10 == 0).astype(float)[:, None]
        assert judge_counts(count(x, inside)).verdict.item() == NO_EVIDENCE
        rng = np.random.default_rng(3)
        rows = verdicts.judge(x, inside, rng, strata=place)
        table, _ = verdicts.judge_table(x, inside, np.ones(4000, int), rng, strata=place)
        for found in (rows, table):
            assert found.verdict.item() == INSUFFICIENT
            assert np.isnan([found.gap, found.low, found.high, found.needed]).all() == (shared == 0)
        # ten against 2,000 know as much as W = 10·2000/2010, which is of two equal sides of 19.9
        if shared:
            side = rows.needed_side.item()
            assert rows.needed.item() == table.needed.item()
            assert rows.needed.item() == pytest.approx(
                side * 2 * 2000 / (2 * 10 * 2000 / 2010), abs=1
            )

    def test_strata_that_are_alike_need_as_many_as_none(self):
        place = np.tile([0, 1], 600)
        inside = (np.arange(1200) % 6 < 2).astype(float)[:, None]
        x = (np.arange(1200) % 5 == 0).astype(float)[:, None]
        rng = np.random.default_rng(4)
        alone = verdicts.judge(x, inside, rng)
        within = verdicts.judge(x, inside, rng, strata=place)
        assert within.verdict.item() == alone.verdict.item() == NO_EVIDENCE
        assert within.needed.item() == alone.needed.item()

    @pytest.mark.parametrize(
        "wrong",
        [
            {"alpha": 0.0},
            {"alpha": NAN},
            {"delta": 1.0},
            {"power": 1.5},
            {"alpha": 0.5, "power": 0.4},
            {"permutations": 9},
        ],
    )
    def test_wrong_settings(self, wrong):
        with pytest.raises(InputError):
            VerdictSettings(**wrong)


class TestSimulation:
    def test_windows_are_what_they_are_said_to_be(self):
        extra = np.zeros((22, 4))
        extra[3, 3] = 0.4
        x, inside = power.simulate_windows(200, 100, np.random.default_rng(0), 0.3, extra=extra)
        assert x.shape == (200, 100, 4)
        assert inside.shape == (200, 100, 22)
        np.testing.assert_array_equal(inside.sum(axis=2), 5)  # one category of each identity
        np.testing.assert_allclose(
            inside.mean(axis=(0, 1))[[0, 6, 9, 14]], [1 / 6, 1 / 3, 0.2, 0.5], atol=0.02
        )
        np.testing.assert_array_equal(np.isnan(x[..., 1]), x[..., 0] == 1)
        np.testing.assert_array_equal(np.isnan(x[..., 2]), x[..., 0] == 1)
        member = inside[..., 3] == 1
        rates = [np.nanmean(x[member], axis=0), np.nanmean(x[~member], axis=0)]
        np.testing.assert_allclose(rates, [[0.3, 0.3, 0.3, 0.7], [0.3] * 4], atol=0.03)

    def test_false_alarms_beside_the_raw_threshold(self):
        rows = power.false_alarms([30, 120], np.random.default_rng(1), 300, permutations=99)
        for row in rows:
            assert row.verdict * 300 <= binom.ppf(0.999, 300, 0.05)
            assert row.verdict_low <= row.verdict <= row.verdict_high
        # A total of about .75 by chance alone at 30 services, .34 at 120.
        assert [row.raw for row in rows] == pytest.approx([1, 0], abs=0.03)

    def test_known_disparities_are_found_the_better_the_larger(self):
        rows = power.power(
            [60, 240], [0.0, 0.2, 0.6], np.random.default_rng(2), 60, permutations=99
        )
        found = np.array([row.found for row in rows]).reshape(2, 3)
        assert (found[:, 0] <= 0.05).all()
        assert found[0, 2] > 0.3
        assert found[1, 1] > found[0, 1]
        assert found[1, 2] == 1

    @pytest.mark.parametrize(
        "wrong",
        [{"rate": 1.2}, {"rate": NAN}, {"categories": (6, 1)}, {"categories": ()}, {"size": 0}],
    )
    def test_wrong_windows(self, wrong):
        given = {"windows": 2, "size": 5, "rng": np.random.default_rng(0), **wrong}
        with pytest.raises(InputError):
            power.simulate_windows(**given)

    @pytest.mark.parametrize(("size", "windows"), [(0, 5), (5, 0)])
    def test_no_windows_to_simulate(self, size, windows):
        rng = np.random.default_rng(0)
        for simulate in (
            lambda: power.false_alarms([size], rng, windows),
            lambda: power.power([size], [0.1], rng, windows),
        ):
            with pytest.raises(InputError, match="give a whole number"):
                simulate()

    def test_a_cell_that_does_not_exist_and_a_rate_above_1(self):
        rng = np.random.default_rng(0)
        with refused("range cell", "22"):
            power.power([30], [0.1], rng, 5, cell=(22, 0))
        with refused("range rates"):
            power.power([30], [0.8], rng, 5)
