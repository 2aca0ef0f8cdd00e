"""The test on counts against enumeration, shuffled rows, SciPy, and the normal law."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.statistics import count_tables, permutation

NAN = np.nan
PERMUTATIONS = 4000

# Nine services in six rows: the second issue does not apply to all, one side is unknown.
X = np.array([[1, 1], [1, NAN], [1, 0], [0, 0], [0, 1], [0, NAN]], float)
INSIDE = np.array([[1, 0, 1], [1, 0, 0], [1, 0, 1], [0, 1, 1], [0, 1, 0], [0, 1, NAN]], float)
N = np.array([1, 1, 1, 2, 1, 1])


def found_in(x, inside, n, rng, permutations=2000, strata=None, who=None, totalled=None):
    return count_tables.Table.of(x, inside, n, strata, who).test(rng, permutations, totalled)


def rows(values, n):
    return np.repeat(np.asarray(values), n, axis=0)


def near(drawn, true, b):
    """Shares of b draws within five standard errors, and a step of 1 / b."""
    return np.abs(drawn - true) <= 5 * np.sqrt(true * (1 - true) / b) + 1.5 / b


def possible_tables(margin_rows, margin_columns):
    """Every table with these margins and its probability, from factorials."""
    total = sum(margin_rows)
    top = math.prod(map(math.factorial, [*margin_rows, *margin_columns]))
    spans = [range(min(r, c) + 1) for r in margin_rows for c in margin_columns]
    for cells in itertools.product(*spans):
        table = np.reshape(cells, (len(margin_rows), len(margin_columns)))
        same_rows = (table.sum(axis=1) == margin_rows).all()
        if same_rows and (table.sum(axis=0) == margin_columns).all():
            below = math.factorial(total) * math.prod(map(math.factorial, cells))
            yield cells, top / below


@pytest.mark.parametrize("cheaper", [0, 10**6], ids=["SciPy", "shuffled"])
def test_every_table_comes_as_often_as_factorials_say(cheaper, monkeypatch):
    monkeypatch.setattr(count_tables, "CHEAPER", cheaper)
    table = np.array([[2, 0, 1], [0, 2, 1], [1, 0, 1]])
    expected = dict(possible_tables([3, 3, 2], [3, 2, 3]))
    assert math.isclose(sum(expected.values()), 1.0)
    b = 20_000
    drawn = np.stack([*count_tables.random_tables(table, b, np.random.default_rng(0))])
    assert drawn.shape == (3, 3, b)
    found, times = np.unique(drawn.reshape(9, b).T, axis=0, return_counts=True)
    seen = {tuple(cells): count for cells, count in zip(found.tolist(), times, strict=True)}
    assert set(seen) <= set(expected)
    observed = [seen.get(cells, 0) for cells in expected]
    assert stats.chisquare(observed, [b * p for p in expected.values()]).pvalue > 1e-3


@pytest.mark.parametrize("cheaper", [0, 10**6], ids=["SciPy", "shuffled"])
@pytest.mark.parametrize("strata", [None, [0, 0, 1, 1, 1, 0]])
def test_weighted_rows_against_all_orders_of_services(strata, cheaper, monkeypatch):
    monkeypatch.setattr(count_tables, "CHEAPER", cheaper)
    given = None if strata is None else np.array(strata)
    place = np.zeros(7, int) if strata is None else rows(strata, N)
    every = np.array([*itertools.permutations(range(7))])
    every = every[(place[every] == place).all(axis=1)]
    exact = permutation.against_orders(
        rows(X, N), rows(INSIDE, N), [every], None if strata is None else place
    )
    found = found_in(X, INSIDE, N, np.random.default_rng(1), PERMUTATIONS, given)
    np.testing.assert_allclose(found.statistic, exact.statistic)
    assert near(found.p, exact.p, PERMUTATIONS).all()
    assert near(found.p_adjusted, exact.p_adjusted, PERMUTATIONS).all()
    # A gap has at most the spread of a coin: 5 × 0.5 / sqrt(4000).
    np.testing.assert_allclose(found.even_gap, exact.even_gap, atol=0.04)
    assert abs(found.even_total - exact.even_total) < 0.08
    assert found.total == pytest.approx(exact.total)
    assert near(np.array(found.p_total), np.array(exact.p_total), PERMUTATIONS)


@pytest.mark.parametrize("cheaper", [0, count_tables.CHEAPER], ids=["SciPy", "as chosen"])
def test_the_same_as_shuffling_a_row_for_each_service(cheaper, monkeypatch):
    monkeypatch.setattr(count_tables, "CHEAPER", cheaper)
    rng = np.random.default_rng(2)
    codes = rng.integers(0, (3, 4), (200, 2))
    inside = np.concatenate([codes[:, [0]] == range(3), codes[:, [1]] == range(4)], axis=1)
    x = rng.choice([0, 1, NAN], (200, 3), p=[0.6, 0.3, 0.1])
    n, strata = rng.integers(1, 4, 200), rng.integers(0, 3, 200)
    b = 2000
    by_rows = permutation.permutation_test(
        rows(x, n), rows(inside, n).astype(float), rng, b, rows(strata, n)
    )
    found = found_in(x, inside, n, rng, b, strata)
    np.testing.assert_allclose(found.statistic, by_rows.statistic)
    for a, e in ((found.p, by_rows.p), (found.p_adjusted, by_rows.p_adjusted)):
        # Both are drawn: five standard errors of a difference.
        assert (np.abs(a - e) <= 5 * np.sqrt(2 * e * (1 - e) / b) + 2 / b).all()
    # Services of a group and issue are 60 and more: a gap varies by less than 0.06.
    np.testing.assert_allclose(found.even_gap, by_rows.even_gap, atol=5 * 0.06 * (2 / b) ** 0.5)
    assert ((found.p > 0.02) & (found.p < 0.98)).sum() > 10  # there is something to compare


def test_scipy_s_permutation_test_of_one_gap():
    table = np.array([[14, 31], [6, 34]])  # a group's services with and without, the others'
    x = np.array([[1], [0], [1], [0]], float)
    inside = np.array([[1], [1], [0], [0]], float)
    sides = [np.repeat([1.0, 0.0], row) for row in table]
    oracle = stats.permutation_test(
        sides,
        lambda a, b, axis: np.abs(a.mean(axis=axis) - b.mean(axis=axis)) + 1e-12,
        vectorized=True,
        n_resamples=9999,
        alternative="greater",
        rng=np.random.default_rng(3),
    ).pvalue
    found = found_in(x, inside, table.ravel(), np.random.default_rng(4), 9999)
    assert found.p[0, 0] == pytest.approx(oracle, abs=5 * math.sqrt(2 * oracle / 9999))
    assert 0.05 < oracle < 0.15


def test_ten_million_services_follow_the_normal_law():
    n = np.array([500_900, 4_499_100, 500_000, 4_500_000])
    x, inside = np.array([[1], [0], [1], [0.0]]), np.array([[1, 0], [1, 0], [0, 1], [0, 1.0]])
    found = found_in(x, inside, n, np.random.default_rng(5), PERMUTATIONS)
    # 900 more cases among 5 million: half of it, 450, over sqrt(N r (1 − r) / 4), r = 0.10009.
    z = 450 / math.sqrt(10_000_000 * 0.10009 * 0.89991 / 4)
    assert found.statistic[:, 0] == pytest.approx([z, -z], rel=1e-6)
    p = 2 * stats.norm.sf(z)
    assert near(found.p_adjusted, np.full((2, 1), p), PERMUTATIONS).all()
    assert found.even_gap[0, 0] == pytest.approx(
        math.sqrt(2 / math.pi) * math.sqrt(0.10009 * 0.89991 * 2 / 5e6), rel=0.06
    )


@pytest.mark.parametrize("cheaper", [0, 10**6], ids=["SciPy", "shuffled"])
def test_chunks_have_as_much_chance_as_one(cheaper, monkeypatch):
    def test(seed):
        return found_in(X, INSIDE, N, np.random.default_rng(seed), PERMUTATIONS)

    monkeypatch.setattr(count_tables, "CHEAPER", cheaper)
    whole = test(8)
    monkeypatch.setattr(count_tables, "CELLS", 2000)
    chunks = test(8)
    np.testing.assert_array_equal(test(8).p, chunks.p)
    # none repeats another
    assert near(chunks.p, whole.p, PERMUTATIONS / 2).all()


def test_a_table_of_as_many_services_as_there_may_be():
    """A cell has the hypergeometric law, whose mean and variance are known."""
    n, group, cases, b = count_tables.MOST_SERVICES, 400_000_000, 10_000_000, 20_000
    table = np.array([[cases // 2, cases // 2], [group - cases // 2, n - group - cases // 2]])
    cell = np.stack([*count_tables.random_tables(table, b, np.random.default_rng(0))])[0, 0]
    law = stats.hypergeom(n, group, cases)
    assert abs(cell.mean() - law.mean()) < 5 * law.std() / b**0.5
    assert cell.var() == pytest.approx(law.var(), rel=5 * (2 / b) ** 0.5)


def test_kinds_of_people_once_and_rows_without_services():
    kinds, who = np.array([[1, 0], [0, 1]], bool), np.array([0, 1, 1, 0, 1])
    x, n = np.array([[1], [0], [1], [0], [1.0]]), np.array([8, 9, 3, 4, 0])
    short = found_in(x, kinds, n, np.random.default_rng(6), 500, who=who)
    long = found_in(x[:4], kinds[who[:4]].astype(float), n[:4], np.random.default_rng(6), 500)
    np.testing.assert_array_equal(short.p_adjusted, long.p_adjusted)
    np.testing.assert_array_equal(short.even_gap, long.even_gap)
    assert short.total == pytest.approx(8 / 12 - 3 / 12)


def test_the_total_of_the_first_groups_only():
    x, n = np.array([[1], [0], [1], [0.0]]), np.array([3, 1, 2, 6])
    inside = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 0], [0, 0, 0.0]])
    found = found_in(x, inside, n, np.random.default_rng(7), 99, totalled=1)
    assert found.total == pytest.approx(3 / 4 - 2 / 8)


def test_wrong_input():
    x, inside, n = np.array([[1.0], [0.0]]), np.array([[1.0], [0.0]]), np.array([2, 2])
    rng = np.random.default_rng(0)
    cases: list[Any] = [
        ((x, inside, np.array([2, -1])), {}, "whole numbers"),
        ((x, inside, np.array([2.0, 1.5])), {}, "whole numbers"),
        ((x, inside, np.array([0, 0])), {}, "there are none"),
        ((x, inside[:1], n), {}, "do not match"),
        ((x, inside, n), {"strata": np.array([1])}, "do not match"),
        ((x * 2, inside, n), {}, "indicators hold"),
        ((x, inside * 3, n), {}, "membership hold"),
        ((x[:, :0], inside, n), {}, "nothing to test"),
        ((x, inside, np.array([999_999_999, 1])), {}, "name strata"),
        ((x, inside, n), {"permutations": 98}, "permutations"),
        ((x, inside, n), {"who": np.array([0, 2])}, "who"),
    ]
    for given, named, part in cases:
        with pytest.raises(InputError, match=part):
            found_in(given[0], given[1], given[2], rng, **named)
