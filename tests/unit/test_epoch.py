"""An epoch is counted without a table in between, and comes out as its table would."""

import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.methods.epoch import Epoch
from evenhand.methods.paper import issues, scores
from evenhand.methods.paper.detector import Detector
from evenhand.restaurant import people, serve_people
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.worlds import World
from evenhand.training import epoch
from evenhand.training.memory import Memory
from evenhand.training.settings import TrainSettings

WORLD = World()
DETECTOR = detector_file.load(detector_file.SHIPPED)


@pytest.fixture(scope="module")
def served() -> serve.Trajectories:
    def robot(seen: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Half of the people are never answered."""
        return np.where(rows % 2 == 0, 0.06, 0.0)

    return serve_people.serve_people(WORLD, robot, 40, np.random.default_rng(5))


def epoch_of(served: serve.Trajectories) -> Epoch:
    settings = TrainSettings(people=40)
    guard = Memory.begin(settings).guard
    return epoch.epoch_of(settings, served, DETECTOR, np.zeros(served.mask.shape), guard)[0]


def test_issues_and_groups_are_those_of_the_table(served):
    found = epoch_of(served)
    table = serve_people.table(served, WORLD, "none")
    who = scores.membership(table)
    assert who.groups == tuple(people.GROUPS)
    np.testing.assert_array_equal(found.inside, who.inside)
    np.testing.assert_array_equal(found.x, issues.indicators(table))
    assert {0.0, 1.0, -1.0} == {*np.nan_to_num(found.x, nan=-1.0).ravel()}


def test_scores_and_verdict_are_those_of_the_table(served):
    found = epoch_of(served)
    table = serve_people.table(served, WORLD, "none")
    wanted = scores.score(table)
    np.testing.assert_array_equal(found.scores.overall, wanted.overall)
    said = DETECTOR.judge_window({name: wanted.by_identity[name] for name in DETECTOR.identities})
    np.testing.assert_array_equal(found.verdict.probability, said.probability)
    assert found.biased is bool(said.biased)


def test_nobody_is_judged_before_it_is_asked_for(served, monkeypatch):
    asked = []
    judge = Detector.judge_window

    def noted(self, scores):
        asked.append(scores)
        return judge(self, scores)

    monkeypatch.setattr(Detector, "judge_window", noted)
    found = epoch_of(served)
    assert found.scores.total >= 0
    assert not asked
    assert [found.biased, found.biased] == [bool(found.verdict.biased)] * 2
    assert len(asked) == 1
