"""What people mind, from the command line to the gradient: demos, weights, training."""

import csv
import json
from pathlib import Path

import pytest

import evenhand as ev
from evenhand.core.errors import InputError
from evenhand.methods import issue_weights
from evenhand.methods.detector_file import SHIPPED

SHORT = ("--scenario", "hidden", "--epochs", 2, "--people", 8, "--algorithm", "ppo-all")


@pytest.mark.slow
def test_a_crowd_steers_a_robot(cli, tmp_path):
    words = ("--manners", "--minds", "too_near", "--windows", 300)
    ended = cli("demos", *words, "--out", "crowd")
    assert (ended.code, ended.err) == (0, "")
    assert "too_near" in ended.out
    answers = Path("crowd", "judgements.csv")
    with answers.open() as file:
        header = next(csv.reader(file))
    assert {"willingness", "too_near", "too_far", "priority", "risk", "biased"} <= {*header}
    words = ("--judges", answers, "--judges-source", "simulated respondents")
    ended = cli("train", *SHORT, *words, "--guidance", "levelup", "--out", "run")
    assert (ended.code, ended.err) == (0, "")
    noted = json.loads((tmp_path / "run" / "settings.json").read_text())["settings"]
    found = issue_weights.read(answers, "simulated respondents")
    assert noted["judges"]["tau"] == list(found.tau) == noted["tau"]
    assert noted["judges"]["source"] == "simulated respondents"
    run = ev.train("hidden", "levelup", algorithm="ppo-all", epochs=2, people=8, judges=found)
    assert run.settings.judges == found
    lines = (tmp_path / "run" / "epochs.jsonl").read_text().splitlines()
    assert [json.loads(one)["update_policy_loss"] for one in lines] == run.frame[
        "update_policy_loss"
    ].tolist()


@pytest.mark.slow
def test_a_detector_steers_as_well(cli, tmp_path):
    ended = cli("train", *SHORT, "--judges", SHIPPED, "--guidance", "influence", "--out", "run")
    assert (ended.code, ended.err) == (0, "")
    noted = json.loads((tmp_path / "run" / "settings.json").read_text())["settings"]
    assert noted["judges"]["tau"] == pytest.approx([1.09, 1.17, 0.75, 0.99], abs=0.01)


REFUSED = [
    (("--detector", SHIPPED, "--guidance", "levelup"), "asks for no verdict"),
    (("--judges", SHIPPED, "--judges-source", "friends"), "unknown judges-source 'friends'"),
    (("--judges", "nowhere.csv"), "nowhere.csv"),
    (("--judges", SHIPPED, "--tau", "1,1,1,2"), "tau and judges both give weights"),
]


@pytest.mark.parametrize(("words", "said"), REFUSED)
def test_what_steers_nothing_or_twice_is_refused(cli, tmp_path, words, said):
    ended = cli("train", "--epochs", 2, *words, "--out", "run")
    assert ended.code == 2
    assert said in ended.err
    assert not (tmp_path / "run").exists()


def test_minds_without_manners_are_refused(cli):
    ended = cli("demos", "--minds", "risk", "--out", "crowd")
    assert ended.code == 2
    assert "--manners" in ended.err


def test_an_unknown_issue_is_refused_before_anything_is_served(cli, tmp_path):
    ended = cli("demos", "--manners", "--minds", "closeness", "--out", "crowd")
    assert ended.code == 2
    assert "'closeness'" in ended.err
    assert not (tmp_path / "crowd").exists()


def test_from_python_a_detector_that_steers_nothing_is_refused():
    with pytest.raises(InputError) as refused:
        ev.train("even", "levelup", epochs=1, detector=SHIPPED)
    assert (refused.value.kind, refused.value.field) == ("unsupported", "detector")


@pytest.mark.slow
def test_a_reversed_detector_is_warned_of(cli, tmp_path):
    rows = ["willingness,quality,priority,risk,biased"]
    rows += [f"{x},{x},{x},{x},{'no' if x > 0.3 else 'yes'}" for x in [i / 40 for i in range(40)]]
    (tmp_path / "answers.csv").write_text("\n".join(rows) + "\n")
    ended = cli("detect", "fit", "--answers", "answers.csv", "--out", "reversed.json")
    assert ended.code == 0
    assert "warning: it judges" in ended.err
    assert "otherwise than the detector that comes with Evenhand" in ended.err
    ended = cli("train", "--epochs", 2, "--judges", "reversed.json", "--out", "run")
    assert ended.code == 2
    assert "check the column biased" in ended.err
