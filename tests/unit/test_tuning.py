"""Strengths: all methods and controls tuned alike, and chosen by one rule."""

import pytest

from evenhand.experiments.comparison import tuning
from evenhand.experiments.comparison.settings import ARMS, SCENARIOS, learns, method_of
from evenhand.methods import registry


def rows(**arms):
    """One seed in one scenario: (corrected total, perfect services) of each arm."""
    return [
        {"arm": arm.replace("_at_", "@"), "metric": metric, "value": str(value)}
        for arm, numbers in arms.items()
        for metric, value in zip(("corrected_total", "perfect_rate"), numbers, strict=True)
    ]


def test_every_method_that_is_compared_and_has_a_strength_is_tuned_alike():
    compared = {method_of(arm)[0] for arm in ARMS if learns(arm)}
    with_strength = {n for n in compared if registry.entry(n).strength is not None}
    assert tuning.GRIDS.keys() == with_strength
    assert {len(grid) for grid in tuning.GRIDS.values()} == {8}
    for name, grid in tuning.GRIDS.items():
        assert sorted(set(grid)) == list(grid), name
        for one in grid:  # and none of them is refused
            registry.create(registry.spelled(name, one))
    assert len(tuning.arms()) == 2 + 8 * len(tuning.GRIDS)
    assert tuning.SEEDS >= 3
    assert tuning.FIRST_SEED >= 100


def test_nothing_is_tuned_where_it_is_evaluated():
    assert not {*tuning.SCENARIOS} & {*SCENARIOS}
    assert len(tuning.SCENARIOS) == 2


def test_the_lowest_total_at_no_cost_of_service():
    found = tuning.choose(
        rows(
            service=(0.2, 0.9),
            levelup_at_1=(0.10, 0.90), levelup_at_2=(0.06, 0.895), levelup_at_5=(0.01, 0.80),
        )
    )  # fmt: skip
    [one] = found
    assert (one.method, one.strength, one.total, one.perfect) == ("levelup", 2.0, 0.06, 0.895)
    assert not one.edge


def test_where_every_strength_costs_service_the_least_costly():
    tried = rows(service=(0.2, 0.9), **{"ggf@0.5": (0.0, 0.5), "ggf@0.9": (0.1, 0.7)})
    [one] = tuning.choose(tried)
    assert (one.strength, one.edge) == (0.9, True)


def test_scenarios_learners_and_seeds_are_averaged():
    more = rows(service=(0.2, 0.9), blind_at_1=(0.1, 0.9), blind_at_2=(0.2, 0.9))
    more += rows(service=(0.2, 0.9), blind_at_1=(0.5, 0.9), blind_at_2=(0.2, 0.9))
    [one] = tuning.choose(more)
    assert one.strength == 2.0
    assert one.total == pytest.approx(0.2)
