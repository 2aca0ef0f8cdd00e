"""Laws of credit."""

from typing import Any

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.methods import pooling
from evenhand.methods.beyond import gaps, levelup
from evenhand.methods.beyond import influence as credit
from evenhand.methods.beyond.influence import CreditSettings
from evenhand.methods.paper import scores as paper_scores
from evenhand.methods.paper.scores import count

TAU = np.array([1.0, 0.5, 2.0])


@st.composite
def epochs(draw: Any) -> Any:
    """Indicators [n, 3] with some that do not apply, membership [n, G] and pooled counts."""
    n = draw(st.integers(1, 12))
    k = draw(st.integers(1, 4))
    elements = st.sampled_from([0.0, 1.0, np.nan])
    x = draw(hnp.arrays(float, (n, 3), elements=elements))
    inside = draw(hnp.arrays(float, (n, k), elements=elements))
    more = draw(st.integers(0, 12))
    earlier = draw(hnp.arrays(float, (more, 3), elements=elements))
    who = draw(hnp.arrays(float, (more, k), elements=elements))
    return x, inside, count(x, inside) + count(earlier, who)


def settings() -> st.SearchStrategy[CreditSettings]:
    return st.builds(
        CreditSettings,
        strength=st.floats(0.0, 5.0),
        shrink=st.floats(0.0, 3.0),
        objective=st.sampled_from(["gap", "squared"]),
    )


@given(epochs(), settings())
def test_everything_is_finite(epoch, chosen):
    x, inside, pool = epoch
    found = credit.influence(x, inside, TAU, pool, chosen)
    for numbers in (found.gap, found.issue, found.total):
        assert np.isfinite(numbers).all()
    np.testing.assert_array_equal(np.isnan(found.push), np.isnan(paper_scores.gaps(pool)))
    for function in (credit.influence_reward, levelup.levelup_reward):
        assert np.isfinite(function(x, inside, TAU, pool, chosen)).all()


@given(epochs(), settings())
def test_the_weights_of_an_epoch_sum_to_zero(epoch, chosen):
    # all services made more likely alike is no change of any rate
    x, inside, _ = epoch
    found = credit.influence(x, inside, TAU, None, chosen)
    np.testing.assert_allclose(found.gap.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(found.total.sum(), 0.0, atol=1e-12)


@given(epochs(), settings())
def test_what_does_not_apply_gets_no_weight(epoch, chosen):
    x, inside, pool = epoch
    found = credit.influence(x, inside, TAU, pool, chosen)
    assert (found.issue[np.isnan(x)] == 0).all()
    unknown = np.isnan(inside)
    assert (found.gap[unknown] == 0).all()


@given(epochs(), settings(), st.data())
def test_no_service_is_paid_for_an_issue(epoch, chosen, data):
    """Rates held: another issue never raises the reward, nor does escaping it by no response."""
    x, inside, pool = epoch
    i = data.draw(st.integers(0, len(x) - 1))
    k = data.draw(st.integers(0, 2))
    with_all = np.where(np.isnan(x), 1.0, x)
    # counts that hold the services whatever happens to this one
    pool = pool + count(np.ones_like(with_all), inside)
    none, issue, escaped = x.copy(), x.copy(), x.copy()
    none[i, k], issue[i, k], escaped[i, k] = 0.0, 1.0, np.nan
    for function in (credit.influence_reward, levelup.levelup_reward):
        best, worst, away = (
            function(each, inside, TAU, pool, chosen)[i] for each in (none, issue, escaped)
        )
        assert worst <= best + 1e-12
        np.testing.assert_allclose(away, worst, atol=1e-12)


@given(epochs(), settings())
def test_levelup_never_pays_and_never_charges_the_better_off(epoch, chosen):
    x, inside, pool = epoch
    reward = levelup.levelup_reward(x, inside, TAU, pool, chosen)
    assert (reward <= 0).all()
    worse = np.nan_to_num(inside) @ (np.nan_to_num(paper_scores.signed_gaps(pool)) > 0)
    assert (reward[(worse == 0).all(axis=1)] == 0).all()


@given(epochs(), settings())
def test_rewards_grow_with_the_strength(epoch, chosen):
    x, inside, pool = epoch
    one = CreditSettings(strength=1.0, shrink=chosen.shrink, objective=chosen.objective)
    for function in (credit.influence_reward, levelup.levelup_reward):
        np.testing.assert_allclose(
            function(x, inside, TAU, pool, chosen),
            chosen.strength * function(x, inside, TAU, pool, one),
            atol=1e-12,
        )


@given(epochs(), st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_more_shrinking_leaves_less(epoch, a, b):
    _, _, pool = epoch
    little, much = (gaps.beyond_noise(pool, c) for c in sorted((a, b)))
    known = ~np.isnan(little)
    assert ((much[known] >= 0) & (much[known] <= little[known]) & (little[known] <= 1)).all()


@given(epochs(), settings(), st.randoms(use_true_random=False))
def test_the_order_of_services_does_not_matter(epoch, chosen, random):
    x, inside, pool = epoch
    order = list(range(len(x)))
    random.shuffle(order)
    here = credit.influence(x, inside, TAU, pool, chosen).total[order]
    there = credit.influence(x[order], inside[order], TAU, pool, chosen).total
    np.testing.assert_allclose(here, there, atol=1e-12)


@given(st.lists(epochs(), min_size=1, max_size=6), st.integers(1, 4))
def test_pooling_adds_up_the_last_windows(several, windows):
    counts = [count(x, inside[:, :1]) for x, inside, _ in several]
    assume(all(c.inside_n.shape == (1, 3) for c in counts))
    memory = pooling.Pool.empty(windows, 1, 3)
    for c in counts:
        memory = pooling.remember(memory, c)
    pool = pooling.pooled(memory)
    last = counts[-windows:]
    for name in ("inside_n", "inside_x", "outside_n", "outside_x"):
        np.testing.assert_array_equal(getattr(pool, name), sum(getattr(c, name) for c in last))
    assert memory.filled == len(last)
