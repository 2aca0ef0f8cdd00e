"""Laws of Eq. 1 and 2."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.methods.paper.scores import Scores, count, own_groups_score, scores_of

NAMES = ("a", "b", "c")


@st.composite
def windows(draw: Any, categories: int | None = None, unknown: bool = True) -> Any:
    """Indicators [n, 3] with some that do not apply, and membership [n, G] of one identity."""
    n = draw(st.integers(1, 25))
    k = categories or draw(st.integers(1, 6))
    x = draw(hnp.arrays(float, (n, 3), elements=st.sampled_from([0.0, 1.0, np.nan])))
    codes = draw(hnp.arrays(int, n, elements=st.integers(-1 if unknown else 0, k - 1)))
    inside = (codes[:, None] == np.arange(k)).astype(float)
    inside[codes < 0] = np.nan
    return x, inside


def groups(inside: np.ndarray) -> list[tuple[str, str]]:
    return [("one", str(g)) for g in range(inside.shape[1])]


def scored(x: np.ndarray, inside: np.ndarray) -> Scores:
    return scores_of(count(x, inside), groups(inside), NAMES)


@given(windows())
def test_everything_lies_between_0_and_1(window):
    scores = scored(*window)
    known = scores.gap[~np.isnan(scores.gap)]
    assert ((known >= 0) & (known <= 1)).all()
    overall = scores.overall[~np.isnan(scores.overall)]
    assert ((overall >= 0) & (overall <= 1)).all()
    assert np.isnan(scores.total) or 0 <= scores.total <= len(NAMES)


@given(windows())
def test_a_gap_is_missing_exactly_if_a_side_is_empty(window):
    x, inside = window
    scores = scored(x, inside)
    for g in range(inside.shape[1]):
        for k in range(3):
            applies = ~np.isnan(x[:, k])
            sides = [(inside[applies, g] == side).any() for side in (0.0, 1.0)]
            assert np.isnan(scores.gap[g, k]) == (not all(sides))
    np.testing.assert_array_equal(scores.missing, np.isnan(scores.gap).sum(axis=0))


@given(windows(categories=2))
def test_of_two_categories_either_has_the_same_gap(window):
    gap = scored(*window).gap
    np.testing.assert_array_equal(gap[0], gap[1])


@given(windows(), st.randoms(use_true_random=False))
def test_the_order_of_services_does_not_matter(window, random):
    x, inside = window
    order = list(range(len(x)))
    random.shuffle(order)
    np.testing.assert_array_equal(scored(x, inside).gap, scored(x[order], inside[order]).gap)


@given(windows(), st.randoms(use_true_random=False))
def test_the_order_of_categories_does_not_matter(window, random):
    x, inside = window
    order = list(range(inside.shape[1]))
    random.shuffle(order)
    here, there = scored(x, inside), scored(x, inside[:, order])
    np.testing.assert_array_equal(here.gap[order], there.gap)
    np.testing.assert_allclose(here.overall, there.overall, rtol=1e-12)


@given(windows(), st.data())
def test_counts_of_parts_add_up(window, data):
    x, inside = window
    cut = data.draw(st.integers(0, len(x)))
    parts = count(x[:cut], inside[:cut]) + count(x[cut:], inside[cut:])
    whole = count(x, inside)
    for name, value in vars(whole).items():
        np.testing.assert_array_equal(getattr(parts, name), value)


@given(windows())
def test_the_same_services_twice_have_the_same_scores(window):
    x, inside = window
    twice = scored(np.concatenate([x, x]), np.concatenate([inside, inside]))
    np.testing.assert_array_equal(scored(x, inside).gap, twice.gap)


@given(windows())
def test_an_issue_and_its_absence_are_equally_uneven(window):
    x, inside = window
    np.testing.assert_allclose(scored(x, inside).gap, scored(1.0 - x, inside).gap, atol=1e-12)


@given(windows())
def test_nobody_differs_where_everybody_is_served_alike(window):
    x, inside = window
    gap = scored(np.where(np.isnan(x), np.nan, 1.0), inside).gap
    assert (np.nan_to_num(gap) == 0).all()


@given(windows(unknown=False))
def test_of_one_identity_everybody_s_own_score_is_their_group_s_gap(window):
    x, inside = window
    gap = scored(x, inside).gap
    mine = own_groups_score(gap, inside)
    np.testing.assert_array_equal(mine, gap[inside.argmax(axis=1)])
