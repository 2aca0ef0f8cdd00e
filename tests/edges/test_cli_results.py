"""What commands give that make no folder: the numbers that they show, and the files."""

import csv
import json

import pytest

from evenhand.cli.evaluate import told
from evenhand.methods.vocabulary import ISSUES
from evenhand.restaurant.robots import BIASES


@pytest.mark.slow
def test_a_scripted_robot_is_measured(cli, tmp_path):
    words = ("--services", 60, "--seed", 3, "--json")
    ended = cli("evaluate", "--robot", "even", *words, "--out", "services.csv")
    assert (ended.code, ended.err) == (0, "")
    found = json.loads(ended.out)
    with (tmp_path / "services.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == found["services"] == 60
    answered = [row for row in rows if row["responded"] == "true"]
    assert found["response_rate"] == len(answered) / 60
    for fact, name in (
        ("response_distance", "mean_response_distance"),
        ("response_step", "mean_response_time"),
    ):
        mean = sum(float(row[fact]) for row in answered) / len(answered)
        assert found[name] == pytest.approx(mean, rel=1e-12)
    seconds = sum(int(row["steps"]) for row in rows) / 60 * 0.02
    assert found["mean_service_seconds"] == pytest.approx(seconds, rel=1e-12)
    assert cli("evaluate", "--robot", "even", *words).out == ended.out


def test_what_was_measured_is_told_with_units_and_numbers():
    found = {
        "services": 60, "total": 0.5, "willingness": 0.1, "quality": 0.2, "priority": 0.15,
        "risk": 0.05, "floor": 0.45, "pooled_total": None, "perfect_rate": 0.9,
        "worst_group_rate": 0.5, "response_rate": 0.95, "mean_response_distance": 1.254,
        "mean_response_time": 45.25, "mean_service_seconds": 2.004,
    }  # fmt: skip
    rows = {name: (value, of) for name, value, of in told(found, ISSUES)}
    few = {name: value for name, value, _ in told(found | {"worst_group_rate": None}, ISSUES)}
    assert few["perfect services, worst-served group"] == "missing"
    assert len(rows) == 13
    assert rows["total issue score"] == ("0.500", "2 windows of 30 services")
    assert rows["total of all services as one window"] == ("missing", "60 services")
    # statsmodels.stats.proportion.proportion_confint(54, 60, method="wilson")
    assert rows["perfect services"] == ("90.0 % [79.9, 95.3]", "60 services")
    assert rows["perfect services, worst-served group"] == ("50.0 %", "groups of 30 or more")
    # 45.25 steps of 0.02 s, and 57 of 60
    assert rows["mean response time"] == ("0.91 s", "57 responses")
    assert rows["mean response distance"] == ("1.25 m", "57 responses")


@pytest.mark.slow
def test_odds_are_searched_and_written(cli, tmp_path):
    words = ("calibrate", "--robot", "ableist", "--services", 30, "--windows", 20, "--rounds", 1)
    ended = cli(*words, "--seed", 7, "--out", "new/odds.json")
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.endswith("new/odds.json\n")
    noted = json.loads((tmp_path / "new" / "odds.json").read_text())
    assert noted["command"].startswith("evenhand calibrate --robot ableist --services 30")
    assert noted["settings"] == {
        "robot": "ableist", "seed": 7, "rounds": 1, "services": 30, "windows": 20,
    }  # fmt: skip
    assert list(noted["robots"]) == ["ableist"]
    found, used = noted["robots"]["ableist"]["found"], noted["robots"]["ableist"]["used"]
    assert tuple(used["odds_worse"]) == BIASES["ableist"].odds_worse
    shown = [line.replace("│", " ").split() for line in ended.out.splitlines()]
    for k, issue in enumerate(noted["issues"]):
        target = noted["robots"]["ableist"]["target"][k]
        numbers = (target, found["score"][k], found["score"][k] - target, used["score"][k])
        assert ["ableist", issue, *(f"{number:.3f}" for number in numbers)] in shown
    for measure, name in (
        ("mean distance (m)", "mean_response_distance"),
        ("mean time (steps)", "mean_response_time"),
        ("ignored", "ignored"),
    ):
        row = ["ableist", *measure.split(), f"{found[name]:.3f}", f"{used[name]:.3f}"]
        assert row in shown
    for who, odds in (("served worse", "odds_worse"), ("others", "odds_others")):
        assert ["ableist", *who.split(), *(f"{p:.3f}" for p in found[odds])] in shown
        assert sum(found[odds]) < 1.005
    # the same seed, the same odds; without a file they are shown all the same
    again = cli(*words, "--seed", 7)
    assert again.out + "new/odds.json\n" == ended.out


@pytest.mark.slow
def test_alarms_are_written_and_the_same_seed_gives_the_same(cli, tmp_path):
    words = ("alarms", "--windows", 100, "--seed", 5, "--out")
    said = cli(*words, tmp_path / "a")
    assert said.code == 0
    names = ["false_alarms.csv", "power.csv", "alarms.svg", "alarms.pdf"]
    assert said.out.split()[-4:] == [str(tmp_path / "a" / name) for name in names]
    assert cli(*words, tmp_path / "b").code == 0
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    with (tmp_path / "a" / "false_alarms.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["size"] for row in rows] == ["30", "120", "300", "1000"]
    # chance alone gives an epoch of 30 a raw total far above the paper's threshold
    assert float(rows[0]["raw"]) > 0.9
    # 100 windows at a level of at most 5 %: fewer than 15 with a probability above 0.9999
    assert all(float(row["verdict"]) < 0.15 for row in rows)
