"""Verdicts on the paper's claims, by hand."""

import numpy as np
import pytest

from evenhand.experiments.paper import claims as verdicts

NAN = float("nan")
YES, NO = "reproduced", "contradicted"
UNTOLD, UNTESTED = "cannot be told", "cannot be tested"


class TestReduction:
    def test_by_hand(self):
        # differences 1 and 3: mean 2 of 3; s = √2; t(0.975, 1) = 12.7062; 12.7062·√2/√2/3
        found = verdicts.reduction(np.array([2.0, 4.0]), np.array([1.0, 1.0]))
        assert found == pytest.approx((2 / 3, 2 / 3 - 4.23540, 2 / 3 + 4.23540), abs=1e-4)

    def test_three_seeds_by_hand(self):
        # differences 1, 2, 3 of a mean of 10: 0.2 ± 4.302653·1/√3/10
        found = verdicts.reduction(np.array([9.0, 10.0, 11.0]), np.array([8.0, 8.0, 8.0]))
        assert found == pytest.approx((0.2, 0.2 - 0.2484138, 0.2 + 0.2484138), abs=1e-6)

    def test_a_rise_is_negative(self):
        estimate, *_ = verdicts.reduction(np.array([1.0]), np.array([1.5]))
        assert estimate == -0.5

    def test_one_seed_has_no_interval(self):
        assert verdicts.reduction(np.array([2.0]), np.array([1.0])) == pytest.approx(
            (0.5, NAN, NAN), nan_ok=True
        )

    def test_nothing_can_be_less_than_nothing(self):
        found = verdicts.reduction(np.zeros(3), np.array([0.0, 1.0, 0.0]))
        assert np.isnan(found).all()


class TestVerdicts:
    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [
            (0.22, 0.5, YES),
            (0.3, 0.5, YES),
            (0.1, 0.22, UNTOLD),
            (-0.1, 0.3, UNTOLD),
            (-0.1, 0.21, NO),
            (NAN, 0.3, UNTOLD),
            (0.3, NAN, UNTOLD),
            (0.3, 0.3, UNTOLD),  # all seeds alike: no interval
            (0.0, 0.0, UNTOLD),
            (0.3, 0.3 + 1e-15, UNTOLD),  # alike but for rounding
        ],
    )
    def test_at_least(self, low, high, verdict):
        assert verdicts.at_least(low, high, 0.22) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [(0.2, 0.5, YES), (0.357, 0.5, YES), (0.1, 0.357, YES), (0.1, 0.3, NO), (0.4, 0.5, NO)],
    )
    def test_contains(self, low, high, verdict):
        assert verdicts.contains(low, high, 0.357) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [(0.1, 0.2, YES), (0.0, 0.2, UNTOLD), (-0.1, 0.1, UNTOLD), (-0.2, -0.1, NO),
         (-0.1, 0.0, UNTOLD), (NAN, NAN, UNTOLD), (0.1, 0.1, UNTOLD), (-0.1, -0.1, UNTOLD)],
    )  # fmt: skip
    def test_above_zero(self, low, high, verdict):
        assert verdicts.above_zero(low, high) == verdict

    @pytest.mark.parametrize(
        ("given", "said"),
        [
            ((YES, 0.25, 0.35, 0.22), ""),
            ((NO, 0.05, 0.15, 0.22), ""),
            ((UNTOLD, 0.1, 0.3, 0.22), "The interval holds 0.22: these seeds cannot tell."),
            ((UNTOLD, 0.1, 0.3, 15 / 54), "The interval holds 0.278: these seeds cannot tell."),
            ((UNTOLD, -0.1, 0.3, 0.0), "The interval holds 0: these seeds cannot tell."),
            ((UNTOLD, NAN, NAN, 0.22), "One seed gives no interval: run more seeds."),
            ((UNTESTED, NAN, NAN, 0.22), "Without guidance there was nothing to lower."),
            ((UNTOLD, 0.0, 0.0, 0.22), "The difference is the same in every seed, which gives no "
             "interval: run more seeds."),
        ],
    )  # fmt: skip
    def test_why_it_cannot_be_told(self, given, said):
        assert verdicts.undecided(*given) == said
