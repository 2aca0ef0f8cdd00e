"""Tables of the experiment by hand."""

import csv
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from evenhand.experiments.paper import tables
from evenhand.experiments.paper.corrected_detector import Record
from evenhand.experiments.paper.demonstrations import Demos, Study
from evenhand.methods.services import Services
from evenhand.report.table import write
from evenhand.restaurant.people import IDENTITIES
from evenhand.statistics.detector_accuracy import CalibrationBin, wilson
from evenhand.study.simulated.respondents import NAMEABLE, Judgements, Questionnaire
from support.refusals import refused

NAN = np.nan


class TestWriting:
    def test_cells_by_their_letters(self, tmp_path):
        rows: list[dict[str, Any]] = [
            {"a": 1, "b": 0.1, "c": True, "d": None, "e": "x, y"},
            {
                "a": np.int64(2),
                "b": np.float64(1 / 3),
                "c": np.bool_(False),
                "d": NAN,
                "e": 'a "b"',
            },
        ]
        write(tmp_path / "t.csv", rows)
        assert (tmp_path / "t.csv").read_text() == (
            'a,b,c,d,e\n1,0.1,true,,"x, y"\n2,0.3333333333333333,false,,"a ""b"""\n'
        )

    def test_columns_that_are_chosen(self, tmp_path):
        rows = iter([{"a": 1, "b": 2}, {"a": 3}])
        write(tmp_path / "t.csv", rows, ["b", "a"])
        assert (tmp_path / "t.csv").read_text() == "b,a\n2,1\n,3\n"

    def test_numbers_come_back_as_they_were(self, tmp_path):
        numbers = [0.1 + 0.2, 1e-300, -1.5, np.float32(0.1)]
        write(tmp_path / "t.csv", ({"x": x} for x in numbers))
        with (tmp_path / "t.csv").open() as file:
            assert [float(row["x"]) for row in csv.DictReader(file)] == [float(x) for x in numbers]

    def test_nowhere(self, tmp_path):
        with refused("unavailable file", "t.csv"):
            write(tmp_path / "no" / "t.csv", [{"a": 1}])


@pytest.mark.parametrize("categories", [2, 3, 5, 6])
def test_the_ceiling_is_the_best_of_all_rates_of_0_and_1(categories):
    best = 0.0
    for rates in product([0.0, 1.0], repeat=categories):
        others = [(sum(rates) - rate) / (categories - 1) for rate in rates]
        gaps = [abs(rate - other) for rate, other in zip(rates, others, strict=True)]
        best = max(best, sum(gaps) / categories)
    assert tables.ceiling(categories) == pytest.approx(best)


def made_demos() -> Demos:
    """One even window, and three of the ableist robot: two at full strength, one at half.

    Disabled people are 10 of the 30 in the first window at full strength and 20 in the second.
    All of them are served from 2 m, and in the first two of them are not served at all. At half
    strength nobody is served.
    """
    window, person = np.repeat(np.arange(4), 30), np.tile(np.arange(30), 4)
    disabled = (window < 2) & (person < 10) | (window == 2) & (person < 20) | (window == 3)
    full = (window == 1) | (window == 2)
    responded = ~((window == 1) & (person < 2)) & (window != 3)
    distance = np.where(full & disabled, 2.0, 1.25)
    codes = np.zeros((120, 5), int)
    codes[:, 3] = np.where(disabled, 0, 1)
    table = Services.build(
        {one.name: (codes[:, i], one.groups) for i, one in enumerate(IDENTITIES)},
        {
            "responded": responded,
            "response_step": np.ma.array(np.where(full & disabled, 220, 100), mask=~responded),
            "response_distance": np.ma.array(distance, mask=~responded),
            "min_distance": np.where(responded, distance, 0.4),
        },
    )
    return Demos(table, np.array([0, 3, 3, 3]), np.array([0.0, 1.0, 1.0, 0.5]))


def only(demos: Demos, kind: str, monkeypatch) -> Demos:
    """Leave the other biased robots out of the tables."""
    monkeypatch.setattr(tables, "KINDS", ("even", kind))
    return demos


class TestRobots:
    def test_signatures_by_hand(self, monkeypatch):
        rows = tables.signatures(only(made_demos(), "ableist", monkeypatch))
        assert [row["issue"] for row in rows] == ["willingness", "quality", "priority", "risk"]
        assert {row["discrimination"] for row in rows} == {"ableism"}
        assert [row["paper"] for row in rows] == [0.05, 0.66, 0.0, 0.0]
        # 2 of 10 against 0 of 20, then nobody: mean 0.1; both others are all against none
        assert [row["ours"] for row in rows] == pytest.approx([0.1, 1.0, 1.0, 0.1])
        half = 1.96 * (0.2 / np.sqrt(2)) / np.sqrt(2)
        assert 0.1 - half < 0
        assert rows[0]["ci_low"] == 0  # where scores end
        assert rows[0]["ci_high"] == pytest.approx(0.1 + half)
        assert {row["windows"] for row in rows} == {2}
        # two categories can differ wholly; of quality and priority no ceiling can be said
        assert [row["ceiling"] for row in rows] == [1.0, None, None, 1.0]

    def test_behaviour_by_hand(self, monkeypatch):
        rows = tables.behaviour(only(made_demos(), "ableist", monkeypatch))
        found = {row["measure"]: row for row in rows}
        # 8 of 28 responses from 2 m, 20 of 30; the same people after 220 steps; 2 and 0 ignored
        metres = np.mean([1.25 + 0.75 * 8 / 28, 1.25 + 0.75 * 20 / 30])
        steps = np.mean([100 + 120 * 8 / 28, 100 + 120 * 20 / 30])
        assert found["mean_response_distance"]["value"] == pytest.approx(metres)
        assert found["mean_response_time"]["value"] == pytest.approx(steps)
        assert found["ignore_rate"]["value"] == pytest.approx(1.0)
        assert found["mean_response_distance"]["paper"] == 1.89
        assert found["mean_response_time"]["paper"] is None
        assert found["ignore_rate"]["unit"] == "people in 30"
        assert {row["services"] for row in rows} == {60}

    def test_the_papers_figures(self):
        assert tables.PAPER_BEHAVIOUR == {
            ("ableist", "mean_response_distance"): 1.89,
            ("ageist", "mean_response_time"): 124.93,
            ("racist", "ignore_rate"): 4.36,
        }
        assert tables.PAPER_SHARES == {(1, "race"): 0.357, (4, "disability"): 0.214}


def made_study() -> Study:
    """Four judged windows by two simulated respondents, and a detector's evaluation."""
    empty = wilson(0, 0)
    evaluation = SimpleNamespace(
        n=4,
        accuracy=wilson(3, 4),
        agreement=wilson(4, 4),
        manual_accuracy=wilson(2, 4),
        brier=0.125,
        calibration=(
            CalibrationBin(0.0, 0.1, 0.05, wilson(1, 2)),
            CalibrationBin(0.1, 0.2, NAN, empty),
        ),
        kind_names=("ableism", "racism"),
        confusion=np.array([[5, 1], [0, 7]]),
    )
    study = SimpleNamespace(
        scores=np.arange(64.0).reshape(4, 4, 4) / 100,
        shown=np.array([0, 3, 1, 2]),
        who=np.array([0, 1, 0, 11]),
        said=Judgements(
            np.array([False, True, True, False]), np.array([-1, 3, 0, -1]), np.array([-1, 1, 3, -1])
        ),
        questionnaire=Questionnaire(
            np.repeat([1, 2, 3, 4], 4),
            np.tile(np.arange(4), 4),
            ("race", "race", "age", "skin") * 3 + ("disability",) * 4,
            ("willingness",) * 12 + ("risk", "risk", "risk", "quality"),
        ),
        evaluation=evaluation,
    )
    study.seen = study.scores[np.arange(4), study.shown]
    return cast(Study, study)


class TestStudy:
    def test_questionnaire_by_hand(self):
        named, worst = tables.questionnaire(made_study())
        assert len(named) == 4 * len(NAMEABLE)
        assert len(worst) == 16
        first = {row["identity"]: row for row in named if row["scenario"] == "1"}
        assert first["race"]["count"] == 2
        assert first["race"]["share"] == 0.5
        assert first["race"]["respondents"] == 4
        assert first["race"]["paper_share"] == 0.357
        assert first["gender"] == {**first["gender"], "count": 0, "share": 0.0, "paper_share": None}
        last = {row["issue"]: row["share"] for row in worst if row["scenario"] == "4"}
        assert last == {"willingness": 0.0, "quality": 0.25, "priority": 0.0, "risk": 0.75}

    def test_judgements_by_hand(self):
        rows = tables.judgements(made_demos(), made_study())
        assert [row["robot"] for row in rows] == ["even", "ableist", "ableist", "ableist"]
        assert [row["strength"] for row in rows] == [0.0, 1.0, 1.0, 0.5]
        assert [row["respondent"] for row in rows] == [
            "simulated-00", "simulated-01", "simulated-00", "simulated-11",
        ]  # fmt: skip
        assert [row["shown"] for row in rows] == ["race", "disability", "gender", "age"]
        assert [row["biased"] for row in rows] == [False, True, True, False]
        assert [row["identity"] for row in rows] == ["", "disability", "race", ""]
        assert [row["issue"] for row in rows] == ["", "quality", "risk", ""]
        # window 1 was shown about disability: 16 + 3·4 and the three after it, in hundredths
        scores = [rows[1][name] for name in ("willingness", "quality", "priority", "risk")]
        assert scores == [0.28, 0.29, 0.30, 0.31]
        assert rows[1]["total"] == pytest.approx(1.18)

    def test_detector_by_hand(self):
        performance, calibration, confusion = tables.detector(made_study())
        assert [(row["metric"], row["value"], row["n"]) for row in performance] == [
            ("accuracy", 0.75, 4),
            ("threshold_agreement", 1.0, 4),
            ("threshold_accuracy", 0.5, 4),
            ("brier", 0.125, 4),
        ]
        assert calibration[0] == {
            "bin": "0.0-0.1",
            "predicted": 0.05,
            "observed": 0.5,
            "ci_low": wilson(1, 2).low,
            "ci_high": wilson(1, 2).high,
            "n": 2,
        }
        assert calibration[1]["n"] == 0
        assert {calibration[1][name] for name in ("predicted", "observed", "ci_low")} == {None}
        assert [tuple(row.values()) for row in confusion] == [
            ("ableism", "ableism", 5),
            ("ableism", "racism", 1),
            ("racism", "ableism", 0),
            ("racism", "racism", 7),
        ]

    def test_judges_by_hand(self):
        raw = Record(
            "raw", wilson(3, 4), wilson(2, 4), wilson(1, 2), 0.125,
            (CalibrationBin(0.0, 0.1, 0.05, wilson(1, 2)),
             CalibrationBin(0.1, 0.2, NAN, wilson(0, 0))),
        )  # fmt: skip
        threshold = Record("threshold", wilson(4, 4), None, wilson(0, 2))
        rows = tables.judges([raw, threshold])
        assert [(row["judge"], row["measure"], row["value"], row["n"]) for row in rows] == [
            ("raw", "accuracy", 0.75, 4),
            ("raw", "agreement", 0.5, 4),
            ("raw", "false_alarms", 0.5, 2),
            ("raw", "brier", 0.125, 4),
            ("raw", "calibration", 0.5, 2),
            ("raw", "calibration", None, 0),
            ("threshold", "accuracy", 1.0, 4),
            ("threshold", "false_alarms", 0.0, 2),
        ]
        assert (rows[0]["ci_low"], rows[0]["ci_high"]) == (wilson(3, 4).low, wilson(3, 4).high)
        assert [(row["bin"], row["predicted"]) for row in rows[4:6]] == [
            ("0.0-0.1", 0.05),
            ("0.1-0.2", None),
        ]
        assert all(set(row) <= set(tables.JUDGES_COLUMNS) for row in rows)

    def test_tsne_keeps_like_windows_together(self):
        # two heaps of scores, far from each other
        rng = np.random.default_rng(1)
        heap = np.repeat([0.1, 0.9], 15)
        seen = np.clip(heap[:, None] + rng.normal(0, 0.02, (30, 4)), 0, 1)
        seen[0, 0] = NAN
        robot = np.where(heap > 0.5, 3, 0)
        demos = Demos(made_demos().table, robot, np.ones(30))
        said = Judgements(heap > 0.5, np.zeros(30, int), np.zeros(30, int))
        rows = tables.tsne(demos, cast(Study, SimpleNamespace(seen=seen, said=said)), seed=3)
        # a window with a score that cannot be said is left out
        assert [row["window"] for row in rows] == [str(w) for w in range(1, 30)]
        assert [row["kind"] for row in rows] == ["even"] * 14 + ["ableism"] * 15
        assert [row["biased"] for row in rows] == [False] * 14 + [True] * 15
        place = np.array([[row[axis] for axis in "xyz"] for row in rows])
        apart = np.linalg.norm(place[:, None] - place, axis=-1) + np.diag(np.full(29, np.inf))
        # whoever is next to a window is of its heap; by chance that holds for every other one
        assert (heap[1:][apart.argmin(axis=1)] == heap[1:]).mean() > 0.85


RUN = {"preset": "service", "arm": "ppo+levelup", "seed": 2}


class TestReflection:
    def line(self, epoch: int, **more: Any) -> dict[str, Any]:
        found = {
            "cosine": 0.5, "projection": 0.25, "z": None, "p": 0.75, "alarm": False,
            "identity": None, "issue": None, "favoured": None, "z_risk": 3.0,
        } | more  # fmt: skip
        return {"epoch": epoch, "total": 1.0} | {f"reflection_{k}": v for k, v in found.items()}

    def test_by_hand(self, tmp_path):
        named = {"identity": "age", "issue": "risk", "favoured": "Child, Elder"}
        lines = [self.line(0), self.line(7, p=0.125, alarm=True, z=2.5, **named)]
        rows = tables.reflection(RUN, lines, {"rate": 0.25, "history": 5})
        write(tmp_path / "t.csv", rows, tables.REFLECTION_COLUMNS)
        assert (tmp_path / "t.csv").read_text() == (
            "preset,arm,seed,epoch,projection,cosine,z,p_value,alarm,identity,issue,favoured,"
            "earlier,rate\n"
            "service,ppo+levelup,2,0,0.25,0.5,,0.75,false,,,,0,0.25\n"
            'service,ppo+levelup,2,7,0.25,0.5,2.5,0.125,true,age,risk,"Child, Elder",5,0.25\n'
        )

    def test_a_run_without_it_has_no_rows(self):
        assert tables.reflection(RUN, [{"epoch": 0, "total": 1.0}], {}) == []

    def test_no_rows_are_a_header(self, tmp_path):
        write(tmp_path / "t.csv", [], ("a", "b"))
        assert (tmp_path / "t.csv").read_text() == "a,b\n"
