"""What every registered scenario keeps, that of the example included."""

import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evenhand.core import files, plugins
from evenhand.experiments.comparison import tables
from evenhand.experiments.comparison.settings import Cell
from evenhand.methods.paper import issues
from evenhand.restaurant import people, serve_people, worlds
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.simulation import layout, serve
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.training import run_folder, train
from evenhand.training.settings import TrainSettings, settings_of

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "own_scenario.py"
SCENARIOS = (
    "even", "prejudiced", "perception", "minority", "tips", "everyday", "noisy",
    "hidden", "hurry", "what-if-skin", "perception+tips", "noisy+tips",
)  # fmt: skip


@pytest.fixture(autouse=True)
def _own(monkeypatch):
    monkeypatch.setattr(worlds, "_SCENARIOS", dict(worlds._SCENARIOS))
    monkeypatch.setattr(plugins, "_files", {})
    monkeypatch.setenv(plugins.VARIABLE, "")
    plugins.load_plugin(EXAMPLE)


def assert_same(one: serve.Trajectories, other: serve.Trajectories) -> None:
    for name in ("codes", "observation", "action", "mask"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    for name, values in vars(one.facts).items():
        if not name.startswith("_"):
            np.testing.assert_array_equal(values, getattr(other.facts, name), name)


def test_every_scenario_is_tried():
    assert {*worlds.names()} == {one for name in SCENARIOS for one in name.split("+")}


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_reference_robot_serves_well(name):
    world = worlds.scenario(name)
    if world.reference is None:
        assert name == "noisy+tips", "what makes up for one cause makes up for no other"
        return
    done = serve_people.serve_people(world, world.reference, 300, np.random.default_rng(7))
    # nobody can serve all well who is not told whom it serves, or has no time for all
    scarce = world.hidden or world.party > 1
    assert done.facts.perfect.mean() >= (0.7 if scarce else 0.9)


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_same_seed_serves_the_same_on_any_number_of_threads(name):
    world, robot = worlds.scenario(name), ScriptedRobot("ageist", 0.6)
    one, other = (
        serve_people.serve_people(world, robot, 40, np.random.default_rng(3), threads=threads)
        for threads in (1, 2)
    )
    assert_same(one, other)
    table = serve_people.table(one, world, "ageist")
    assert table == serve_people.table(other, world, "ageist")
    assert table.identities == tuple(one.name for one in world.identities)


@pytest.mark.parametrize("name", SCENARIOS)
def test_people_are_served_as_step_by_step(name):
    """Drawn, planned and run one by one, in lanes of another number."""
    world, robot, rng = worlds.scenario(name), ScriptedRobot("racist"), np.random.default_rng(5)
    setups = layout.draw(world.people, 30, rng, world.hidden)
    plan = robot.robot(setups.asking, rng)
    lanes = Lanes(7, world.task, 1, len(world.groups))
    missed = world.also_missed(setups.codes)
    drawn = serve.draw(lanes, setups, rng, world.sensor, world.need, missed, world.party)
    assert_same(
        serve.run(lanes, drawn, plan),
        serve_people.serve_people(world, robot, 30, np.random.default_rng(5)),
    )


@pytest.mark.parametrize("name", SCENARIOS)
def test_settings_bring_the_world_back(name, tmp_path):
    settings = TrainSettings("service", scenario=name, population="fairface", method="service")
    files.write_json(tmp_path / "settings.json", run_folder.as_dict(settings))
    noted = json.loads((tmp_path / "settings.json").read_text())
    back = run_folder._from_dict(TrainSettings, noted, tmp_path)
    assert back == settings
    assert back.world == settings.world
    assert back.world.described() == settings.world.described()
    assert back.world.people.name == "fairface"


@pytest.mark.parametrize("name", SCENARIOS)
def test_an_epoch_is_scored_as_its_table_says(name):
    settings = replace(settings_of("service", "ppo", "levelup", epochs=1), scenario=name, people=30)
    record = next(iter(train.train(settings, train.shipped_detector(settings))))
    scores = settings.world.scheme.score(record.services)
    assert record.numbers["total"] == pytest.approx(float(scores.total))
    for issue, score in zip(scores.issues, scores.overall, strict=True):
        found = record.numbers[issue]
        assert np.nan if found is None else found == pytest.approx(score, nan_ok=True)
    assert {f"total_{one.name}" for one in settings.world.identities} <= record.numbers.keys()


def test_the_example_is_as_short_as_promised_and_uses_public_names_only():
    text = EXAMPLE.read_text()
    assert len(text.splitlines()) <= 25
    assert [line for line in text.splitlines() if "import" in line] == ["import evenhand as ev"]
    assert importlib.util.find_spec("evenhand") is not None


def test_who_speaks_another_language_is_missed_more_often_and_waits_as_its_facts_say():
    world = worlds.scenario("noisy")
    done = serve_people.serve_people(world, ScriptedRobot(), 400, np.random.default_rng(1))
    age = done.observation[:, :, -1]
    old = np.array([(row[mask > 0] > 0).mean() for row, mask in zip(age, done.mask, strict=True)])
    foreign, wheelchair = done.codes[:, 5] == 1, done.codes[:, 3] == 0
    assert abs(foreign.mean() - 0.2) < 0.06
    # 2 % of readings fail anyway
    assert old[~foreign & ~wheelchair].mean() == pytest.approx(0.02, abs=0.01)
    assert old[foreign & ~wheelchair].mean() == pytest.approx(1 - 0.98 * 0.7, abs=0.07)
    table = serve_people.table(done, world, "even")
    np.testing.assert_allclose(table.fact("seconds"), table.fact("steps") * 0.02)
    waiting = world.scheme.indicators(table)[:, 4]
    np.testing.assert_allclose(waiting, table.fact("steps") / 300)
    # Eq. 1 of a graded issue is a difference of means
    scores = world.scheme.score(table)
    gap = abs(waiting[foreign].mean() - waiting[~foreign].mean())
    assert scores.gap[world.groups.index(("language", "foreign")), 4] == pytest.approx(gap)
    np.testing.assert_array_equal(world.indicators(done), world.scheme.indicators(table))
    assert [one.name for one in world.issues[:4]] == [one.name for one in issues.PAPER_ISSUES]
    assert world.groups[:22] == people.GROUPS


def test_a_comparison_counts_the_issues_of_the_world():
    """An own rule that says what the paper's risk says has its number, and no more is counted."""
    willingness, *_, risk = issues.PAPER_ISSUES
    own = worlds.World(issues=(willingness, replace(risk, name="nearness")))
    world = worlds.World()
    done = serve_people.serve_people(
        world, ScriptedRobot("ageist", 1.0), 300, np.random.default_rng(3)
    )
    table = serve_people.table(done, world, "ageist")
    ours, papers = (tables.numbers(table, one.scheme) for one in (own, world))
    assert [name for name in ours if name.startswith("corrected_")] == [
        "corrected_total", "corrected_willingness", "corrected_nearness",
    ]  # fmt: skip
    assert ours["corrected_nearness"] == papers["corrected_risk"]
    assert ours["corrected_willingness"] == papers["corrected_willingness"]
    cell = Cell("own", "ppo", "service", 0)
    rows = tables.tidy({cell: ours | {"biased_epochs": 1}})
    assert [row["metric"] for row in rows] == [
        "corrected_total", "corrected_nearness", "corrected_willingness", "raw_total",
        "perfect_rate", "worst_group_rate", "per_imperfect", "biased_epochs",
    ]  # fmt: skip
    summed = {row["metric"]: row["iqm"] for row in tables.summary({cell: ours})}
    assert summed["corrected_nearness"] == ours["corrected_nearness"]
