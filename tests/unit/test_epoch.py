"""An epoch is counted without a table in between, and comes out as its table would."""

import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.methods.paper import issues
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import membership, score
from evenhand.restaurant import people
from evenhand.restaurant.scenarios import sensing
from evenhand.restaurant.simulation import layout, serve, task
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.training import epoch

DETECTOR = detector_file.load(detector_file.SHIPPED)


@pytest.fixture(scope="module")
def served() -> tuple[layout.Setups, serve.Services]:
    rng = np.random.default_rng(5)
    setups = layout.draw(people.population("uniform"), 40, rng)

    def robot(seen: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Half of the people are never answered."""
        return np.where(rows % 2 == 0, 0.06, 0.0)

    return setups, serve.serve(
        Lanes(16, task.TaskSettings()), setups, robot, rng, sensing.SenseSettings()
    )


def test_issues_and_groups_are_those_of_the_table(served):
    setups, done = served
    found = epoch.judged_by(done, setups.asking, DETECTOR)
    table = serve.record(done.facts, setups.asking, epoch=0, scenario="even", robot="none")
    who = membership(table)
    assert who.groups == tuple(people.GROUPS)
    np.testing.assert_array_equal(found.inside, who.inside)
    np.testing.assert_array_equal(found.x, issues.indicators(table))
    assert {0.0, 1.0, -1.0} == {*np.nan_to_num(found.x, nan=-1.0).ravel()}


def test_scores_and_verdict_are_those_of_the_table(served):
    setups, done = served
    found = epoch.judged_by(done, setups.asking, DETECTOR)
    table = serve.record(done.facts, setups.asking, epoch=0, scenario="even", robot="none")
    wanted = score(table)
    np.testing.assert_array_equal(found.scores.overall, wanted.overall)
    said = DETECTOR.judge_window({name: wanted.by_identity[name] for name in DETECTOR.identities})
    np.testing.assert_array_equal(found.verdict.probability, said.probability)
    assert found.biased is bool(said.biased)


def test_nobody_is_judged_before_it_is_asked_for(served, monkeypatch):
    setups, done = served
    asked = []
    judge = Detector.judge_window

    def noted(self, scores):
        asked.append(scores)
        return judge(self, scores)

    monkeypatch.setattr(Detector, "judge_window", noted)
    found = epoch.judged_by(done, setups.asking, DETECTOR)
    assert found.scores.total >= 0
    assert not asked
    assert [found.biased, found.biased] == [bool(found.verdict.biased)] * 2
    assert len(asked) == 1
