"""Krippendorff's alpha against published numbers, hand calculations and a slow oracle."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.core.errors import InputError
from evenhand.study.analysis import agreement

# Four observers, twelve units (Krippendorff, Computing Krippendorff's Alpha-Reliability, 2011,
# section C; the example of R's irr::kripp.alpha), one row a unit, None where nobody answered.
NO = None
PUBLISHED = [
    (1, 1, NO, 1),
    (2, 2, 3, 2),
    (3, 3, 3, 3),
    (3, 3, 3, 3),
    (2, 2, 2, 2),
    (1, 2, 3, 4),
    (4, 4, 4, 4),
    (1, 1, 2, 1),
    (2, 2, 2, 2),
    (NO, 5, 5, 5),
    (NO, NO, 1, 1),
    (NO, NO, 3, NO),
]


def counts_of(rows, values):
    return np.array([[row.count(value) for value in values] for row in rows])


def slow_alpha(rows, level, values):
    """Alpha from every ordered pair of answers, as it is defined."""
    units = [[a for a in row if a is not None] for row in rows]
    units = [unit for unit in units if len(unit) > 1]
    pooled = [a for unit in units for a in unit]
    if not pooled:
        return math.nan
    often = {value: pooled.count(value) for value in values}

    def difference(a, b):
        if level == "nominal":
            return float(a != b)
        if level == "interval":
            return float(a - b) ** 2
        low, high = sorted((values.index(a), values.index(b)))
        between = sum(often[value] for value in values[low : high + 1])
        return (between - (often[a] + often[b]) / 2) ** 2

    observed = sum(
        difference(a, b) / (len(unit) - 1) for unit in units for a, b in permutations(unit, 2)
    ) / len(pooled)
    expected = sum(difference(a, b) for a, b in permutations(pooled, 2)) / (
        len(pooled) * (len(pooled) - 1)
    )
    return 1 - observed / expected if expected else math.nan


@pytest.mark.parametrize(
    ("level", "published"), [("nominal", 0.743), ("ordinal", 0.815), ("interval", 0.849)]
)
def test_the_published_example(level, published):
    values = [1, 2, 3, 4, 5]
    found = agreement.alpha(counts_of(PUBLISHED, values), level, values)
    assert found == pytest.approx(published, abs=5e-4)


def test_two_observers_two_values_by_hand():
    # The same source, section A: ten units, (0, 0) five times, (1, 1) once, 4 differ. Coincidences
    # o_00 = 10, o_01 = o_10 = 4, o_11 = 2, n = 20: alpha = 1 - 19 * 4 / (14 * 6) = 0.095.
    counts = [[2, 0]] * 5 + [[1, 1]] * 4 + [[0, 2]]
    assert agreement.alpha(counts, "nominal") == pytest.approx(1 - 76 / 84)
    assert agreement.alpha(counts, "nominal") == pytest.approx(0.095, abs=5e-4)


def test_disagreement_beyond_chance_is_below_zero():
    # two units, each (0, 1): D_o = 1, D_e = 2 * 2 * 2 / (4 * 3) = 2/3, alpha = 1 - 3/2
    assert agreement.alpha([[1, 1], [1, 1]], "nominal") == pytest.approx(-0.5)


def test_complete_agreement_is_one_and_one_value_says_nothing():
    assert agreement.alpha([[3, 0], [0, 3]], "ordinal") == 1.0
    assert np.isnan(agreement.alpha([[3, 0], [2, 0]], "nominal"))
    assert np.isnan(agreement.alpha([[1, 0], [0, 1]], "nominal"))


rows_of_answers = st.lists(
    st.lists(st.sampled_from([None, 1, 2, 4]), min_size=2, max_size=5), min_size=1, max_size=6
)


@given(rows=rows_of_answers, level=st.sampled_from(agreement.LEVELS))
def test_counts_give_what_pairs_give(rows, level):
    values = [1, 2, 4]
    found = float(agreement.alpha(counts_of(rows, values), level, values))
    assert found == pytest.approx(slow_alpha(rows, level, values), abs=1e-12, nan_ok=True)


@given(rows=rows_of_answers, level=st.sampled_from(agreement.LEVELS), seed=st.integers(0, 9))
def test_neither_order_of_units_nor_unpaired_answers_matter(rows, level, seed):
    values = [1, 2, 4]
    counts = counts_of(rows, values)
    shuffled = np.random.default_rng(seed).permutation(counts)
    alone = np.concatenate([shuffled, [[0, 1, 0], [0, 0, 0]]])
    expected = float(agreement.alpha(counts, level, values))
    assert float(agreement.alpha(alone, level, values)) == pytest.approx(expected, nan_ok=True)


@given(rows=rows_of_answers, shift=st.floats(-3, 3), scale=st.floats(0.5, 4))
def test_an_interval_scale_has_no_zero_and_no_unit(rows, shift, scale):
    counts = counts_of(rows, [1, 2, 4])
    plain = float(agreement.alpha(counts, "interval", [1, 2, 4]))
    moved = float(agreement.alpha(counts, "interval", shift + scale * np.array([1.0, 2, 4])))
    assert moved == pytest.approx(plain, abs=1e-6, nan_ok=True)


def test_the_interval_is_the_one_of_another_program():
    # R's irr with boot, 1,000 samples of units, percentile: (0.4297, 1.0000) for the published
    # example at the ordinal level. Two programs differ by their random numbers alone.
    values = [1, 2, 3, 4, 5]
    found = agreement.agreement(
        counts_of(PUBLISHED, values), "ordinal", np.random.default_rng(0), values, bootstraps=4000
    )
    assert found.alpha == pytest.approx(0.815, abs=5e-4)
    assert found.low == pytest.approx(0.43, abs=0.06)
    assert found.high == pytest.approx(1.0, abs=0.005)
    assert (found.units, found.answers) == (11, 40)


def test_the_same_seed_gives_the_same_interval():
    counts = counts_of(PUBLISHED, [1, 2, 3, 4, 5])
    one, two = (agreement.agreement(counts, "nominal", np.random.default_rng(3)) for _ in range(2))
    assert one == two


def test_one_unit_has_no_interval():
    found = agreement.agreement([[2, 1]], "nominal", np.random.default_rng(0))
    assert not math.isnan(found.alpha)
    assert math.isnan(found.low)
    assert math.isnan(found.high)


def test_nothing_to_agree_on_is_missing_not_zero():
    found = agreement.agreement([[1, 0], [0, 0]], "nominal", np.random.default_rng(0))
    assert (found.units, found.answers, found.bootstraps) == (0, 0, 0)
    assert math.isnan(found.alpha)


def test_answers_one_by_one_are_counted():
    units, codes = np.array([0, 0, 1, 1, -1, 2]), np.array([1, 1, 0, -1, 0, 2])
    expected = [[0, 2, 0], [1, 0, 0], [0, 0, 1]]
    assert agreement.counted(units, codes, 3, 3).tolist() == expected


@pytest.mark.parametrize(
    ("counts", "level", "values", "complaint"),
    [
        ([[1, -1]], "nominal", None, "whole numbers of at least 0"),
        ([[1.5, 1]], "nominal", None, "whole numbers of at least 0"),
        ([1, 2], "nominal", None, "one row a unit"),
        ([[1, 2]], "ordnal", None, "did you mean 'ordinal'"),
        ([[1, 2]], "interval", [1, 2, 3], "3 values for 2 columns"),
    ],
)
def test_what_is_no_table_of_counts_is_refused(counts, level, values, complaint):
    with pytest.raises(InputError, match=complaint):
        agreement.alpha(counts, level, values)
