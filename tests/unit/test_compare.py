"""The comparison: its runs, their settings, its tables and figures; nothing is trained here."""

from dataclasses import replace
from math import isnan, nan
from typing import Any

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.experiments import provenance
from evenhand.experiments.comparison import compare, tables
from evenhand.experiments.comparison import figures as figures_compare
from evenhand.experiments.comparison.settings import (
    ALGORITHMS,
    ARMS,
    CONTROLS,
    SCENARIOS,
    UNTUNED,
    Cell,
    CompareSettings,
    arm_of,
    learns,
    method_of,
    place,
)
from evenhand.methods import registry
from evenhand.methods.services import Services
from evenhand.report import figure
from evenhand.restaurant import people, worlds
from evenhand.training import run_folder
from evenhand.training.settings import TrainSettings
from support.refusals import refused

# --- what is run ---


def test_names_that_stand_twice_stand_alike():
    assert worlds.names() == (*SCENARIOS, "what-if-skin")
    assert set(figures_compare.looks()) == {*ARMS, *UNTUNED} == {*CONTROLS, *registry.names()}


def test_the_whole_comparison_has_every_run_once():
    cells = list(CompareSettings().cells())
    assert len(set(cells)) == len(cells) == 10 * 8 * (2 + 2 * 16)
    assert {(c.arm, c.algorithm) for c in cells if c.algorithm == "none"} == {
        ("reference", "none"), ("untrained", "none"),
    }  # fmt: skip
    assert [cell.seed for cell in cells] == sorted(cell.seed for cell in cells)
    assert len({cell.folder(CompareSettings.out) for cell in cells}) == len(cells)


def test_seeds_begin_where_they_are_told():
    cells = CompareSettings(seeds=2, first_seed=100).cells()
    assert {cell.seed for cell in cells} == {100, 101}


@pytest.mark.parametrize("arm", ["levelup", "levelup@2", "elbert@0.12345678", "service"])
def test_an_arm_is_a_method_and_perhaps_a_strength(arm):
    assert arm_of(*method_of(arm)) == arm


def test_cells_are_sorted_as_they_are_listed():
    cells = [
        Cell("even", "none", "reference", 0),
        Cell("even", "ppo", "service", 0),
        Cell("even", "ppo", "levelup", 1),
        Cell("even", "ppo", "levelup@0.5", 0),
        Cell("even", "ppo", "levelup@10", 0),
        Cell("even", "reinforce", "service", 0),
        Cell("tips", "none", "reference", 0),
        Cell("perception+tips", "none", "reference", 0),
    ]
    mixed = [cells[i] for i in (7, 4, 2, 0, 6, 3, 5, 1)]
    assert sorted(mixed, key=place) == cells


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"scenarios": ("percption",)}, "unknown scenario 'percption': did you mean 'perception'"),
        ({"scenarios": ("tips+even",)}, "contradicts itself"),
        ({"scenarios": ()}, "no scenario is given: name at least one"),
        ({"arms": ("levlup",)}, "unknown arm 'levlup': did you mean 'levelup'"),
        ({"arms": ("levelup@2", "levelup@2.0")}, "an entry of arms is given twice"),
        ({"arms": ("levelup@5", "levelup")}, "arms is given twice: levelup, levelup"),
        ({"arms": ("service@2",)}, "service has no strength, drop @2"),
        ({"arms": ("levelup@x",)}, "levelup@x: give a finite strength of at least 0"),
        ({"arms": ("levelup@-1",)}, "levelup@-1: give a finite strength of at least 0"),
        ({"arms": ("levelup@nan",)}, "levelup@nan: give a finite strength of at least 0"),
        ({"algorithms": ("pp",)}, "unknown algorithm 'pp': did you mean 'ppo'"),
        ({"algorithms": ("ppo", "ppo")}, "an entry of algorithms is given twice: ppo, ppo"),
        ({"first_seed": -1}, "first_seed is -1: give a whole number from 0 to 100000"),
        ({"seeds": 0}, "seeds is 0: give a whole number from 1 to 1000"),
        ({"epochs": 1}, "epochs is 1: give a whole number from 2 to 100000"),
        ({"services": 299}, "services is 299: give a whole number from 300 to 100000"),
        ({"workers": 65}, "workers is 65: give a whole number from 1 to 64"),
    ],
)
def test_what_cannot_be_compared_is_said_in_one_sentence(given, said):
    with pytest.raises(InputError) as caught:
        CompareSettings(**given)
    assert said in str(caught.value)


# --- how each run is trained ---


def training(arm: str, algorithm: str = "reinforce", scenario: str = "tips") -> TrainSettings:
    return compare.training_of(Cell(scenario, algorithm, arm, 3), 40)


def test_every_arm_differs_from_service_alone_in_its_method_only():
    plain = training("service")
    assert (plain.preset, plain.method) == ("service", registry.create("service"))
    assert (plain.scenario, plain.seed, plain.epochs, plain.people) == ("tips", 3, 40, 30)
    assert plain.update.algorithm == "reinforce"
    for name in registry.names():
        assert training(name) == replace(plain, method=name)
    assert training("service", "ppo").update.algorithm == "ppo"


@pytest.mark.parametrize(
    ("arm", "field", "value"),
    [
        ("score", "strength", 2.0), ("penalty", "strength", 1.0), ("influence", "strength", 0.5),
        ("surgery", "strength", 1.0), ("levelup", "strength", 5.0), ("lagrangian", "limit", 0.05),
        ("a_ppo", "strength", 0.15), ("elbert", "alpha", 0.02), ("group_dro", "rate", 0.1),
        ("ggf", "decay", 0.9), ("levelup@2", "strength", 2.0), ("elbert@4", "alpha", 4.0),
    ],
)  # fmt: skip
def test_strengths_as_they_were_tuned_or_given(arm, field, value):
    assert getattr(training(arm).method, field) == value


def test_a_strength_that_a_method_cannot_have():
    with refused("range decay"):
        training("ggf@2")


def test_another_training_has_another_key():
    cells = [Cell(s, a, arm, seed) for s in ("tips", "even") for a in ALGORITHMS
             for arm in ("service", "levelup", "levelup@2") for seed in (0, 1)]  # fmt: skip
    keys = {compare.key_of(cell, 40, 300) for cell in cells}
    assert len(keys) == len(cells)
    assert compare.key_of(cells[0], 40, 301) not in keys


def test_only_runs_that_ended_as_they_would_now_count(tmp_path):
    cell, other = Cell("tips", "ppo", "levelup@2", 4), Cell("tips", "none", "reference", 11)
    for one, key in ((cell, compare.key_of(cell, 40, 300)), (other, "40 epochs, with other sense")):
        one.folder(tmp_path).mkdir(parents=True)
        run_folder.finish(one.folder(tmp_path), key, {"test": {}})
    Cell("tips", "ppo", "service", 0).folder(tmp_path).mkdir(parents=True)
    assert list(compare.finished(tmp_path, 40, 300)) == [cell]


def test_the_commit_is_named_or_missing():
    found = provenance.commit()
    assert found is None or (len(found["hash"]) == 40 and found["changed"] in (True, False))


# --- numbers of a test ---

SCHEME = worlds.World().scheme


def served(disabled: np.ndarray) -> Services:
    """People who differ in disability alone; the disabled are not responded to, others well."""
    n = len(disabled)
    codes = np.zeros((n, 5), int)
    codes[:, 3] = np.where(disabled, 0, 1)
    return Services.build(
        {one.name: (codes[:, i], one.groups) for i, one in enumerate(people.IDENTITIES)},
        {
            "responded": ~disabled,
            "response_step": np.ma.array(np.full(n, 100), mask=disabled),
            "response_distance": np.ma.array(np.full(n, 1.25), mask=disabled),
            "min_distance": np.full(n, 1.0),
            "steps": np.full(n, 100),
        },
    )


def test_numbers_by_hand():
    found = tables.numbers(served(np.arange(120) % 2 == 0), SCHEME)
    # all 60 of 60 have the issue, and none of the others: nothing of it is chance
    assert found["corrected_willingness"] == pytest.approx(1.0, abs=1e-9)
    assert found["corrected_total"] == pytest.approx(1.0, abs=1e-9)
    assert found["corrected_quality"] is None  # no disabled person was responded to
    assert found["corrected_risk"] == 0.0
    assert found["raw_total"] == pytest.approx(1.0)
    assert (found["perfect_rate"], found["worst_group_rate"]) == (0.5, 0.0)


def test_a_small_group_is_not_the_worst():
    found = tables.numbers(served(np.arange(120) < 29), SCHEME)
    assert found["worst_group_rate"] == pytest.approx(91 / 120)
    assert tables.numbers(served(np.arange(120) < 30), SCHEME)["worst_group_rate"] == 0.0


# --- what seeds say together ---

NUMBERS = dict.fromkeys(tables.METRICS, 0.0)


def results(**arms: Any) -> dict[Cell, dict[str, float | None]]:
    """Corrected totals of arms, one a seed, in two uneven scenarios; 0.9 perfect services."""
    found: dict[Cell, dict[str, float | None]] = {}
    for arm, totals in arms.items():
        for scenario in ("perception", "tips"):
            for seed, total in enumerate(totals):
                algorithm = "ppo" if learns(arm) else "none"
                found[Cell(scenario, algorithm, arm, seed)] = {
                    **NUMBERS, "corrected_total": total, "perfect_rate": 0.9,
                    "biased_epochs": 3.0 if algorithm == "ppo" else None,
                }  # fmt: skip
    return found


def summarised(found: dict[Cell, dict[str, float | None]], *head: str) -> dict[str, Any]:
    [row] = [
        row
        for row in tables.summary(found)
        if tuple(row[name] for name in ("scenario", "arm", "metric")) == head
    ]
    return row


def test_a_summary_by_hand():
    found = results(
        reference=[0.0] * 4, service=[0.04, 0.10, 0.05, 0.06], levelup=[0.01, 0.02, 0.03, 0.06]
    )
    for scenario in ("perception", "tips", "all"):
        row = summarised(found, scenario, "levelup", "corrected_total")
        assert row["iqm"] == pytest.approx(0.025)
        assert row["low"] < 0.025 < row["high"]
        assert row["seeds"] == 4
        assert row["share"] == pytest.approx((0.055 - 0.025) / 0.055)
        # by seed: -0.03, -0.08, -0.02, 0
        assert row["difference"] == pytest.approx(-0.025)
        # of 16 pairs of seeds 13 are better and one is a tie
        assert row["improvement"] == pytest.approx(13.5 / 16)
        assert summarised(found, scenario, "levelup", "perfect_rate")["improvement"] == 0.5
    row = summarised(found, "tips", "reference", "biased_epochs")
    assert row["seeds"] == 0
    assert isnan(row["iqm"])


def test_more_perfect_services_and_less_unevenness_are_improvements():
    found = results(service=[0.1] * 2, levelup=[0.1, 0.2])
    for cell in [cell for cell in found if (cell.arm, cell.seed) == ("levelup", 0)]:
        found[cell] = found[cell] | {"perfect_rate": 0.95, "worst_group_rate": -0.1}
    expected = {"corrected_total": 0.25, "perfect_rate": 0.75, "worst_group_rate": 0.25}
    for metric, probability in expected.items():
        assert summarised(found, "tips", "levelup", metric)["improvement"] == probability


def test_what_cannot_be_said_is_missing():
    row = summarised(results(levelup=[0.1]), "tips", "levelup", "corrected_total")
    assert (row["iqm"], row["seeds"]) == (0.1, 1)
    names = ("low", "high", "share", "share_low", "difference", "improvement", "improvement_high")
    assert all(isnan(row[name]) for name in names)


def test_all_scenarios_are_pooled_for_arms_that_were_in_all():
    found = results(service=[0.1, 0.2], levelup=[0.0, 0.1])
    found = {
        cell: n for cell, n in found.items() if (cell.scenario, cell.arm) != ("tips", "levelup")
    }
    pooled = {r["arm"] for r in tables.summary(found) if r["scenario"] == "all"}
    assert pooled == {"service"}
    alone = {cell: n for cell, n in found.items() if cell.scenario == "tips"}
    assert "all" not in {row["scenario"] for row in tables.summary(alone)}


def test_what_is_added_leaves_the_other_rows_as_they_were():
    few = results(service=[0.1, 0.2, 0.4], levelup=[0.0, 0.1, 0.3])
    more = results(
        service=[0.1, 0.2, 0.4], score=[0.1, 0.1, 0.3], levelup=[0.0, 0.1, 0.3]
    )  # fmt: skip
    kept = [row for row in tables.summary(more) if row["arm"] != "score"]
    # as text, for a missing number is equal to none
    assert str(kept) == str(tables.summary(few))


def test_every_number_has_a_row():
    found = results(reference=[0.0], service=[0.1])
    rows = tables.tidy(found)
    assert len(rows) == len(found) * len(tables.METRICS)
    assert set(rows[0]) == set(tables.RESULTS)
    biased = {row["arm"]: row["value"] for row in rows if row["metric"] == "biased_epochs"}
    assert biased == {"reference": None, "service": 3.0}


def test_fronts_by_hand():
    found = results(**{"service": [0.2, 0.2], "levelup": [0.1, 0.1], "levelup@2": [0.05, 0.05]})
    for cell in [cell for cell in found if cell.arm == "levelup@2"]:
        found[cell] = found[cell] | {"perfect_rate": 0.5}
    rows = {(r["scenario"], r["method"]): r for r in tables.fronts(found)}
    assert {scenario for scenario, _ in rows} == {"perception", "tips"}
    row = rows["tips", "levelup"]
    assert row["scale"] == pytest.approx(0.2)
    # half as uneven as the worst arm with 0.9 perfect; a quarter with 0.5
    assert row["hypervolume"] == pytest.approx(0.75 * 0.5 + 0.5 * 0.4)
    assert (row["seeds"], row["arms"], row["front"]) == (2, "levelup levelup@2", row["arms"])
    assert rows["tips", "service"]["hypervolume"] == 0.0


def test_nearly_even_arms_are_not_told_apart_by_chance():
    rows = tables.fronts(results(service=[0.001], levelup=[0.0]))
    assert [row["scale"] for row in rows] == [0.05] * 4
    assert rows[0]["hypervolume"] == pytest.approx(0.9 * (1 - 0.001 / 0.05))


# --- the figure ---


def test_a_figure_for_each_algorithm_shows_every_arm(tmp_path):
    found = results(reference=[0.0], service=[0.1], **{"levelup@2": [0.02]})
    shown = tables.shown(tables.summary(found))
    files = figure.write(tmp_path, figures_compare.draw_all(shown, 300))
    assert {path.name for path in files} == {path.name for path in tmp_path.iterdir()} == {
        "compare_ppo.svg", "compare_ppo-narrow.svg", "compare_ppo.pdf", "compare_ppo.csv",
    }  # fmt: skip
    lines = (tmp_path / "compare_ppo.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * 3  # the pooled rows are no panel
    assert "tips,ppo,levelup@2,1,0.02,,,0.9,," in lines
    drawn = (tmp_path / "compare_ppo.svg").read_text()
    assert all(name in drawn for name in ("perception", "tips", "level-up", "reference robot"))


def test_a_figure_of_nothing_but_missing_numbers_is_empty_but_there(tmp_path):
    row = {name: nan for aim in ("corrected_total", "perfect_rate")
           for name in (aim, f"{aim}_low", f"{aim}_high")}  # fmt: skip
    head = {"scenario": "tips", "algorithm": "none", "arm": "untrained", "seeds": 0}
    figure.write(tmp_path, figures_compare.draw_all([head | row], 300))
    assert (tmp_path / "compare_none.svg").exists()
