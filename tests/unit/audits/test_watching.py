"""The alarm of a watched log: what it promises, what it finds, and what it keeps."""

from dataclasses import replace

import numpy as np
import pytest

from evenhand.audits.count.tally import Identity, Tally
from evenhand.audits.watch import alarm
from evenhand.audits.watch.alarm import WatchSettings, begin, take
from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import count, signed_gaps
from evenhand.statistics import sequential
from support.refusals import refused

ISSUES = ("willingness", "risk")


def tally(
    codes: np.ndarray, x: np.ndarray, batch: int, groups: tuple[str, ...] = ("a", "b")
) -> Tally:
    """Services in order, each row one; every ``batch`` of them is a stratum."""
    strata = np.arange(len(codes)) // batch
    return Tally(
        (Identity("kind", groups),),
        ISSUES,
        tuple(str(i) for i in range(strata.max() + 1)),
        codes[:, None],
        strata,
        x,
        np.ones(len(codes), np.int64),
    )


def served(rng: np.random.Generator, n: int, rate_a: float, rate_b: float) -> tuple:
    codes = rng.integers(0, 2, n)
    rate = np.where(codes == 0, rate_a, rate_b)
    x = np.stack([rng.random(n) < rate, rng.random(n) < 0.1], axis=1).astype(float)
    return codes, x


def test_wealth_by_hand():
    """Batches of 4, half of them a: gaps of a are 1/2 - 0, then 0 - 1/2; b's are the negatives.

    The first bet is 0. Then z = 0.5, λ = -(2 / (2 - ln 3)) · 0.5 / 1.25 clipped at -1/2, and the
    second gap of -0.5 makes 1 - (-1/2)(-1/2) = 0.75 of the wealth.
    """
    codes = np.array([0, 0, 1, 1, 0, 0, 1, 1])
    x = np.zeros((8, 2))
    x[0, 0] = x[7, 0] = 1.0
    state = take(begin(WatchSettings(batch=4), ISSUES), tally(codes, x, 4))
    assert state.groups == (("kind", "a"), ("kind", "b"))
    np.testing.assert_allclose(np.exp(state.wealth.log_wealth), [[0.75, 1.0], [0.75, 1.0]])
    assert state.services == 8
    assert state.raised == ()


def test_batches_may_come_at_once_or_one_by_one():
    rng = np.random.default_rng(0)
    codes, x = served(rng, 600, 0.6, 0.1)
    settings = WatchSettings(batch=30)
    at_once = take(begin(settings, ISSUES), tally(codes, x, 30))
    bit_by_bit = begin(settings, ISSUES)
    for first in range(0, 600, 90):
        rows = slice(first, first + 90)
        bit_by_bit = take(bit_by_bit, tally(codes[rows], x[rows], 30))
    np.testing.assert_array_equal(at_once.wealth.log_wealth, bit_by_bit.wealth.log_wealth)
    assert at_once.raised == bit_by_bit.raised


def test_strata_are_taken_by_number():
    """Ten batches and more: "10" comes after "9", not after "1"."""
    rng = np.random.default_rng(1)
    codes, x = served(rng, 360, 0.5, 0.2)
    good = tally(codes, x, 30)
    order = np.argsort(good.strata)
    place = np.argsort(order)
    mixed = replace(good, strata=tuple(np.array(good.strata)[order]), stratum=place[good.stratum])
    a, b = (take(begin(WatchSettings(), ISSUES), one) for one in (good, mixed))
    np.testing.assert_array_equal(a.wealth.log_wealth, b.wealth.log_wealth)


def test_a_disparity_is_named_with_its_gap():
    rng = np.random.default_rng(2)
    codes, x = served(rng, 3000, 0.5, 0.2)
    state = take(begin(WatchSettings(), ISSUES), tally(codes, x, 30))
    named = {(one.group, one.issue) for one in state.raised}
    assert ("a", "willingness") in named
    assert ("a", "risk") not in named
    first = next(one for one in state.raised if one.group == "a")
    seen = slice(0, first.services)
    rates = [x[seen][codes[seen] == k, 0].mean() for k in (0, 1)]
    assert first.gap == pytest.approx(rates[0] - rates[1])
    assert first.evidence >= 1.0
    assert len(state.raised) == len({(one.group, one.issue) for one in state.raised})


def test_a_group_that_turns_up_later_begins_then():
    rng = np.random.default_rng(3)
    codes, x = served(rng, 300, 0.3, 0.3)
    state = take(begin(WatchSettings(), ISSUES), tally(codes, x, 30))
    before = state.wealth.log_wealth.copy()
    third = rng.integers(0, 3, 300)
    later = take(state, tally(third, x, 30, ("a", "b", "new")))
    assert later.groups[-1] == ("kind", "new")
    fresh = sequential.start(1, 2)
    inside = (third == 2).astype(float)[:, None]
    for gap in signed_gaps(count(x.reshape(10, 30, 2), inside.reshape(10, 30, 1))):
        fresh = sequential.bet(fresh, gap)
    np.testing.assert_allclose(later.wealth.log_wealth[-1:], fresh.log_wealth)
    assert not np.array_equal(later.wealth.log_wealth[:2], before)


def test_a_late_group_is_held_against_all_services_so_far():
    """Batches of 4: aaaa, of whom two have the issue; then aabb, of whom both b have it."""
    codes = np.array([0, 0, 0, 0, 0, 0, 1, 1])
    x = np.zeros((8, 2))
    x[[0, 1, 6, 7], 0] = 1.0
    state = take(begin(WatchSettings(batch=4), ISSUES), tally(codes, x, 4))
    assert state.groups == (("kind", "a"), ("kind", "b"))
    sums = state.counts
    told = (sums.inside_x, sums.inside_n, sums.outside_x, sums.outside_n)
    assert [one[:, 0].tolist() for one in told] == [[2, 2], [6, 2], [2, 2], [2, 6]]


def test_groups_beyond_what_was_set_aside_are_named_not_watched():
    codes = np.tile([0, 1, 2], 10)
    state = begin(WatchSettings(most_groups=2), ISSUES)
    state = take(state, tally(codes, np.zeros((30, 2)), 30, ("a", "b", "c")))
    assert state.groups == (("kind", "a"), ("kind", "b"))
    assert state.left_out == (("kind", "c"),)


@pytest.mark.slow
def test_an_even_log_raises_hardly_any_alarm_however_long_one_looks():
    """150 even logs of 3,000 services, looked at after every batch, at alpha 20 %.

    With a true chance of 20 % at most 43 alarms come up in 99.5 % of such tests.
    """
    rng = np.random.default_rng(4)
    alarms = 0
    for _ in range(150):
        codes, x = served(rng, 3000, 0.3, 0.3)
        settings = WatchSettings(alpha=0.2, batch=60, most_groups=2)
        alarms += bool(take(begin(settings, ISSUES), tally(codes, x, 60)).raised)
    assert alarms <= 43


def test_all_together_adds_up_weak_evidence():
    """Wealth of all streams that are not seen yet counts as 1."""
    state = begin(WatchSettings(alpha=0.1, most_groups=3), ISSUES)
    assert alarm.together_evidence(state) == pytest.approx(0.05)
    wealth = replace(sequential.start(1, 2), log_wealth=np.log([[40.0, 16.0]]))
    # (40 + 16 + 4 · 1) / 6 = 10 of the 20 that alpha / 2 asks for
    assert alarm.together_evidence(state, wealth) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"alpha": 0.0}, "alpha is 0.0"),
        ({"batch": 1}, "batch is 1: give a whole number from 2"),
        ({"most_groups": 1}, "most_groups is 1"),
    ],
)
def test_settings_out_of_range_are_refused(settings, said):
    with pytest.raises(InputError, match=said):
        WatchSettings(**settings)


def test_a_batch_that_is_not_full_and_other_issues_are_refused():
    state = begin(WatchSettings(batch=30), ISSUES)
    with refused("shape batch", "20", "30"):
        take(state, tally(np.zeros(20, np.int64), np.zeros((20, 2)), 30))
    with refused("changed log"):
        take(begin(WatchSettings(), ("quality",)), tally(np.zeros(30, int), np.zeros((30, 2)), 30))
