"""Permutation tests against full enumeration in plain loops, and other libraries' exact tests."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.contingency_tables import StratifiedTable
from statsmodels.stats.multitest import multipletests

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, count
from evenhand.statistics import chance, permutation, windows
from support.refusals import refused

NAN = np.nan

# Seven services, two issues (the second does not apply to all), three groups, one side unknown.
X = np.array([[1, 1], [1, NAN], [1, 0], [0, 0], [0, 1], [0, 0], [0, NAN]], float)
INSIDE = np.array(
    [[1, 0, 1], [1, 0, 0], [1, 0, 1], [0, 1, 1], [0, 1, 0], [0, 1, 0], [0, 1, NAN]], float
)


def statistic(x, inside, strata):
    """Mantel and Haenszel's statistic in a plain loop; None where nobody can be compared."""
    difference = variance = 0.0
    comparable = False
    for s in set(strata):
        rows = [
            (b, a)
            for a, b, c in zip(x, inside, strata, strict=True)
            if c == s and not math.isnan(a) and not math.isnan(b)
        ]
        N, n = len(rows), sum(b for b, _ in rows)
        cases, mine = sum(a for _, a in rows), sum(a * b for b, a in rows)
        if 0 < n < N:
            comparable = True
            difference += mine - n * cases / N
            variance += n * (N - n) * cases * (N - cases) / (N * N * (N - 1))
    if not comparable:
        return None
    return difference / math.sqrt(variance) if variance > 0 else 0.0


def gap(x, inside):
    """Eq. 1 in a plain loop; None where a side is empty."""
    sides = {1.0: [], 0.0: []}
    for a, b in zip(x, inside, strict=True):
        if not (math.isnan(a) or math.isnan(b)):
            sides[b].append(a)
    if not sides[1.0] or not sides[0.0]:
        return None
    return abs(sum(sides[1.0]) / len(sides[1.0]) - sum(sides[0.0]) / len(sides[0.0]))


def enumerated(x, inside, strata):
    """Everything the test says, from all orders within strata, with Python loops only."""
    every = [
        o
        for o in itertools.permutations(range(len(x)))
        if all(strata[a] == strata[b] for a, b in enumerate(o))
    ]
    cells = list(itertools.product(range(inside.shape[1]), range(x.shape[1])))

    def of(function, order):
        return {(g, k): function(x[list(order), k], inside[:, g]) for g, k in cells}

    def z(a, b):
        return statistic(a, b, strata)

    seen = of(z, range(len(x)))
    size = {c: abs(v or 0.0) for c, v in seen.items()}
    drawn = [{c: abs(v or 0.0) for c, v in of(z, o).items()} for o in every]
    p = {c: (1 + sum(d[c] >= size[c] - 1e-9 for d in drawn)) / (len(every) + 1) for c in cells}
    adjusted, before = {}, 0.0
    for c in sorted(cells, key=lambda c: -size[c]):
        lower = [e for e in cells if size[e] <= size[c]]
        above = sum(max(d[e] for e in lower) >= size[c] - 1e-9 for d in drawn)
        before = max(before, (1 + above) / (len(every) + 1))
        adjusted[c] = before
    even = {}
    for c in cells:
        known = [v for o in every if (v := gap(x[list(o), c[1]], inside[:, c[0]])) is not None]
        even[c] = sum(known) / len(known)
    return every, seen, p, adjusted, even


@pytest.mark.parametrize("strata", [[0] * 7, [0, 0, 1, 1, 1, 0, 0]])
def test_all_orders_against_plain_loops(strata):
    every, seen, p, adjusted, even = enumerated(X, INSIDE, strata)
    given = np.array(strata)
    halves = np.array_split(np.array(every), 2)
    found = permutation.against_orders(X, INSIDE, halves, given if any(strata) else None)
    assert found.permutations == len(every)
    for (g, k), value in seen.items():
        if value is None:
            assert np.isnan([found.statistic[g, k], found.p[g, k], found.p_adjusted[g, k]]).all()
            continue
        assert found.statistic[g, k] == pytest.approx(value)
        assert found.p[g, k] == pytest.approx(p[g, k])
        assert found.p_adjusted[g, k] == pytest.approx(adjusted[g, k])
        assert found.even_gap[g, k] == pytest.approx(even[g, k])


def test_the_raw_total_beside_its_mean_over_all_orders():
    every = list(itertools.permutations(range(7)))
    totals = []
    for order in every:
        by_issue = []
        for k in range(2):
            known = [v for g in range(3) if (v := gap(X[list(order), k], INSIDE[:, g])) is not None]
            by_issue.append(sum(known) / len(known))
        totals.append(sum(by_issue))
    found = permutation.against_orders(X, INSIDE, [np.array(every)])
    assert found.total == pytest.approx(totals[0])
    assert found.even_total == pytest.approx(np.mean(totals))
    reached = sum(t >= totals[0] - 1e-9 for t in totals)
    assert found.p_total == pytest.approx((1 + reached) / (1 + len(every)))


def test_drawn_permutations_come_close_to_all_of_them():
    exact = permutation.against_orders(X, INSIDE, [np.array([*itertools.permutations(range(7))])])
    drawn = permutation.permutation_test(X, INSIDE, np.random.default_rng(0), 4000)
    error = 4 * np.sqrt(0.25 / 4000)
    np.testing.assert_allclose(drawn.p, exact.p, atol=error)
    np.testing.assert_allclose(drawn.p_adjusted, exact.p_adjusted, atol=error)
    np.testing.assert_allclose(drawn.even_gap, exact.even_gap, atol=error)


def test_the_mean_gap_is_the_closed_form_where_everything_applies():
    x, inside = X[:6, :1], INSIDE[:6, :2]
    found = permutation.against_orders(x, inside, [np.array([*itertools.permutations(range(6))])])
    np.testing.assert_allclose(found.even_gap, chance.even_gaps(count(x, inside)))


def test_the_statistic_is_mantel_and_haenszel_s():
    tables = [np.array([[8, 3], [4, 9]]), np.array([[2, 7], [5, 5]])]
    parts = [
        Counts(*(np.array([[v]], float) for v in (t[0].sum(), t[0, 0], t[1].sum(), t[1, 0])))
        for t in tables
    ]
    expected: Any = StratifiedTable(tables).test_null_odds()
    assert permutation.studentised(parts)[0, 0] ** 2 == pytest.approx(expected.statistic)


def test_orders_stay_within_strata():
    strata = np.array([2, 0, 2, 1, 0, 0, 2])
    drawn = permutation.orders(7, 300, np.random.default_rng(1), strata)
    assert (np.sort(drawn, axis=1) == np.arange(7)).all()
    assert (strata[drawn] == strata).all()
    assert {tuple(row[[0, 2, 6]]) for row in drawn} == set(itertools.permutations([0, 2, 6]))


def test_what_a_place_explains_is_no_disparity_within_places():
    # In one place everybody meets the issue, in the other nobody; the group eats in the first.
    place = np.repeat([0, 1], 40)
    x = (place == 0).astype(float)[:, None]
    inside = np.r_[np.arange(40) < 30, np.arange(40) < 10].astype(float)[:, None]
    rng = np.random.default_rng(2)
    assert permutation.permutation_test(x, inside, rng).p_adjusted.item() < 0.01
    assert permutation.permutation_test(x, inside, rng, strata=place).p_adjusted.item() == 1.0


def test_gaps_keep_their_error_although_another_is_real():
    # The first group is refused far more often; what happens after a response is even.
    rng, windows, found = np.random.default_rng(9), 200, 0
    for _ in range(windows):
        inside = np.concatenate([np.eye(k)[rng.integers(0, k, 60)] for k in (3, 2)], axis=1)
        x = (rng.random((60, 2)) < 0.3 + 0.5 * inside[:, :1] * [1, 0]) * 1.0
        x[x[:, 0] == 1, 1] = NAN
        p = permutation.permutation_test(x, inside, rng, 199).p_adjusted
        found += bool(np.nanmin(np.r_[p[:, 1], p[3:, 0]]) <= 0.05)
    assert found <= binom.ppf(0.999, windows, 0.05)


def test_the_same_seed_gives_the_same_test():
    a, b = (
        permutation.permutation_test(X, INSIDE, np.random.default_rng(3), 199) for _ in range(2)
    )
    np.testing.assert_array_equal(a.p_adjusted, b.p_adjusted)


class TestBadWindows:
    def test_nobody_and_everybody_have_the_issue(self):
        x = np.tile([0.0, 1.0], (20, 1))
        inside = np.eye(2)[np.arange(20) % 2]
        found = permutation.permutation_test(x, inside, np.random.default_rng(0))
        assert (found.p == 1).all()
        assert (found.p_adjusted == 1).all()
        assert (found.even_gap == 0).all()

    def test_one_group_or_no_responses_are_missing(self):
        x = np.column_stack([np.ones(9), np.full(9, NAN)])
        found = permutation.permutation_test(x, np.ones((9, 1)), np.random.default_rng(0))
        for values in (found.statistic, found.p, found.p_adjusted, found.even_gap):
            assert np.isnan(values).all()
        assert np.isnan([found.total, found.even_total, found.p_total]).all()

    def test_a_lone_service(self):
        found = permutation.permutation_test(X[:1], INSIDE[:1], np.random.default_rng(0))
        assert np.isnan(found.p).all()

    @pytest.mark.parametrize(
        ("x", "inside", "message"),
        [
            (X[:3], INSIDE, "one row a service"),
            (X[:, 0], INSIDE, "one row a service"),
            (X[:0], INSIDE[:0], "no services"),
            (X * 2, INSIDE, "indicators hold other values"),
            (X, -INSIDE, "membership hold other values"),
        ],
    )
    def test_rows_that_cannot_be(self, x, inside, message):
        with pytest.raises(InputError, match=message):
            permutation.permutation_test(x, inside, np.random.default_rng(0))

    def test_too_few_permutations_and_strata_that_do_not_match(self):
        with refused("range permutations", "98"):
            permutation.permutation_test(X, INSIDE, np.random.default_rng(0), 98)
        with refused("shape strata"):
            permutation.permutation_test(X, INSIDE, np.random.default_rng(0), strata=np.zeros(3))


class TestManyWindows:
    def test_the_number_of_permutations_that_may_reach_the_statistic(self):
        # Of 199: 7/200 + sqrt(.035 · .965/200) = .048, but 8/200 + sqrt(.04 · .96/200) = .0539.
        assert windows.most_exceedances(199, 0.05) == 6
        # Of 999: .043 + .00641 = .0494, but .044 + .00649 = .0505.
        assert windows.most_exceedances(999, 0.05) == 42

    def test_too_few_permutations_for_the_level(self):
        with refused("range permutations"):
            windows.most_exceedances(19, 0.05)

    def test_it_finds_what_the_test_of_one_window_finds(self):
        rng = np.random.default_rng(5)
        inside = np.eye(3)[rng.integers(0, 3, (60, 40))]
        inside[rng.random((60, 40)) < 0.05] = NAN
        rate = 0.3 + np.nan_to_num(inside[..., :1]) * np.linspace(0, 0.7, 60)[:, None, None]
        x = (rng.random((60, 40, 2)) < rate).astype(float)
        x[..., 1][rng.random((60, 40)) < 0.2] = NAN
        found = windows.find_in_windows(x, inside, rng)
        p = [
            np.nanmin(permutation.permutation_test(a, b, rng).p_adjusted)
            for a, b in zip(x, inside, strict=True)
        ]
        clear = (np.array(p) < 0.012) | (np.array(p) > 0.11)
        assert clear.sum() > 45
        assert 10 < found.sum() < 50
        np.testing.assert_array_equal(found[clear], np.array(p)[clear] < 0.05)

    def test_one_cell_is_held_against_all(self):
        x = np.zeros((1, 40, 2))
        x[0, :20, 1] = 1
        inside = np.eye(2)[np.arange(40) // 20][None]
        rng = np.random.default_rng(6)
        answers = [windows.find_in_windows(x, inside, rng, cell=(0, k))[0] for k in (0, 1)]
        assert answers == [False, True]

    def test_empty_windows_find_nothing(self):
        x = np.full((3, 10, 2), NAN)
        assert not windows.find_in_windows(x, np.ones((3, 10, 1)), np.random.default_rng(0)).any()

    def test_a_robot_that_serves_evenly_is_seldom_found(self):
        # Responses and one issue among them, two identities; 1,500 windows of 25.
        rng = np.random.default_rng(7)
        n = 1500
        inside = np.concatenate([np.eye(k)[rng.integers(0, k, (n, 25))] for k in (3, 2)], axis=2)
        x = (rng.random((n, 25, 2)) < 0.3).astype(float)
        x[..., 1][x[..., 0] == 1] = NAN
        found = int(windows.find_in_windows(x, inside, rng, 99).sum())
        assert 0 < found <= binom.ppf(0.999, n, 0.05)

    def test_counts_of_many_windows(self):
        rng = np.random.default_rng(8)
        x = rng.choice([0.0, 1.0, NAN], (4, 30, 3))
        inside = rng.choice([0.0, 1.0, NAN], (4, 30, 5))
        for members in (inside, np.nan_to_num(inside)):
            fast, slow = windows.count_windows(x, members), count(x, members)
            for name, value in vars(slow).items():
                np.testing.assert_array_equal(getattr(fast, name), value)

    def test_too_many_issues(self):
        with refused("range issues", "11"):
            windows.count_windows(np.zeros((1, 4, 11)), np.ones((1, 4, 2)))


@pytest.mark.parametrize("p", [[0.01, 0.04, 0.03, 0.005], [0.5, 0.9], [0.2], [0.02, 0.02, 0.02]])
def test_holm_is_statsmodels(p):
    assert permutation.holm(np.array(p)) == pytest.approx(multipletests(p, method="holm")[1])


def test_holm_leaves_out_what_is_missing():
    found = permutation.holm(np.array([0.01, NAN, 0.02]))
    assert found[[0, 2]] == pytest.approx([0.02, 0.02])
    assert np.isnan(found[1])
