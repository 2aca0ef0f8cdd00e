"""The front door: the same as the command line, bit for bit, and results that show themselves."""

import json

import numpy as np
import pytest

import evenhand
from evenhand.training.settings import TrainSettings
from support.refusals import refused

WORDS = ("--scenario", "minority", "--guidance", "levelup", "--epochs", "2", "--people", "30")


@pytest.fixture(scope="module")
def run():
    return evenhand.train("minority", "levelup", epochs=2, threads=1)


def test_every_public_name_is_listed_and_there():
    names = dir(evenhand)
    assert {"train", "evaluate", "compare", "audit", "score", "method", "World"} <= {*names}
    assert [name for name in names if not hasattr(evenhand, name)] == []


def test_submodules_do_not_hide_functions():
    import evenhand.audits
    import evenhand.methods

    assert callable(evenhand.audit)
    assert callable(evenhand.method)


def test_training_is_that_of_the_command_line(cli, run, tmp_path):
    assert cli("train", "--out", tmp_path / "run", *WORDS, "--threads", "1").code == 0
    lines = (tmp_path / "run" / "epochs.jsonl").read_text().splitlines()
    assert [json.loads(line) for line in lines] == list(run.epochs)
    kept = evenhand.train("minority", "levelup", epochs=2, out=tmp_path / "run", threads=1)
    assert kept.epochs == run.epochs
    assert kept.services == run.services


def test_a_test_is_that_of_the_command_line(cli, run, tmp_path):
    assert cli("train", "--out", tmp_path / "run", *WORDS).code == 0
    told = cli("evaluate", tmp_path / "run", "--services", "60", "--scenario", "tips", "--json")
    assert json.loads(told.out) == run.evaluate("tips", services=60).summary


def test_settings_are_those_of_the_command_line(run):
    settings = TrainSettings(scenario="minority", method="levelup", epochs=2)
    assert run.settings == settings
    again = evenhand.train(settings=settings, threads=1)
    assert again.epochs == run.epochs


def test_settings_and_a_single_one_contradict_each_other():
    with refused("conflict seed"):
        evenhand.train(settings=TrainSettings(), seed=1)


def test_results_show_themselves(run):
    assert run.frame["total"].tolist() == [line["total"] for line in run.epochs]
    assert repr(run).startswith("Run(method: levelup")
    assert "<table>" in run._repr_html_()
    assert len(run.plot().axes) == 2
    found = run.evaluate(services=60)
    assert found.frame["services"].sum() == 60 * 5  # everybody is in one group of each identity
    assert "perfect services" in repr(found)
    assert len(found.plot().axes) == 1


def test_rates_of_a_group_by_hand(run):
    found = run.evaluate(services=60)
    child = found.services.identity("age")[0] == 0
    row = next(row for row in found.groups if row["group"] == "Child")
    assert row["services"] == child.sum()
    ignored = found.services.fact("responded")[child] == 0.0
    assert row["willingness"] == pytest.approx(ignored.mean())


def test_scripted_robots_and_worlds_can_be_tested():
    world = evenhand.World(missed={"disability=Yes": 0.3})
    found = evenhand.evaluate("ageist", world, services=60)
    assert (found.who, found.world) == ("ageist", world)
    assert np.isfinite(found.summary["perfect_rate"])


def test_a_comparison(tmp_path):
    result = evenhand.compare(
        ["service", "levelup@2"], scenarios=["tips"], seeds=1, epochs=2, services=300,
        out=tmp_path / "out", workers=1,
    )  # fmt: skip
    frame = result.frame
    assert {*frame["arm"]} == {"service", "levelup@2"}
    assert len(result.summary) == 2
    assert "levelup@2 in tips, ppo" in repr(result)
    assert result.plot().axes
    page = result.report(tmp_path / "page.html").read_text()
    assert "level-up" in page
