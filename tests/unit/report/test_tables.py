"""Columns, statistics and the words for numbers, against hand calculation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from evenhand.core.wording import percent
from evenhand.report.table import csv_text, say, say_estimate, table, trailing_mean
from evenhand.statistics.means import mean_interval


def test_interval_of_three_seeds_by_hand() -> None:
    # mean 2, s = 1, t(2 degrees, 97.5 %) = 4.302653, half = 4.302653 / sqrt(3)
    found = mean_interval([1.0, 2.0, 3.0])
    assert (found.mean, found.n) == (2.0, 3)
    assert found.low == pytest.approx(2 - 2.484138, abs=1e-6)
    assert found.high == pytest.approx(2 + 2.484138, abs=1e-6)


def test_interval_agrees_with_scipy() -> None:
    x = np.random.default_rng(3).normal(5, 2, 11)
    low, high = stats.t.interval(0.9, 10, loc=x.mean(), scale=stats.sem(x))
    found = mean_interval(x, level=0.9)
    assert (found.low, found.high) == pytest.approx((low, high))


def test_nothing_is_less_than_nothing_by_rounding() -> None:
    assert say(-0.0004) == "0.000"
    assert percent(-0.0004) == "0.0\N{NO-BREAK SPACE}%"
    assert say(-0.0006) == "\N{MINUS SIGN}0.001"


def test_an_interval_ends_where_the_scale_does() -> None:
    # shares 0.7 and 1.0: 0.85 ± 12.7062 * 0.2121 / sqrt 2, that is ± 1.9
    cut = mean_interval([0.7, 1.0], within=(0.0, 1.0))
    assert (cut.mean, cut.low, cut.high) == (0.85, 0.0, 1.0)
    free = mean_interval([0.7, 1.0])
    assert (free.low, free.high) == pytest.approx((0.85 - 1.90593, 0.85 + 1.90593), abs=1e-5)
    assert not mean_interval([0.7], within=(0.0, 1.0)).has_interval


def test_one_seed_has_a_mean_and_no_interval() -> None:
    found = mean_interval([0.25, math.nan])
    assert (found.mean, found.n, found.has_interval) == (0.25, 1, False)
    assert say_estimate(found) == "0.250 (one seed, no interval)"


def test_no_value_is_not_defined_and_never_zero() -> None:
    found = mean_interval([math.nan, math.nan])
    assert math.isnan(found.mean)
    assert say_estimate(found) == say(found.mean) == percent(math.nan) == "not defined"


def test_trailing_mean_uses_what_there_is_at_the_start() -> None:
    values = np.array([1.0, 3.0, 5.0, math.nan, 9.0])
    # windows: {1}, {1,3}, {3,5}, {5}, {9}
    np.testing.assert_allclose(trailing_mean(values, 2), [1, 2, 4, 5, 9])
    assert math.isnan(trailing_mean(np.array([math.nan, 1.0]), 3)[0])


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.12345, "0.123"), (-0.5, "−0.500"), (12.345, "12.35"), (1234.56, "1,234.6")],
)
def test_numbers_in_words(value: float, text: str) -> None:
    assert say(value) == text


def test_csv_has_an_empty_cell_for_a_missing_number() -> None:
    data = table(("arm", "n", "mean"), [("ppo", 2, 0.1), ('say "hi", you', 3, None)])
    assert csv_text(data) == 'arm,n,mean\nppo,2,0.1\n"say ""hi"", you",3,\n'


def test_rows_are_found_by_their_values() -> None:
    data = table(("arm", "seed"), [("a", 1), ("b", 1), ("a", 2)])
    assert data.where(arm="a")["seed"].tolist() == [1, 2]
    assert data.distinct("arm") == ["a", "b"]
    assert len(data.where(arm="c")) == 0


def test_interval_of_many_windows_by_hand() -> None:
    # mean 2, s = 1, 1.96·1/√3
    found = mean_interval([1.0, math.nan, 2.0, 3.0], errors=1.96)
    assert (found.low, found.high) == pytest.approx((2 - 1.131607, 2 + 1.131607), abs=1e-6)
