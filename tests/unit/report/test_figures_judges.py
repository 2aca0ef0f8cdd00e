"""The detector on raw and on corrected scores, as it is drawn and told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evenhand.experiments.paper.report import summary
from evenhand.experiments.paper.report.figures_detector import (
    judge_text,
    judges_caption,
    judges_data,
    judges_draw,
)
from evenhand.experiments.paper.report.results import SCHEMAS
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, table

NAN = math.nan
COLUMNS = tuple(SCHEMAS["judges"])
SPACE = "\N{NO-BREAK SPACE}"


def row(judge: str, measure: str, value: float, n: int, **more: Any) -> dict[str, Any]:
    return {
        "judge": judge, "measure": measure, "bin": "", "predicted": NAN, "value": value,
        "ci_low": NAN, "ci_high": NAN, "n": n,
    } | more  # fmt: skip


def judges() -> Table:
    rows = [
        row("raw", "accuracy", 0.95, 800, ci_low=0.93, ci_high=0.96),
        row("raw", "agreement", 0.98, 800, ci_low=0.97, ci_high=0.99),
        row("raw", "false_alarms", 0.1, 200, ci_low=0.06, ci_high=0.15),
        row("raw", "brier", 0.037, 800),
        row("raw", "calibration", 0.25, 40, bin="0.2-0.3", predicted=0.21, ci_low=0.1, ci_high=0.4),
        row("raw", "calibration", NAN, 0, bin="0.3-0.4"),
        row("corrected", "accuracy", 0.9, 800, ci_low=0.88, ci_high=0.92),
        row("corrected", "false_alarms", 0.04, 200, ci_low=0.02, ci_high=0.07),
        row("threshold", "false_alarms", 0.13, 200, ci_low=0.09, ci_high=0.18),
        row("respondents", "false_alarms", NAN, 0),
    ]
    return table(COLUMNS, [[cells[name] for name in COLUMNS] for cells in rows])


RESULTS = Results({"judges": judges()}, {}, [])


def test_a_measure_has_its_interval_and_what_is_missing_is_not_defined() -> None:
    told = judge_text(RESULTS, "raw", "false_alarms")
    assert told == f"10.0{SPACE}% [6.0{SPACE}%, 15.0{SPACE}%]"
    assert judge_text(RESULTS, "raw", "brier") == "0.037"
    assert judge_text(RESULTS, "corrected", "brier") == "not defined"
    assert judge_text(RESULTS, "respondents", "false_alarms") == "not defined"


def test_the_caption_sets_corrected_beside_raw() -> None:
    words = judges_caption(RESULTS, judges_data(RESULTS))
    assert "same 800 held-out windows" in words
    assert "the even robot’s 200 windows" in words
    assert f"95.0{SPACE}% [93.0{SPACE}%, 96.0{SPACE}%] on raw, 90.0{SPACE}% [88.0{SPACE}%" in words
    assert "Brier score 0.037 on raw, not defined on corrected scores" in words
    assert f"13.0{SPACE}% [9.0{SPACE}%, 18.0{SPACE}%] by the manual threshold" in words


@pytest.mark.parametrize("wide", [True, False])
def test_each_judge_is_a_mark_in_every_panel_that_it_has_a_number_for(wide: bool) -> None:
    with style.drawing():
        figure = judges_draw(judges(), wide)
    panels = {ax.get_title(loc="left"): ax for ax in figure.axes}
    marks = {
        title: {
            (round(float(x), 6), round(float(y), 6))
            for line in ax.lines
            for x, y in np.asarray(line.get_xydata())
            if line.get_marker() not in ("None", "none", "") and not math.isnan(x)
        }
        for title, ax in panels.items()
    }
    # per cent across, one line a judge from the top
    assert marks["Accuracy"] == {(95.0, 0.0), (90.0, 1.0)}
    assert marks["Agreement with the threshold"] == {(98.0, 0.0)}
    assert marks["Even robot called biased"] == {(10.0, 0.0), (4.0, 1.0), (13.0, 2.0)}
    assert marks["Calibration"] == {(21.0, 25.0)}


def test_the_summary_names_both_detectors() -> None:
    empty = table(tuple(SCHEMAS["detector"]), [])
    _, words = summary._detector(Results({"judges": judges(), "detector": empty}, {}, []))
    assert f"agrees with respondents in 90.0{SPACE}% [88.0{SPACE}%, 92.0{SPACE}%]" in words
    assert f"10.0{SPACE}% [6.0{SPACE}%, 15.0{SPACE}%] by the first, 4.0{SPACE}%" in words
