"""The aims of the comparison, each by hand: on which side of it a number lies, and what is told."""

from __future__ import annotations

from math import isnan, nan

import pytest

from evenhand.experiments.comparison import aims, settings
from evenhand.experiments.comparison.aims import MISSED, REACHED, UNKNOWN
from evenhand.statistics.means import Estimate

HOLDS = "not settled: the interval holds 80\xa0%"


def of(mean: float, low: float = nan, high: float = nan, n: int = 10) -> Estimate:
    return Estimate(mean, low, high, n)


def test_the_eight_scenarios_are_those_that_there_are() -> None:
    assert aims.EIGHT == settings.SCENARIOS
    assert {*aims.SCARCE} <= {*aims.EIGHT}


# --- corrected total ---


@pytest.mark.parametrize(
    ("share", "totals", "state", "said"),
    [
        # service 0.5, reference 0: 0.40 lower of 0.50 is 80 %, and 80 % lower
        (of(0.80, 0.8, 0.9), (0.5, 0.10, 0.0), REACHED, ["80.0\xa0% lower"]),
        (of(0.79, 0.7, 0.79), (0.5, 0.105, 0.0), MISSED, ["79.0\xa0% lower"]),
        (of(0.85, 0.76, 0.9), (0.5, 0.075, 0.0), REACHED, [HOLDS]),
        # the lower end has to be 75 %
        (of(0.85, 0.74, 0.9), (0.5, 0.075, 0.0), MISSED, [HOLDS]),
        (of(0.75, 0.7, 0.9), (0.5, 0.125, 0.0), MISSED, [HOLDS]),
        # attainable is 1 - 0.6 / 1 = 40 %, so 34 % lower is enough
        (of(0.85, 0.81, 0.9), (1.0, 0.66, 0.6), REACHED, ["34.0\xa0% lower", "40.0\xa0% at most"]),
        # attainable is 50 %: half has to be reached, and 85 % of it is 42.5 % lower
        (of(0.85, 0.81, 0.9), (1.0, 0.575, 0.5), MISSED, ["42.5\xa0% lower"]),
        (of(1.0, 0.9, 1.1), (1.0, 0.5, 0.5), REACHED, ["50.0\xa0% lower"]),
        # more uneven than before
        (of(-0.2, -0.3, -0.1), (0.5, 0.6, 0.0), MISSED, ["20.0\xa0% higher"]),
    ],
)  # fmt: skip
def test_evenness(share, totals, state, said) -> None:
    verdict = aims.evenness(share, *totals)
    assert verdict.state == state
    assert verdict.number is share
    for words in said:
        assert words in verdict.why
    assert ("not settled" in verdict.why) == any("not settled" in words for words in said)


@pytest.mark.parametrize(
    ("share", "totals", "why"),
    [
        (of(nan), (0.1, 0.05, 0.1), "nothing to attain"),
        (of(nan), (0.1, 0.05, 0.2), "nothing to attain"),
        (of(nan), (0.5, nan, 0.1), "a number is missing"),
        (of(0.9), (0.5, 0.1, nan), "a number is missing"),
        (of(0.9, n=1), (0.5, 0.05, 0.0), "one seed has no interval"),
        (of(0.9, n=10), (0.5, 0.05, 0.0), "chance alone may be all"),
    ],
)
def test_evenness_that_cannot_be_told(share, totals, why) -> None:
    verdict = aims.evenness(share, *totals)
    assert verdict.state == UNKNOWN
    assert why in verdict.why


def test_half_is_no_aim_where_service_alone_is_below_chance() -> None:
    # from -0.01 to -0.02: a share is defined, a reduction in per cent is not
    verdict = aims.evenness(of(0.9, 0.85, 0.95), -0.01, -0.019, -0.02)
    assert (verdict.state, verdict.why) == (REACHED, "")


# --- service ---


@pytest.mark.parametrize(
    ("difference", "state", "why"),
    [
        (of(0.002, -0.009, 0.01), REACHED, ""),
        (of(-0.005, -0.0099, 0.0), REACHED, ""),
        (of(-0.005, -0.01, 0.0), UNKNOWN, "the interval goes below"),
        (of(0.003, -0.02, 0.03), UNKNOWN, "the interval goes below"),
        (of(-0.01, -0.02, 0.0), MISSED, "not settled"),
        (of(-0.03, -0.04, -0.02), MISSED, ""),
        (of(0.05, n=1), UNKNOWN, "one seed"),
        (of(nan), UNKNOWN, "missing"),
    ],
)
def test_perfect_services_are_not_fewer(difference, state, why) -> None:
    verdict = aims.perfect(difference)
    assert verdict.state == state
    assert why in verdict.why
    assert bool(verdict.why) == bool(why)


# --- against a cost without groups ---


@pytest.mark.parametrize(
    ("difference", "perfect", "scarce", "state", "why"),
    [
        (of(0.0, -0.01, 0.01), of(0.0), False, REACHED, ""),
        (of(-0.05, -0.06, -0.04), of(0.0), False, REACHED, ""),
        (of(0.01, 0.001, 0.015), of(0.0), False, MISSED, "less even"),
        (of(0.01, -0.01, 0.03), of(0.0), False, UNKNOWN, "goes above 0.02"),
        (of(-0.05, -0.06, -0.04), of(0.0), True, REACHED, ""),
        (of(-0.05, -0.06, -0.04), of(-0.009), True, REACHED, ""),
        (of(-0.05, -0.06, -0.04), of(-0.03), True, MISSED, "3.0\xa0% fewer"),
        (of(-0.05, -0.12, 0.01), of(0.0), True, MISSED, "may do as well"),
        (of(0.05, 0.04, 0.06), of(0.0), True, MISSED, "less even"),
        (of(-0.05, n=1), of(0.0), True, UNKNOWN, "one seed"),
        (of(nan), of(0.0), True, UNKNOWN, "blind was not run"),
        (of(-0.05, -0.06, -0.04), of(nan), True, UNKNOWN, "missing"),
    ],
)
def test_against_blind(difference, perfect, scarce, state, why) -> None:
    verdict = aims.against_blind(difference, perfect, scarce)
    assert verdict.state == state
    assert verdict.number is difference
    assert why in verdict.why
    assert bool(verdict.why) == bool(why)


# --- biased epochs ---


@pytest.mark.parametrize(
    ("service", "found", "state", "fewer"),
    [
        (60.0, 6.0, REACHED, 0.9),
        (60.0, 6.5, MISSED, 53.5 / 60),
        (60.0, 0.0, REACHED, 1.0),
        (60.0, 75.0, MISSED, -0.25),
        (0.0, 0.0, UNKNOWN, nan),
        (nan, 3.0, UNKNOWN, nan),
        (60.0, nan, UNKNOWN, nan),
    ],
)
def test_biased_epochs(service, found, state, fewer) -> None:
    verdict = aims.biased(of(service), of(found))
    assert verdict.state == state
    assert verdict.number.mean == pytest.approx(fewer, nan_ok=True)
    assert isnan(verdict.number.low)


def test_biased_epochs_of_one_seed_cannot_be_told() -> None:
    verdict = aims.biased(of(60.0), of(1.0, n=1))
    assert verdict.state == UNKNOWN
    assert verdict.number.mean == pytest.approx(59 / 60)
    assert verdict.why == "60.0 with service alone, 1.0 with this; one seed has no interval"


# --- hypervolume ---


def test_hypervolume_is_that_of_every_rival_at_least() -> None:
    rivals = {"A": of(0.5, 0.45, 0.55), "B": of(0.7, 0.65, 0.75)}
    more = aims.hypervolume(of(0.8, 0.78, 0.82), rivals)
    assert (more.state, more.why) == (REACHED, "best rival B 0.700")
    equal = aims.hypervolume(of(0.7, 0.6, 0.8), rivals)
    assert (equal.state, equal.why) == (REACHED, "best rival B 0.700; intervals overlap")
    # 0.700 as shown, and yet less
    nearly = aims.hypervolume(of(0.6996, 0.6, 0.8), rivals)
    assert (nearly.state, nearly.why) == (
        MISSED, "best rival B 0.700, higher by 0.0004; intervals overlap",
    )  # fmt: skip
    less = aims.hypervolume(of(0.6, 0.58, 0.64), rivals)
    assert (less.state, less.why) == (MISSED, "best rival B 0.700")


def test_a_missing_rival_matters_only_where_the_others_are_beaten() -> None:
    rivals = {"A": of(0.5, 0.4, 0.6), "B": of(nan, n=0)}
    assert aims.hypervolume(of(0.8, 0.7, 0.9), rivals).state == UNKNOWN
    assert aims.hypervolume(of(0.3, 0.2, 0.35), rivals).state == MISSED


@pytest.mark.parametrize(
    ("own", "rivals", "why"),
    [
        (of(nan), {"A": of(0.5, 0.4, 0.6)}, "a number is missing"),
        (of(0.8, 0.7, 0.9), {}, "no rival"),
        (of(0.8, 0.7, 0.9), {"A": of(nan)}, "a number is missing"),
        (of(0.8, n=1), {"A": of(0.5, 0.4, 0.6)}, "one seed has no interval"),
    ],
)
def test_hypervolume_that_cannot_be_told(own, rivals, why) -> None:
    verdict = aims.hypervolume(own, rivals)
    assert verdict.state == UNKNOWN
    assert why in verdict.why


@pytest.mark.parametrize(
    ("states", "state", "reached"),
    [
        ([REACHED] * 6 + [MISSED], REACHED, 6),
        ([REACHED] * 6, REACHED, 6),  # two were not run
        ([REACHED] * 5 + [MISSED] * 3, MISSED, 5),
        ([REACHED] * 5 + [MISSED, MISSED, UNKNOWN], UNKNOWN, 5),
        ([REACHED] * 5, UNKNOWN, 5),
        ([MISSED] * 3, MISSED, 0),
        ([MISSED] * 2, UNKNOWN, 0),
        ([], UNKNOWN, 0),
    ],
)
def test_six_of_eight(states, state, reached) -> None:
    verdict = aims.in_most(dict(zip(aims.EIGHT, states, strict=False)))
    assert (verdict.state, verdict.number.mean) == (state, reached)


def test_combined_scenarios_are_none_of_the_eight() -> None:
    states = {"perception+tips": REACHED} | dict.fromkeys(aims.EIGHT[:5], REACHED)
    verdict = aims.in_most(states)
    assert (verdict.state, verdict.why) == (UNKNOWN, "cannot be told in 3")
