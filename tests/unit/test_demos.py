"""Demonstrations of scripted robots, and the simulated study of them."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenhand.experiments.paper import demonstrations
from evenhand.experiments.paper.demonstrations import KINDS, Demos
from evenhand.methods.paper import detector
from evenhand.methods.paper.scores import score
from evenhand.methods.services import Services
from evenhand.methods.vocabulary import IDENTITIES

WINDOWS = 40


class TestDesign:
    def test_four_robots_take_turns_and_there_is_no_sexist_one(self):
        robot, _, _ = demonstrations.design(10, seed=1)
        named = [KINDS[code] for code in robot]
        assert named == [*("even", "racist", "ageist", "ableist") * 2, "even", "racist"]

    def test_six_in_ten_of_the_biased_windows_are_at_full_strength(self):
        robot, strength, _ = demonstrations.design(1000, seed=1)
        for code in (1, 2, 3):
            mine = strength[robot == code]
            assert (mine == 1.0).sum() == 150
            assert (mine[:150] == 1.0).all()
            assert mine[150:].min() < 0.05
            assert mine[150:].max() > 0.95
        assert (strength[robot == 0] == 0.0).all()

    def test_even_robots_err_alike_to_everybody(self):
        robot, _, sloppiness = demonstrations.design(1000, seed=1)
        assert (sloppiness[robot > 0] == 0.0).all()
        even = sloppiness[robot == 0]
        assert even.min() >= 0.0
        assert even.min() < 0.01
        assert 0.29 < even.max() <= 0.3

    def test_the_seed_decides(self):
        first, again, other = (demonstrations.design(100, seed)[1] for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, again)
        assert (first != other).any()


def run(folder: Path, windows: int = WINDOWS, seed: int = 5) -> list[tuple[int, dict[str, Any]]]:
    told: list[tuple[int, dict[str, Any]]] = []
    for task in demonstrations.tasks(windows, seed, "uniform", folder):
        task.run(tell=lambda units, numbers: told.append((units, numbers)), **task.arguments)
    return told


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("demonstrations")
    run(folder)
    return folder


@pytest.fixture(scope="module")
def made(folder) -> Demos:
    return demonstrations.load(WINDOWS, 5, folder)


class TestServices:
    def test_thirty_services_a_window_in_order(self, made):
        assert len(made.table) == 30 * WINDOWS
        np.testing.assert_array_equal(made.table.fact("service"), np.arange(30 * WINDOWS))
        np.testing.assert_array_equal(made.table.fact("epoch"), np.repeat(np.arange(WINDOWS), 30))
        named = made.table.fact("robot").reshape(WINDOWS, 30)
        assert named[:, 0].tolist() == [KINDS[code] for code in made.robot]
        assert (named == named[:, :1]).all()

    def test_each_robot_does_what_it_is_named_for(self, made):
        # strength 1, and 40 windows are too few for more than the plainest sign of each
        ignored = 1.0 - made.table.fact("responded").reshape(WINDOWS, 30).mean(axis=1)
        far = (made.table.fact("response_distance") > 1.5).reshape(WINDOWS, 30).mean(axis=1)
        full = made.strength == 1.0
        for code, share in ((1, ignored), (2, ignored), (3, far)):
            assert share[full & (made.robot == code)].mean() > 0.3
            assert share[made.robot == 0].mean() < 0.15

    def test_finished_parts_are_kept_and_missing_ones_made_alike(self, folder, made, tmp_path):
        names = sorted(os.listdir(folder))
        assert names == ["000000-000025.parquet", "000025-000040.parquet"]
        (tmp_path / names[0]).write_bytes((folder / names[0]).read_bytes())
        told = run(tmp_path)
        assert [units for units, _ in told] == [25 * 30, 15 * 30]
        assert told[0][1]["physics_steps"] == 0
        assert told[1][1]["physics_steps"] == made.table.fact("steps")[25 * 30 :].sum()
        assert demonstrations.load(WINDOWS, 5, tmp_path).table == made.table

    def test_another_seed_meets_other_people(self, made, tmp_path):
        run(tmp_path, windows=4, seed=6)
        other = demonstrations.load(4, 6, tmp_path).table
        assert (other.identity("race")[0] != made.table.identity("race")[0][:120]).any()


class TestStudy:
    @pytest.fixture(scope="class")
    @staticmethod
    def study(made) -> demonstrations.Study:
        return demonstrations.study(made, seed=5)

    def test_scores_are_those_of_each_window_and_identity(self, made, study):
        assert study.scores.shape == (WINDOWS, 4, 4)
        for w in (0, 1, 6, 39):
            alone = score(made.table.take(np.arange(30 * w, 30 * w + 30)))
            for i, name in enumerate(IDENTITIES):
                np.testing.assert_array_equal(study.scores[w, i], alone.by_identity[name])

    def test_a_biased_window_is_shown_about_its_robots_identity(self, made, study):
        named = np.array(IDENTITIES)[study.shown]
        for code, identity in ((1, "race"), (2, "age"), (3, "disability")):
            assert set(named[made.robot == code]) == {identity}
        assert len(set(named[made.robot == 0])) > 1
        np.testing.assert_array_equal(
            study.seen, [study.scores[w, i] for w, i in enumerate(study.shown)]
        )

    def test_every_respondent_judges_about_as_many(self, study):
        asked = np.bincount(study.who, minlength=24)
        assert len(asked) == 24
        assert asked.max() - asked.min() <= 1

    def test_simulated_respondents_are_called_so(self, study):
        assert study.detector.source == "simulated respondents"
        assert study.evaluation.source == "simulated respondents"
        assert study.evaluation.n == WINDOWS

    def test_the_same_seed_the_same_study(self, made, study):
        again = demonstrations.study(made, seed=5)
        np.testing.assert_array_equal(again.said.biased, study.said.biased)
        np.testing.assert_array_equal(again.shown, study.shown)
        assert again.detector == study.detector


def test_a_window_with_a_score_that_cannot_be_said_is_incomplete():
    scores = np.array([[0.5, 0.0, 0.0, 1.0], [0.5, np.nan, 0.0, 1.0], [np.nan] * 4])
    np.testing.assert_array_equal(detector.complete(scores), [True, False, False])


def test_means_of_rows_by_hand():
    rows = np.array([[1.0, 3.0, np.nan], [np.nan] * 3, [2.0, 2.0, 5.0]])
    np.testing.assert_array_equal(demonstrations.row_means(rows), [2.0, np.nan, 3.0])


def test_behaviour_counts_people_in_thirty():
    # two windows of the racist robot at full strength, one at half: 3 and 0 people are ignored
    person, window = np.tile(np.arange(30), 3), np.repeat(np.arange(3), 30)
    responded = (window != 0) | (person >= 3)
    table = Services.build(
        {},
        {
            "responded": responded,
            "response_distance": np.ma.array(np.where(person < 15, 1.0, 2.0), mask=~responded),
            "response_step": np.ma.array(np.where(window == 1, 50, 150), mask=~responded),
        },
    )
    found = demonstrations.behaviour(
        Demos(table, np.array([1, 1, 1]), np.array([1.0, 1.0, 0.5])), "racist"
    )
    assert found["ignore_rate"].tolist() == [3.0, 0.0]
    assert found["mean_response_distance"] == pytest.approx([(12 + 30) / 27, 1.5])
    assert found["mean_response_time"].tolist() == [150.0, 50.0]
