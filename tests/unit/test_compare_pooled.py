"""Rows over all scenarios: every scenario counts alike, however many seeds were run in it."""

from collections.abc import Mapping
from math import isnan
from typing import Any

import pytest

from evenhand.experiments.comparison import tables
from evenhand.experiments.comparison.settings import Cell, CompareSettings
from evenhand.restaurant import worlds
from support.refusals import refused

# level-up halves unevenness wherever it is, and the reference robot has none
TOTALS = {
    "perception": {"service": 0.5, "levelup": 0.25},
    "tips": {"service": 0.1, "levelup": 0.05},
}
Seeds = Mapping[str, Mapping[str, range]]


def pooled(seeds: Seeds, metric: str = "corrected_total") -> dict[str, dict[str, Any]]:
    """The row of each arm that learns over all scenarios."""
    found: dict[Cell, dict[str, float | None]] = {}
    for scenario, arms in TOTALS.items():
        for seed in range(10):
            found[Cell(scenario, "none", "reference", seed)] = dict.fromkeys(tables.METRICS, 0.0)
        for arm, total in arms.items():
            for seed in seeds[scenario][arm]:
                cell = Cell(scenario, "ppo", arm, seed)
                # seeds scatter around their total, by pairs that take each other up
                wave = 0.01 * (-1) ** seed
                found[cell] = dict.fromkeys(tables.METRICS, total + wave * total)
    rows = tables.summary(found)
    assert {row["metric"] for row in rows} == set(tables.METRICS)
    return {
        row["arm"]: row
        for row in rows
        if (row["scenario"], row["algorithm"], row["metric"]) == ("all", "ppo", metric)
    }


UNEQUAL = [
    {"perception": {"service": range(10), "levelup": range(10)},
     "tips": {"service": range(2), "levelup": range(2)}},
    {"perception": {"service": range(2), "levelup": range(10)},
     "tips": {"service": range(10), "levelup": range(2)}},
    {"perception": {"service": range(10), "levelup": range(2)},
     "tips": {"service": range(2), "levelup": range(10)}},
    {"perception": {"service": range(2), "levelup": range(2)},
     "tips": {"service": range(2), "levelup": range(2)}},
]  # fmt: skip


@pytest.mark.parametrize("seeds", UNEQUAL)
def test_a_mean_over_scenarios_does_not_depend_on_how_many_seeds_each_has(seeds):
    rows = pooled(seeds)
    for arm, factor in (("service", 1.0), ("levelup", 0.5)):
        # the middle half of 0.495, 0.505, 0.099 and 0.101
        assert rows[arm]["iqm"] == pytest.approx(factor * (0.101 + 0.495) / 2)
        assert rows[arm]["seeds"] == 2
        assert rows[arm]["low"] < rows[arm]["iqm"] < rows[arm]["high"]
    assert rows["levelup"]["difference"] == pytest.approx(-0.5 * (0.101 + 0.495) / 2)
    assert rows["levelup"]["improvement"] == 1.0
    assert rows["levelup"]["share"] == pytest.approx(0.5)


def test_other_arms_keep_their_seeds():
    seeds = {name: {"service": range(10), "levelup": range(3)} for name in TOTALS}
    rows = pooled(seeds)
    assert (rows["service"]["seeds"], rows["levelup"]["seeds"]) == (10, 3)


def test_one_common_seed_has_no_interval_and_none_no_number():
    one = {"service": range(10), "levelup": range(1, 10)}
    rows = pooled({"perception": one, "tips": {"service": range(10), "levelup": range(2)}})
    assert rows["levelup"]["seeds"] == 1
    assert rows["levelup"]["iqm"] == pytest.approx(0.99 * 0.15)
    assert isnan(rows["levelup"]["low"])
    rows = pooled({"perception": one, "tips": {"service": range(10), "levelup": range(1)}})
    assert rows["levelup"]["seeds"] == 0
    assert isnan(rows["levelup"]["iqm"])


def test_a_scenario_has_one_name():
    assert worlds.ordered("tips+perception") == "perception+tips"
    assert worlds.ordered("everyday") == "everyday"
    assert CompareSettings(scenarios=("tips+minority",)).scenarios == ("minority+tips",)
    with refused("duplicate scenarios"):
        CompareSettings(scenarios=("perception+tips", "tips+perception"))
    with refused("conflict scenario"):
        worlds.ordered("tips+everyday")
