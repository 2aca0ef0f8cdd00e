"""The operator's reward by hand."""

import numpy as np
import pytest

from evenhand.restaurant.scenarios import tips
from support.refusals import refused

CHILD, TEENAGER, ADULT, MIDDLE_AGED, ELDER = ([0, 0, age, 1, 0] for age in range(5))
CODES = np.array([CHILD, TEENAGER, ADULT, MIDDLE_AGED, ELDER, CHILD])
# response, distance, promptness, safety; the last one was risky and late, the fourth no response
TERMS = np.array(
    [
        [0.2, 0.5, 0.3, 0.0],
        [0.2, 0.5, 0.3, 0.0],
        [0.2, 0.5, 0.3, 0.0],
        [0.0, 0.0, 0.0, -0.5],
        [0.2, 0.4, 0.2, 0.0],
        [0.2, 0.1, 0.1, -0.5],
    ]
)
STEPS = np.array([150, 75, 0, 300, 225, 270])

BY_HAND = [
    (0.0, [1.0, 1.0, 1.0, -0.5, 0.8, -0.1]),
    # a child brings 0.65, a teenager 0.75; 300 steps cost 0.125
    (0.5, [0.65 - 0.0625, 0.75 - 0.03125, 1.0, -0.625, 0.8 - 0.09375, 0.26 - 0.5 - 0.1125]),
    # a child brings 0.3, a teenager 0.5; 300 steps cost 0.25
    (1.0, [0.3 - 0.125, 0.5 - 0.0625, 1.0, -0.75, 0.8 - 0.1875, 0.12 - 0.5 - 0.225]),
]


@pytest.mark.parametrize(("strength", "expected"), BY_HAND)
def test_by_hand(strength, expected):
    np.testing.assert_allclose(tips.reward(strength, CODES, TERMS, STEPS), expected, atol=1e-12)


def test_without_strength_it_is_the_quality_of_service_whoever_asks():
    rng = np.random.default_rng(2)
    codes = np.stack([rng.integers(0, size, 50) for size in (6, 3, 5, 2, 6)], axis=1)
    terms, steps = rng.normal(size=(50, 4)), rng.integers(1, 301, 50)
    found = tips.reward(0.0, codes, terms, steps)
    np.testing.assert_allclose(found, terms.sum(axis=1), rtol=0, atol=1e-15)


def test_only_age_counts():
    rng = np.random.default_rng(3)
    codes = np.stack([rng.integers(0, size, 6) for size in (6, 3, 5, 2, 6)], axis=1)
    codes[:, 2] = CODES[:, 2]
    np.testing.assert_array_equal(
        tips.reward(1.0, codes, TERMS, STEPS), tips.reward(1.0, CODES, TERMS, STEPS)
    )


@pytest.mark.parametrize("strength", [-0.01, 1.01, np.inf, np.nan])
def test_impossible_strengths(strength):
    with refused("range tips") as caught:
        tips.check(strength)
    assert str(caught.value) == f"tips is {strength}: give a strength from 0 to 1"


@pytest.mark.parametrize("strength", [0.0, 0.5, 1.0])
def test_possible_strengths(strength):
    tips.check(strength)
