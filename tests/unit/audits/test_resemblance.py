"""Windows drawn from a log: their laws, and what the detector that comes with Evenhand says."""

from typing import Any

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.proportion import proportions_ztest

from evenhand.audits.count.tally import UNKNOWN, Identity, Tally
from evenhand.audits.judge import resemblance
from evenhand.methods import detector_file
from evenhand.methods.paper.scores import count

ISSUES = ("willingness", "quality", "priority", "risk")


def log(rates, services=12_000, issue_names=ISSUES, groups=("a", "b"), seed=0):
    """Synthetic services: a second identity that does not matter, rates [group, 4] of issues."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(0, (len(groups), 3), (services, 2))
    x = (rng.random((services, 4)) < np.array(rates)[codes[:, 0]]).astype(float)
    x[x[:, 0] == 1, 1:3] = np.nan  # quality and priority are said of responses only
    rows, n = np.unique(np.concatenate([codes, x], axis=1), axis=0, return_counts=True)
    return Tally(
        identities=(Identity("skill", tuple(groups)), Identity("shift", ("1", "2", "3"))),
        issues=tuple(issue_names),
        strata=("",),
        codes=rows[:, :2].astype(np.int64),
        stratum=np.zeros(len(rows), np.int64),
        x=rows[:, 2 : 2 + len(issue_names)],
        n=n,
    )


EVEN = [[0.1] * 4] * 2
UNEVEN = [[0.02, 0.05, 0.05, 0.02], [0.6, 0.5, 0.6, 0.6]]


@pytest.mark.parametrize("services", [3000, 12_000], ids=["short", "long"])
def test_unevenness_is_called_biased_and_chance_is_not(services):
    tally = log(UNEVEN, services)
    found = resemblance.ask(tally, np.random.default_rng(1), {"skill"}, 600)
    skill, shift = found
    kinds = detector_file.load(detector_file.SHIPPED).kinds
    assert (skill.identity, shift.identity) == ("skill", "shift")
    assert skill.biased > 0.9
    assert skill.biased - skill.biased_even > 0.3
    assert skill.looks_like in kinds
    assert abs(shift.biased - shift.biased_even) < 0.1
    assert shift.looks_like is None


def test_no_likeness_without_a_disparity_in_the_identity():
    found = resemblance.ask(log(UNEVEN), np.random.default_rng(1), set(), 200)
    assert found[0].biased > 0.9
    assert found[0].looks_like is None


def test_no_likeness_where_windows_are_as_even_as_by_chance():
    found = resemblance.ask(log(EVEN), np.random.default_rng(2), {"skill", "shift"}, 1000)
    assert [one.looks_like for one in found] == [None, None]
    for one in found:
        # Both shares are of 1,000 windows.
        assert abs(one.biased - one.biased_even) < 5 * (0.5 / 1000) ** 0.5


def test_scores_are_those_of_the_log_without_the_unknown():
    tally = log([*UNEVEN, [0.9] * 4], groups=("a", "b", UNKNOWN))
    rows = np.repeat(np.arange(len(tally.n)), tally.n)
    known = tally.codes[rows, 0] < 2
    x, group = tally.x[rows][known], tally.codes[rows, 0][known]
    expected = [abs(np.nanmean(x[group == 0, k]) - np.nanmean(x[group == 1, k])) for k in range(4)]
    found = resemblance.ask(tally, np.random.default_rng(3), set(), 10)
    assert found[0].scores == pytest.approx(expected)


def test_an_issue_that_the_log_does_not_tell():
    tally = log(UNEVEN, issue_names=ISSUES[:3])
    detector = detector_file.load(detector_file.SHIPPED)
    assert resemblance.ask(tally, np.random.default_rng(4), {"skill"}, 10) == ()
    assert "does not tell risk" in str(resemblance.unasked(tally, detector))
    few = log(UNEVEN, services=29)
    assert resemblance.ask(few, np.random.default_rng(4), {"skill"}, 10) == ()
    assert "windows of 30 services, and the log has 29" in str(resemblance.unasked(few, detector))
    assert resemblance.unasked(log(UNEVEN, services=30), detector) is None


def strata_log(big):
    """Four rows of two strata."""
    return Tally(
        identities=(Identity("race", ("A", "B")),),
        issues=("risk",),
        strata=("x", "y"),
        codes=np.array([[0], [1], [0], [1]]),
        stratum=np.array([1, 0, 0, 1]),
        x=np.array([[0.0], [1], [0], [1]]),
        n=np.array([5, 10, 15, 20]) * big,
    )


@pytest.mark.parametrize("big", [1, 1000], ids=["short", "long"])
def test_services_come_as_often_as_they_are_and_outcomes_stay_in_their_stratum(big):
    tally = strata_log(big)
    people, outcomes = resemblance.drawn_windows(tally, np.random.default_rng(5), 600)
    assert people.shape == outcomes.shape == (600, 30)
    assert (tally.stratum[people] == tally.stratum[outcomes]).all()
    for drawn in (people, outcomes):
        times = np.bincount(drawn.ravel(), minlength=4)
        assert stats.chisquare(times, 18_000 * tally.n / tally.n.sum()).pvalue > 1e-3
    # Who is served says nothing of what happened, within a stratum.
    own = tally.stratum[people] == 0
    table = np.zeros((2, 2))
    np.add.at(table, (tally.codes[people[own], 0], tally.x[outcomes[own], 0].astype(int)), 1)
    oracle: Any = stats.chi2_contingency(table)
    assert oracle.pvalue > 1e-3


def test_no_service_comes_twice_in_a_window():
    people, _ = resemblance.drawn_windows(strata_log(1), np.random.default_rng(6), 300)
    for row, n in enumerate([5, 10, 15, 20]):
        assert (people == row).sum(axis=1).max() <= n
    # All 30 of a log of 30 services: every window is the log.
    whole = log(UNEVEN, services=30)
    people, outcomes = resemblance.drawn_windows(whole, np.random.default_rng(7), 20)
    for drawn in (people, outcomes):
        for window in drawn:
            np.testing.assert_array_equal(np.bincount(window, minlength=len(whole.n)), whole.n)


@pytest.mark.parametrize(("biased", "even"), [(0.1, 0.08), (0.12, 0.08), (0.5, 0.44), (0.0, 0.0)])
def test_clearly_above_is_the_z_test_of_two_shares(biased, even):
    found = resemblance.clearly_above(biased, even, 1000)
    if biased == even == 0:
        assert not found
        return
    p = proportions_ztest([1000 * biased, 1000 * even], [1000] * 2, alternative="larger")[1]
    assert found == (p < 0.01)


def test_windows_are_scored_as_equation_two_says():
    # The first window by hand: scored from its own rows by the rules for whole windows.
    tally = log(UNEVEN, services=400)
    people, _ = resemblance.drawn_windows(tally, np.random.default_rng(8), 5)
    counts = count(tally.x[people], tally.inside()[people])
    skill = resemblance._scores(counts, tally)[0]
    for w in range(5):
        x, group = tally.x[people[w]], tally.codes[people[w], 0]
        gap = np.nanmean(x[group == 0, 0]) - np.nanmean(x[group == 1, 0])
        assert skill[w, 0] == pytest.approx(abs(gap))
