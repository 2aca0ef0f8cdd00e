"""What is drawn, by hand for small tables; the drawing itself shows the same numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from evenhand.experiments.paper.report.figures import PLATES
from evenhand.experiments.paper.report.figures_biased import (
    biased_data,
    biased_draw,
    zoom_caption,
    zoom_data,
)
from evenhand.experiments.paper.report.figures_detector import calibration_caption, confusion_data
from evenhand.experiments.paper.report.figures_learning import curve_data, score_draw
from evenhand.experiments.paper.report.figures_scores import scores_data, scores_draw
from evenhand.experiments.paper.report.figures_study import (
    behaviour_data,
    questionnaire_data,
    questionnaire_draw,
    signatures_caption,
    signatures_data,
)
from evenhand.experiments.paper.report.results import SCHEMAS
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import arms_in
from evenhand.report.table import Table, table

NAN = math.nan


def rows_of(name: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """A table of the schema in which cells that do not matter have an innocent value."""
    innocent = {"text": "x", "int": 1, "number": 0.0, "share": 0.0, "flag": 0.0}
    columns = SCHEMAS[name]
    filler = {
        column: NAN if kind.endswith("?") and kind != "text?" else innocent[kind.strip("?")]
        for column, kind in columns.items()
    }
    return table(list(columns), [[{**filler, **row}[column] for column in columns] for row in rows])


def results_of(**tables: Table) -> Results:
    return Results(tables, {"people": 30}, [])


def epoch(arm: str, seed: int, at: int, total: float, **more: Any) -> dict[str, Any]:
    return {"preset": "paper", "arm": arm, "seed": seed, "epoch": at, "total": total, **more}


def drawn_lines(figure: Figure) -> list[list[float]]:
    """The y values of every line of the figure."""
    return [np.asarray(line.get_ydata()).tolist() for ax in figure.axes for line in ax.lines]


def drawn_points(figure: Figure) -> set[tuple[float, float]]:
    """Every single mark of the figure, rounded."""
    marks = (line.get_xydata() for ax in figure.axes for line in ax.lines)
    return {tuple(np.round(xy[0], 6).tolist()) for xy in map(np.asarray, marks) if len(xy) == 1}


def test_curve_is_mean_range_and_running_mean() -> None:
    results = results_of(
        epochs=rows_of(
            "epochs",
            [
                epoch("ppo", 0, 1, 0.2),
                epoch("ppo", 0, 2, 0.4),
                epoch("ppo", 1, 1, 0.6),
                epoch("ppo", 1, 2, NAN),
            ],
        )
    )
    data = curve_data(results, "total")
    # epoch 1: (0.2 + 0.6) / 2; epoch 2: 0.4 alone; running mean at 2: (0.4 + 0.4) / 2
    assert [list(row.values()) for row in data.rows()] == [
        ["paper", "ppo", 1, 2, pytest.approx(0.4), 0.2, 0.6, pytest.approx(0.4)],
        ["paper", "ppo", 2, 1, 0.4, 0.4, 0.4, pytest.approx(0.4)],
    ]
    with style.drawing():
        figure = score_draw(data, True)
    assert [pytest.approx(0.4)] * 2 in drawn_lines(figure)


def test_a_curve_that_is_nowhere_defined_stays_undefined() -> None:
    data = curve_data(results_of(epochs=rows_of("epochs", [epoch("ppo", 0, 1, NAN)])), "total")
    assert data["seeds"].tolist() == [0]
    assert np.isnan(data["mean"]).all()


def test_the_running_mean_spans_forty_epochs() -> None:
    rows = [epoch("ppo", 0, at, float(at <= 10)) for at in range(1, 61)]
    smooth = curve_data(results_of(epochs=rows_of("epochs", rows)), "total")["mean_of_40_epochs"]
    assert smooth[9] == 1.0  # ten ones
    assert smooth[39] == pytest.approx(10 / 40)  # epochs 1 to 40
    assert smooth[44] == pytest.approx(5 / 40)  # epochs 6 to 45
    assert smooth[59] == 0.0  # epochs 21 to 60


def test_biased_epochs_are_counted_by_seed_and_compared_with_the_paper() -> None:
    flags = {0: [1.0, 1.0, 0.0], 1: [0.0, 1.0, NAN]}
    rows = [
        epoch("ppo", seed, at, 0.1, biased_detector=flag, biased_threshold=0.0)
        for seed, flagged in flags.items()
        for at, flag in enumerate(flagged, start=1)
    ]
    data = biased_data(results_of(epochs=rows_of("epochs", rows)))
    detector = {row["seed"]: row for row in data.where(judge="detector").rows()}
    assert (detector["0"]["biased_epochs"], detector["0"]["judged_epochs"]) == (2, 3)
    assert (detector["1"]["biased_epochs"], detector["1"]["judged_epochs"]) == (1, 2)
    # mean 1.5, s = 1/sqrt(2), t(1) = 12.7062, half = 6.3531: from less than 0 to more than all
    assert detector["mean"]["biased_epochs"] == 1.5
    assert (detector["mean"]["ci_low"], detector["mean"]["ci_high"]) == (0, 3)  # of 3 epochs
    assert detector["mean"]["paper"] == pytest.approx(54 * 3 / 300)
    assert np.isnan(data.where(judge="threshold")["paper"]).all()
    with style.drawing():
        figure = biased_draw(data, True)
    assert {(1.5, -0.15), (0.54, -0.35), (2.0, -0.02), (1.0, -0.02)} <= drawn_points(figure)
    assert figure.axes[0].get_xlim() == (0, 3)


@pytest.mark.parametrize("wide", [True, False])
def test_biased_epochs_have_a_line_for_every_arm_that_ran(wide: bool) -> None:
    ran = [("paper", "ppo"), ("service", "ppo"), ("service", "ppo+levelup")]
    rows = [
        epoch(arm, 0, at, 0.1, biased_detector=1.0, biased_threshold=0.0) | {"preset": preset}
        for preset, arm in ran
        for at in (1, 2)
    ]
    data = biased_data(results_of(epochs=rows_of("epochs", rows)))
    with style.drawing():
        figure = biased_draw(data, wide)
    labels = [[label.get_text() for label in ax.get_yticklabels()] for ax in figure.axes]
    assert labels == [["PPO"], ["PPO", "PPO\n+ level-up"]]


def test_zoom_takes_the_seed_and_the_epochs_with_most_detections() -> None:
    def flagged(arm: str, seed: int, biased: range) -> list[dict[str, Any]]:
        return [
            epoch(arm, seed, at, 0.5, biased_detector=float(at in biased)) for at in range(1, 101)
        ]

    rows = flagged("ppo", 0, range(1, 6)) + flagged("ppo+guidance", 0, range(1, 6))
    rows += flagged("ppo", 1, range(50, 80)) + flagged("ppo+guidance", 1, range(89, 90))
    rows += flagged("reinforce", 0, range(1, 100))  # not shown, so not counted
    results = results_of(epochs=rows_of("epochs", rows))
    data = zoom_data(results)
    # seed 1; the first 40 epochs that hold all of 50 to 79 and 89 begin at 50
    assert set(data["seed"].tolist()) == {1}
    assert (data["epoch"].min(), data["epoch"].max()) == (50, 89)
    assert set(data["arm"].tolist()) == {"ppo", "ppo+guidance"}
    assert "paper, PPO: 30 of 40; paper, PPO + guidance: 1 of 40" in zoom_caption(results, data)


def test_zoom_without_ppo_is_left_out() -> None:
    test = results_of(epochs=rows_of("epochs", [epoch("reinforce", 0, 1, 0.5)]))
    assert len(zoom_data(test)) == 0


def test_test_scores_have_seeds_interval_and_floor() -> None:
    rows = [
        {"preset": "service", "arm": "ppo", "seed": seed, "total": total, "floor": floor}
        | {"perfect_rate": 0.9, "willingness": NAN}
        for seed, total, floor in ((0, 0.1, 0.04), (1, 0.3, 0.06))
    ]
    data = scores_data(results_of(test=rows_of("test", rows)))
    total = {row["seed"]: row for row in data.where(measure="total").rows()}
    assert set(total) == {"mean", "0", "1"}
    assert total["mean"]["value"] == pytest.approx(0.2)
    # s = 0.1414, t(1) = 12.7062, half = 12.7062 * 0.1 = 1.27062; no total lies below 0
    assert total["mean"]["ci_low"] == 0
    assert total["mean"]["ci_high"] == pytest.approx(0.2 + 1.27062, abs=1e-5)
    assert total["mean"]["chance_floor"] == pytest.approx(0.05)
    assert np.isnan(data.where(measure="willingness")["value"]).all()
    assert np.isnan(data.where(measure="risk")["chance_floor"]).all()
    with style.drawing():
        figure = scores_draw(data, True)
    assert [pytest.approx(0.05)] * 2 in drawn_lines(figure)
    # one arm: its mean stands at x = 0, its seeds beside it; perfect services are per cent
    assert {(0.0, 0.2), (0.065, 0.1), (0.065, 0.3), (0.0, 90.0)} <= drawn_points(figure)


def test_questionnaire_counts_the_simulated_judgements() -> None:
    asked = [
        {"scenario": "1", "scenario_name": "First", "identity": "race", "share": 0.25, "count": 6}
        | {"respondents": 24, "paper_share": 0.357},
        {"scenario": "1", "scenario_name": "First", "identity": "none", "share": 0.75, "count": 18}
        | {"respondents": 24},
    ]
    issues = [{"scenario": "1", "scenario_name": "First", "issue": "risk", "share": 1, "count": 24}]
    judged = [
        {"identity": identity, "issue": issue}
        for identity, issue in (("race", "risk"), ("", ""), ("race", "quality"), ("age", "risk"))
    ]
    results = results_of(
        questionnaire=rows_of("questionnaire", asked),
        questionnaire_issue=rows_of("questionnaire_issue", issues),
        judgements=rows_of("judgements", judged),
    )
    data = questionnaire_data(results)
    shares = {
        (row["question"], row["scenario"], row["answer"]): row["share"] for row in data.rows()
    }
    assert shares["identity", "1", "race"] == 0.25
    race = next(row for row in data.rows() if row["answer"] == "race")
    # statsmodels.stats.proportion.proportion_confint(6, 24, method="wilson")
    assert (race["ci_low"], race["ci_high"]) == pytest.approx((0.1200, 0.4490), abs=1e-4)
    assert shares["identity", "judged windows", "race"] == 0.5
    assert shares["identity", "judged windows", "none"] == 0.25
    assert shares["issue", "judged windows", "risk"] == 0.5
    with style.drawing():
        figure = questionnaire_draw(data, True)
    widths = {round(patch.get_width(), 6) for ax in figure.axes for patch in ax.patches}  # type: ignore[attr-defined]
    assert {25.0, 75.0, 100.0, 50.0} <= widths
    assert (35.7, 0.0) in drawn_points(figure)


def test_signatures_beyond_the_ceiling_are_named() -> None:
    rows = [
        {"discrimination": "ageism", "issue": "quality", "paper": 0.68, "ceiling": 0.6},
        {"discrimination": "ageism", "issue": "risk", "paper": 0.49, "ceiling": 0.6},
        {"discrimination": "sexism", "issue": "risk", "ceiling": 0.6},
    ]
    results = results_of(signatures=rows_of("signatures", rows))
    caption = signatures_caption(results, signatures_data(results))
    assert "above the ceiling for ageism, quality." in caption


def test_largest_of_each_measure_is_marked() -> None:
    rows = [
        {"robot": robot, "measure": measure, "value": value}
        for robot, measure, value in (
            ("even", "ignore_rate", 1.0),
            ("racist", "ignore_rate", 4.0),
            ("even", "mean_response_time", NAN),
            ("racist", "mean_response_time", NAN),
        )
    ]
    data = behaviour_data(results_of(behaviour=rows_of("behaviour", rows)))
    assert data["largest"].tolist() == [0, 1, 0, 0]


def test_confusion_gives_the_share_of_each_row() -> None:
    counts = {("a", "a"): 3, ("a", "b"): 1, ("b", "a"): 0, ("b", "b"): 0}
    rows = [{"judged": j, "predicted": p, "count": n} for (j, p), n in counts.items()]
    data = confusion_data(results_of(confusion=rows_of("confusion", rows)))
    assert data["share_of_judged"].tolist()[:2] == [0.75, 0.25]
    assert np.isnan(data["share_of_judged"][2:]).all()  # nobody judged so: no share


def test_a_detector_metric_that_is_missing_is_not_defined() -> None:
    results = results_of(
        detector=rows_of("detector", [{"metric": "accuracy", "value": 0.9}]),
        calibration=rows_of("calibration", [{"n": 12}]),
    )
    caption = calibration_caption(results, results["calibration"])
    assert "Accuracy 90.0\N{NO-BREAK SPACE}%" in caption
    assert "manual threshold not defined, Brier score not defined" in caption


def test_known_arms_come_first_and_others_get_looks_of_their_own() -> None:
    data = table(("arm",), [("mine",), ("ppo",), ("theirs",), ("reinforce",)])
    assert arms_in(data) == ["reinforce", "ppo", "mine", "theirs"]
    found = style.looks(arms_in(data), style.ARMS)
    assert len({(look.colour, look.marker, str(look.line)) for look in found.values()}) == 4


def test_every_series_can_be_told_apart_without_colour() -> None:
    arms = [(look.marker, look.filled) for look in style.ARMS.values()]
    assert len(set(arms)) == len(arms)
    kinds = [style.KINDS[k].marker for k in ("none", "racism", "sexism", "ageism", "ableism")]
    assert len(set(kinds)) == len(kinds)


def test_drawing_leaves_the_settings_of_the_user_alone() -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    with style.drawing():
        assert mpl.rcParams["svg.fonttype"] == "none"
    assert dict(mpl.rcParams) == before


def test_svg_in_a_page_has_its_own_identifiers_and_no_size() -> None:
    svg = (
        '<?xml version="1.0"?>\n<!-- by x -->\n<svg xmlns:xlink="http://x" width="5pt" '
        'height="4pt" viewBox="0 0 5.1239 4" xmlns="http://y" version="1.1">\n <metadata>d'
        '</metadata>\n <g id="a">\n  <use xlink:href="#b" x="1.23456"/>\n'
        '  <text clip-path="url(#c)">id="a" 1.23456</text>\n </g>\n</svg>\n'
    )
    assert style.inline_svg(svg, "p") == (
        '<svg viewBox="0 0 5.12 4" aria-hidden="true" focusable="false"><g id="p-a">'
        '<use href="#p-b" x="1.23"/><text clip-path="url(#p-c)">id="a" 1.23456</text></g></svg>'
    )


def test_names_of_figures_are_unique() -> None:
    names = [plate.name for plate in PLATES]
    assert len(set(names)) == len(names) == 13
