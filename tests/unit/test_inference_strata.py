"""Differences within strata."""

import numpy as np
import pytest
from statsmodels.stats.contingency_tables import StratifiedTable
from statsmodels.stats.proportion import confint_proportions_2indep, proportion_confint

from evenhand.methods.paper.scores import Counts
from evenhand.statistics.permutation import studentised
from evenhand.statistics.strata import mantel_haenszel
from support.refusals import refused


def part(n: int, x: int, m: int, y: int) -> Counts:
    return Counts(*(np.array([[float(v)]]) for v in (n, x, m, y)))


def test_by_hand():
    """W = 20·30/50 = 12 and 10·10/20 = 5.

    Inside (12·8/20 + 5·5/10) / 17 = 7.3 / 17, as of 17² / (12²/20 + 5²/10) = 289 / 9.7 services;
    outside (12·6/30 + 5·1/10) / 17 = 2.9 / 17, as of 289 / (12²/30 + 5²/10) = 289 / 7.3.
    """
    found = mantel_haenszel([part(20, 8, 30, 6), part(10, 5, 10, 1)])
    p, q, n, m = 7.3 / 17, 2.9 / 17, 289 / 9.7, 289 / 7.3
    lp, up = proportion_confint(p * n, n, method="wilson")
    lq, uq = proportion_confint(q * m, m, method="wilson")
    assert found.difference.item() == pytest.approx(p - q)
    assert found.weight.item() == 17
    assert found.low.item() == pytest.approx(p - q - np.hypot(p - lp, uq - q))
    assert found.high.item() == pytest.approx(p - q + np.hypot(up - p, q - lq))


def test_one_stratum_has_newcombes_limits():
    found = mantel_haenszel([part(24, 0, 4345, 241)])
    low, high = confint_proportions_2indep(0, 24, 241, 4345, method="newcomb")
    assert found.low.item() == pytest.approx(low)
    assert found.high.item() == pytest.approx(high)


def test_no_cases_in_few_services_is_not_sure():
    """Two strata of 12 against 2,150, everybody at 5 %: limits cover 0 in 95 % of 4,000 logs."""
    rng = np.random.default_rng(1)
    parts = [
        Counts(
            np.full((4000, 1), 12.0),
            rng.binomial(12, 0.05, (4000, 1)).astype(float),
            np.full((4000, 1), 2150.0),
            rng.binomial(2150, 0.05, (4000, 1)).astype(float),
        )
        for _ in range(2)
    ]
    found = mantel_haenszel(parts)
    assert 0.94 <= ((found.low <= 0.0) & (found.high >= 0.0)).mean() <= 0.99


def test_simpsons_paradox_is_seen_through():
    """Graduate admissions of Berkeley 1973, the six largest departments (Bickel et al. 1975).

    Rejected men and women: 55.5 % and 69.6 % in all. Within departments women have no higher
    rate of rejection; the difference is small and the other way round.
    """
    men = [(825, 512), (560, 353), (325, 120), (417, 138), (191, 53), (373, 22)]
    women = [(108, 89), (25, 17), (593, 202), (375, 131), (393, 94), (341, 24)]
    parts = [
        part(n, n - admitted, m, m - other)
        for (n, admitted), (m, other) in zip(women, men, strict=True)
    ]
    whole = sum(parts[1:], parts[0])
    raw = whole.inside_x / whole.inside_n - whole.outside_x / whole.outside_n
    assert raw.item() == pytest.approx(0.141, abs=0.001)
    found = mantel_haenszel(parts)
    assert -0.05 < found.difference.item() < 0.0
    assert found.low.item() < found.difference.item() < found.high.item()
    # the same data by another library: Mantel and Haenszel's odds ratio is on the same side
    tables = [
        np.array([[p.inside_x.item(), (p.inside_n - p.inside_x).item()],
                  [p.outside_x.item(), (p.outside_n - p.outside_x).item()]])
        for p in parts
    ]  # fmt: skip
    assert float(StratifiedTable(tables).oddsratio_pooled) < 1.0  # type: ignore[arg-type]


def test_its_ratio_to_chance_is_the_statistic_of_the_permutation_test():
    """Σ w d = Σ (x - E): the difference and the test speak of the same thing."""
    parts = [part(20, 8, 30, 6), part(10, 5, 10, 1), part(7, 0, 3, 3)]
    found = mantel_haenszel(parts)
    chance = found.even_difference / np.sqrt(2 / np.pi)
    np.testing.assert_allclose(found.difference / chance, studentised(parts))


def test_limits_cover_a_common_difference():
    """4,000 logs of eight strata with unlike rates and a difference of 0.1: 95 % within 2.5 %."""
    rng = np.random.default_rng(0)
    rates, n, m = np.linspace(0.1, 0.6, 8), 15, 40
    parts = [
        Counts(
            np.full((4000, 1), float(n)),
            rng.binomial(n, rate + 0.1, (4000, 1)).astype(float),
            np.full((4000, 1), float(m)),
            rng.binomial(m, rate, (4000, 1)).astype(float),
        )
        for rate in rates
    ]
    found = mantel_haenszel(parts)
    covered = (found.low <= 0.1) & (found.high >= 0.1)
    assert 0.93 <= covered.mean() <= 0.975
    assert found.difference.mean() == pytest.approx(0.1, abs=0.003)


def test_a_stratum_with_one_side_says_nothing_and_none_with_both_is_missing():
    two = [part(20, 8, 30, 6), part(5, 5, 0, 0)]
    one = mantel_haenszel([part(20, 8, 30, 6)])
    for name in ("difference", "low", "high", "even_difference"):
        assert getattr(mantel_haenszel(two), name) == getattr(one, name)
    alone = mantel_haenszel([part(5, 5, 0, 0), part(0, 0, 3, 1)])
    assert np.isnan([alone.difference, alone.low, alone.high, alone.even_difference]).all()


def test_what_cannot_be_is_refused():
    with refused("range level", "1"):
        mantel_haenszel([part(2, 1, 2, 1)], 1.0)
    with refused("range counts"):
        mantel_haenszel([part(2, 3, 2, 1)])
