"""Laws of the permutation test on counts."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.statistics import count_tables


@st.composite
def logs(draw: Any) -> Any:
    """Indicators [C, 2], membership [C, 2], services and strata [C], a seed."""
    rows = draw(st.integers(1, 8))
    cells = st.sampled_from([0.0, 1.0, np.nan])
    x = draw(hnp.arrays(float, (rows, 2), elements=cells))
    inside = draw(hnp.arrays(float, (rows, 2), elements=cells))
    n = draw(hnp.arrays(int, rows, elements=st.integers(1, 40)))
    strata = draw(hnp.arrays(int, rows, elements=st.integers(0, 1)))
    return x, inside, n, strata, draw(st.integers(0, 99))


def found_in(log: Any, **changes: Any) -> Any:
    x, inside, n, strata, seed = log
    given = {"x": x, "inside": inside, "n": n, "strata": strata} | changes
    return count_tables.Table.of(**given).test(np.random.default_rng(seed), 99)


@given(
    hnp.arrays(
        np.int64,
        st.tuples(st.integers(1, 5), st.integers(1, 9)),
        elements=st.integers(0, 500) | st.integers(0, 3),
    ),
    st.integers(0, 99),
)
@settings(max_examples=100, deadline=None)
def test_drawn_tables_keep_both_margins(table, seed):
    drawn = np.stack([*count_tables.random_tables(table, 7, np.random.default_rng(seed))])
    assert drawn.shape == (*table.shape, 7)
    assert (drawn >= 0).all()
    assert (drawn.sum(axis=1) == table.sum(axis=1)[:, None]).all()
    assert (drawn.sum(axis=0) == table.sum(axis=0)[:, None]).all()


@given(logs(), st.data())
@settings(max_examples=40, deadline=None)
def test_how_a_log_is_split_into_rows_does_not_matter(log, data):
    x, inside, n, strata, _ = log
    part = np.array([data.draw(st.integers(0, int(k))) for k in n])
    order = np.array(data.draw(st.permutations(range(2 * len(n)))))
    split = {
        "x": np.concatenate([x, x])[order],
        "inside": np.concatenate([inside, inside])[order],
        "n": np.concatenate([part, n - part])[order],
        "strata": np.concatenate([strata, strata])[order],
    }
    whole, parts = found_in(log), found_in(log, **split)
    np.testing.assert_array_equal(whole.p, parts.p)
    np.testing.assert_array_equal(whole.p_adjusted, parts.p_adjusted)
    np.testing.assert_array_equal(whole.even_gap, parts.even_gap)


@given(logs())
@settings(max_examples=40, deadline=None)
def test_relabelled_groups_and_issues_keep_their_statistic(log):
    x, inside = log[:2]
    first, turned = found_in(log), found_in(log, x=x[:, ::-1], inside=inside[:, ::-1])
    np.testing.assert_allclose(turned.statistic[::-1, ::-1], first.statistic, atol=1e-12)
    np.testing.assert_allclose(turned.total, first.total)


@given(logs())
@settings(max_examples=40, deadline=None)
def test_a_group_and_the_others_mirror_each_other(log):
    inside = log[1][:, :1]
    found = found_in(log, inside=np.concatenate([inside, 1 - inside], axis=1))
    np.testing.assert_allclose(found.statistic[0], -found.statistic[1], atol=1e-12)
    np.testing.assert_array_equal(found.p[0], found.p[1])
    np.testing.assert_allclose(found.even_gap[0], found.even_gap[1])
