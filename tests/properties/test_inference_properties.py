"""Laws of the statistics."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.methods.paper import scores as paper_scores
from evenhand.methods.paper.scores import Counts
from evenhand.statistics import (
    chance,
    intervals,
    permutation,
    sequential,
    verdicts,
)


@st.composite
def drawn_windows(draw: Any) -> Any:
    """Indicators [n, 2] with some that do not apply, and membership [n, G] with some unknown."""
    n = draw(st.integers(1, 25))
    g = draw(st.integers(1, 4))
    cells = st.sampled_from([0.0, 1.0, np.nan])
    x = draw(hnp.arrays(float, (n, 2), elements=cells))
    return x, draw(hnp.arrays(float, (n, g), elements=cells))


def swapped(counts: Counts) -> Counts:
    return Counts(counts.outside_n, counts.outside_x, counts.inside_n, counts.inside_x)


def opposite(counts: Counts) -> Counts:
    """The same services, counting those without the issue."""
    return Counts(
        counts.inside_n,
        counts.inside_n - counts.inside_x,
        counts.outside_n,
        counts.outside_n - counts.outside_x,
    )


LIMITS = (intervals.wilson, intervals.clopper_pearson)
SIZES = (
    chance.squared_gap,
    chance.even_gaps,
    chance.standard_error,
    verdicts.needed_side,
)
SIGNED = (
    paper_scores.signed_gaps,
    lambda c: permutation.studentised([c]),
)


@given(drawn_windows())
def test_a_group_and_its_complement_say_the_same(window):
    counts = paper_scores.count(*window)
    for law in SIZES:
        np.testing.assert_allclose(law(counts), law(swapped(counts)), atol=1e-9)
    for law in SIGNED:
        np.testing.assert_allclose(law(counts), -law(swapped(counts)), atol=1e-9)
    (low, high), (low_, high_) = intervals.newcombe(counts), intervals.newcombe(swapped(counts))
    np.testing.assert_allclose(low, -high_, atol=1e-9)
    np.testing.assert_allclose(high, -low_, atol=1e-9)


@given(drawn_windows())
def test_an_issue_and_its_absence_say_the_same(window):
    counts = paper_scores.count(*window)
    for law in SIZES[:-1]:
        np.testing.assert_allclose(law(counts), law(opposite(counts)), atol=1e-9)
    for law in SIGNED:
        np.testing.assert_allclose(law(counts), -law(opposite(counts)), atol=1e-9)


@given(drawn_windows(), st.floats(0.01, 0.999), st.sampled_from(LIMITS))
def test_an_interval_holds_its_gap_and_stays_within_1(window, level, limits):
    counts = paper_scores.count(*window)
    low, high = intervals.newcombe(counts, level, limits)
    gap = paper_scores.signed_gaps(counts)
    known = ~np.isnan(gap)
    np.testing.assert_array_equal(known, ~np.isnan(low))
    assert (low[known] <= gap[known] + 1e-12).all()
    assert (gap[known] <= high[known] + 1e-12).all()
    assert (low[known] >= -1 - 1e-12).all()
    assert (high[known] <= 1 + 1e-12).all()


@given(drawn_windows(), st.randoms(use_true_random=False))
def test_the_order_of_services_does_not_matter(window, random):
    x, inside = window
    order = list(range(len(x)))
    random.shuffle(order)
    here, there = (
        permutation.studentised([paper_scores.count(*rows)])
        for rows in ((x, inside), (x[order], inside[order]))
    )
    np.testing.assert_array_equal(here, there)


@settings(max_examples=40)
@given(drawn_windows(), st.integers(0, 9))
def test_what_a_permutation_test_may_say(window, seed):
    x, inside = window
    found = permutation.permutation_test(x, inside, np.random.default_rng(seed), 99)
    missing = np.isnan(paper_scores.gaps(paper_scores.count(x, inside)))
    for values in (found.statistic, found.p, found.p_adjusted):
        np.testing.assert_array_equal(np.isnan(values), missing)
    p, adjusted = found.p[~missing], found.p_adjusted[~missing]
    assert ((p >= 1 / 100) & (p <= 1)).all()
    assert (adjusted >= p).all()
    assert (found.p_settled[~missing] >= adjusted).all()
    order = np.argsort(-np.abs(found.statistic[~missing]), kind="stable")
    assert (np.diff(adjusted[order]) >= 0).all()


@settings(max_examples=40)
@given(drawn_windows(), st.integers(0, 9))
def test_a_verdict_is_always_one_of_three_and_knows_what_would_be_enough(window, seed):
    rng = np.random.default_rng(seed)
    x, inside = window
    found = verdicts.judge(x, inside, rng, verdicts.VerdictSettings(permutations=99))
    assert np.isin(found.verdict, verdicts.VERDICTS).all()
    assert np.isfinite(found.needed_side).all()
    side = np.minimum(found.counts.inside_n, found.counts.outside_n)
    assert (found.verdict[side == 0] == verdicts.INSUFFICIENT).all()
    assert not (found.verdict[side < found.needed_side] == verdicts.NO_EVIDENCE).any()


@given(hnp.arrays(float, (12, 2), elements=st.one_of(st.floats(-1, 1), st.just(np.nan))))
def test_wealth_stays_positive_and_the_bet_within_a_half(gaps):
    path, now = sequential.watch(gaps)
    assert np.isfinite(path).all()
    assert (np.abs(now.bet) <= 0.5).all()
    np.testing.assert_array_equal(now.steps, (~np.isnan(gaps)).sum(axis=0))


@given(hnp.arrays(float, (6,), elements=st.floats(-1, 1)), st.floats(0, 1))
def test_a_fair_bet_gains_nothing_on_average(gaps, size):
    # Whatever came before, a gap of ±size with equal chance leaves the mean wealth as it was.
    _, now = sequential.watch(gaps)
    up, down = (sequential.bet(now, np.array(s * size)).log_wealth for s in (1, -1))
    np.testing.assert_allclose((np.exp(up) + np.exp(down)) / 2, np.exp(now.log_wealth))
