"""Verdicts on the paper's claims, by hand."""

import numpy as np
import pytest

from evenhand.experiments.paper import claims as verdicts

NAN = float("nan")
YES, NO, FITTED, NOTHING = "reproduced", "contradicted", "reproduced by calibration", "no effect"
OPEN = "open"


class TestDifference:
    def test_by_hand(self):
        # differences 1 and 3: mean 2; s = √2; t(0.975, 1) = 12.7062; 12.7062·√2/√2
        found = verdicts.difference(np.array([2.0, 4.0]), np.array([1.0, 1.0]))
        assert found == pytest.approx((2.0, 2.0 - 12.7062, 2.0 + 12.7062), abs=1e-4)

    def test_three_seeds_by_hand(self):
        # differences 1, 2, 3: 2 ± 4.302653·1/√3
        found = verdicts.difference(np.array([9.0, 10.0, 11.0]), np.array([8.0, 8.0, 8.0]))
        assert found == pytest.approx((2.0, 2.0 - 2.484138, 2.0 + 2.484138), abs=1e-6)

    def test_a_rise_is_negative(self):
        estimate, *_ = verdicts.difference(np.array([1.0]), np.array([1.5]))
        assert estimate == -0.5

    def test_one_seed_has_no_interval(self):
        assert verdicts.difference(np.array([2.0]), np.array([1.0])) == pytest.approx(
            (1.0, NAN, NAN), nan_ok=True
        )


class TestVerdicts:
    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [
            (0.22, 0.5, YES),
            (0.3, 0.5, YES),
            (0.1, 0.22, OPEN),
            (-0.1, 0.3, OPEN),
            (-0.1, 0.21, NO),
            (0.05, 0.1, NO),  # an effect, and less than was claimed
            (-0.019, 0.019, NOTHING),
            (-0.02, 0.019, NO),
            (0.005, 0.015, NOTHING),  # below what matters, though not 0
            (NAN, 0.3, OPEN),
            (0.3, NAN, OPEN),
            (0.3, 0.3, OPEN),  # all seeds alike: no interval
            (0.0, 0.0, OPEN),
            (0.3, 0.3 + 1e-15, OPEN),  # alike but for rounding
        ],
    )
    def test_lowered_by(self, low, high, verdict):
        assert verdicts.lowered_by(low, high, 0.22, 0.02) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [
            (0.2, 0.5, FITTED),
            (0.357, 0.5, FITTED),
            (0.1, 0.357, FITTED),
            (0.1, 0.3, NO),
            (0.4, 0.5, NO),
        ],
    )
    def test_contains(self, low, high, verdict):
        assert verdicts.contains(low, high, 0.357) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [(0.1, 0.2, YES), (0.0, 0.2, OPEN), (-0.1, 0.1, OPEN), (-0.2, -0.1, NO),
         (-0.1, 0.0, OPEN), (NAN, NAN, OPEN), (0.1, 0.1, OPEN), (-0.1, -0.1, OPEN)],
    )  # fmt: skip
    def test_above_zero(self, low, high, verdict):
        assert verdicts.above_zero(low, high) == verdict

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ((YES, 0.25, 0.35), ""),
            ((NO, 0.05, 0.15), ""),
            ((OPEN, 0.1, 0.3), "These seeds cannot tell."),
            ((OPEN, NAN, NAN), "One seed gives no interval: run more seeds."),
            ((OPEN, 0.0, 0.0), "The difference is the same in every seed, which gives no "
             "interval: run more seeds."),
        ],
    )  # fmt: skip
    def test_why_it_is_open(self, given, said):
        assert verdicts.undecided(*given) == said
