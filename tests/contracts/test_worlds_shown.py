"""A user's own world: its identities and issues appear wherever results are shown."""

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import evenhand as ev
from evenhand.experiments.comparison import tables, words
from evenhand.experiments.comparison.read import Comparison
from evenhand.experiments.comparison.settings import Cell
from evenhand.methods.paper.issues import PAPER_ISSUES, Thresholds
from evenhand.restaurant import robots, serve_people, worlds
from evenhand.restaurant.film import clip
from evenhand.restaurant.live import shift
from evenhand.restaurant.live import words as live
from evenhand.restaurant.replay import page, services
from evenhand.training import run_folder
from support.refusals import refused

WAITING = ev.own_issue("Waiting", ["seconds"], lambda s: (s / 6).clip(0, 1), graded=True)
FEWER = ev.World(
    identities=(
        ev.Identity("gender", ("Male", "Female")),
        ev.Identity("language", ("local", "foreign")),
    ),
    facts={ev.Fact("seconds", float, least=0.0): lambda done: done.facts.steps * 0.02},
    issues=(WAITING, PAPER_ISSUES[0]),
)


@pytest.fixture(scope="module")
def served():
    rng = np.random.default_rng(3)
    robot = robots.ScriptedRobot("even", 1.0)
    done = serve_people.serve_people(FEWER, robot, 60, rng, recorded=True)
    return done.seen, serve_people.table(done, FEWER, "even")


@pytest.fixture
def known(monkeypatch):
    monkeypatch.setattr(worlds, "_SCENARIOS", dict(worlds._SCENARIOS))
    ev.register_scenario("fewer", world=FEWER)


def test_a_comparison_scores_graded_issues_and_pools_own_ones(served):
    numbers = tables.numbers(served[1], FEWER.scheme) | {"biased_epochs": None}
    assert {"corrected_Waiting", "corrected_willingness"} <= numbers.keys()
    assert "corrected_risk" not in numbers
    cells = [Cell(name, "ppo", "service", seed) for name in ("one", "other") for seed in (0, 1)]
    rows = tables.summary(dict.fromkeys(cells, numbers))
    pooled = [row["metric"] for row in rows if row["scenario"] == tables.ALL]
    assert pooled == tables.metrics_of(numbers)


def test_the_page_of_a_comparison_names_what_is_scored_in_each_world():
    manifest = {"worlds": {"fewer": FEWER.described(), "even": ev.World().described()}}

    told = words.scored(
        cast(Comparison, SimpleNamespace(scenarios=["even", "fewer"], manifest=manifest))
    )
    paper, own = told.split("; ")
    assert paper == "willingness, quality, priority, risk over 22 groups"
    assert own == "in fewer Waiting, willingness over 4 groups of gender, language"


def test_a_replay_shows_the_issues_and_identities_of_its_world(served):
    seen, rows = served
    content = page.payload(seen, rows, FEWER.issues)
    assert content["issues"] == ["Waiting", "willingness"]
    assert list(content["identities"]) == ["gender", "language"]
    severity = rows.fact("seconds") / 6
    shown = [one["issues"][0] for one in content["services"]]
    np.testing.assert_allclose(shown, severity)
    for one, value in zip(content["services"], severity, strict=True):
        assert (one["times"][0] is not None) == (value >= 0.5)
        assert ("Waiting" in one["outcome"]) == (value >= 0.5)
    text = page.render(content, "", "Ours", "", FEWER.issues)
    assert "Issues of this world: Waiting." in text
    assert "does not show gender, language;" in text
    assert "Risk begins" not in text
    met = np.flatnonzero(severity >= 0.5)[-services.EACH :]
    assert {*met.tolist()} <= {*services.choose(rows, named=FEWER.issues)}


def test_limits_of_ones_own_are_not_explained_by_those_of_the_paper():
    own = ev.paper_issues(Thresholds(late=10.0))
    assert not {*own} & {*PAPER_ISSUES}
    assert {*ev.paper_issues()} == {*PAPER_ISSUES}


def test_a_clip_says_own_issues_with_their_severity(served):
    seen, rows = served
    footage = clip.Footage(seen, rows, FEWER.issues).take([4, 5])
    assert footage.issues == FEWER.issues
    long = clip.Footage(seen, rows, FEWER.issues)
    for row, seconds in enumerate(rows.fact("seconds")):
        said = clip.outcome(long.facts, row, long.issues)[1]
        severity = seconds / 6
        word = "Waiting" if severity == 1.0 else f"Waiting {severity:.2f}"
        assert (word in said) == (severity >= 0.5)


def test_the_live_view_shows_what_evaluation_measures(known):
    at_work = shift.Shift(shift.scripted("even", 1.0, "fewer"), 3)
    scheme = at_work.cast.world.scheme
    found = []
    for _ in range(shift.BATCH):
        while at_work.outcome is None:
            at_work.step()
        found.append(at_work.outcome)
        tally = at_work.moment.tally
        at_work.proceed()
    rng = np.random.default_rng(3)
    done = serve_people.serve_people(FEWER, robots.ScriptedRobot("even", 1.0), shift.BATCH, rng)
    np.testing.assert_array_equal([one.issues for one in found], FEWER.indicators(done))
    np.testing.assert_array_equal([one.codes for one in found], done.codes)
    names = [name for name, _, _ in live.counts(tally, scheme)]
    assert names == [
        "everybody", "gender: Male", "gender: Female", "language: local", "language: foreign",
    ]  # fmt: skip
    assert [name for name, _ in live.person(found[0].codes, scheme)] == ["gender", "language"]
    moment = replace(at_work.moment, outcome=found[0])
    severity = found[0].issues[0]
    assert live.verdicts(moment, scheme)[0] == ("Waiting", live.OWN, f"severity {severity:.2f}")


def test_a_run_is_shown_as_its_own_scenario_says(known, tmp_path):
    noted = {"settings": {"scenario": "fewer"}, "fingerprints": worlds.sources("fewer")}
    path = tmp_path / "settings.json"
    path.write_text(json.dumps(noted))
    assert run_folder.world_of(tmp_path).issues == FEWER.issues
    path.write_text(json.dumps(noted | {"fingerprints": {}}))
    with refused("changed scenario"):
        run_folder.world_of(tmp_path)
    path.write_text(json.dumps({"settings": {"scenario": "gone"}, "fingerprints": {}}))
    with refused("unknown scenario", "'gone'", "--plugin"):
        run_folder.world_of(tmp_path)


def test_what_nobody_judged_is_not_counted_as_unbiased(known, tmp_path):
    from evenhand.experiments.comparison import compare

    cell = Cell("fewer", "ppo", "service", 0)
    settings = replace(compare.training_of(cell, 1), people=30)
    told, _ = compare.learn_and_serve(lambda *_: None, tmp_path / "run", cell, settings, 300)
    assert told["biased_epochs"] is None
    del worlds._SCENARIOS["fewer"]
    with refused("unknown scenario", "'fewer'", "--plugin"):
        run_folder.load_policy(tmp_path / "run")


@pytest.mark.parametrize("command", ["compare", "sweep", "train", "evaluate"])
def test_help_lists_the_scenarios_of_a_plugin(command, apart, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("import evenhand as ev\nev.register_scenario('babel', world=ev.World())\n")
    assert "babel" in apart(command, "--plugin", file, "--help").out
