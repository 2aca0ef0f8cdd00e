"""CSV, JSON and the terminal table: every finding, unknown stays unknown, nothing is run."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace

import pytest

from evenhand.audits.show import rows as forms
from evenhand.core import terminal

NAN = math.nan


def test_every_group_and_issue_is_a_row_with_all_its_digits(made_up):
    found = made_up()
    read = list(csv.DictReader(io.StringIO(forms.csv_text(forms.rows(found)))))
    assert len(read) == 32
    assert tuple(read[0]) == (
        "identity", "group", "issue", "n", "cases", "rate", "rest_n", "rest_rate", "difference",
        "low", "high", "corrected", "p", "p_adjusted", "verdict", "needed", "shrunk",
    )  # fmt: skip
    elder = next(r for r in read if (r["group"], r["issue"]) == ("Elder", "risk"))
    assert (elder["n"], elder["cases"], elder["rest_n"]) == ("240", "72", "760")
    assert float(elder["rate"]) == 72 / 240
    assert float(elder["difference"]) == 72 / 240 - 91 / 760
    assert elder["verdict"] == "disparity"
    assert elder["needed"] == ""


def test_what_is_not_known_is_an_empty_cell_and_null(made_up, about):
    row = next(r for r in forms.rows(made_up()) if r["group"] == "unknown")
    assert row["n"] == 0
    assert row["rate"] is row["difference"] is row["p_adjusted"] is row["needed"] is None
    text = forms.csv_text([row])
    assert text.splitlines()[1] == (
        "badge,unknown,willingness,0,0,,1000,0.166,,,,,,,insufficient data,,"
    )
    whole = json.loads(json.dumps(forms.plain(made_up(), about), allow_nan=False))
    assert whole["findings"][7]["rate"] is None
    assert whole["waits"][2]["median"] is None
    assert whole["resemblance"][2] == {
        "identity": "badge", "scores": [None] * 4, "biased": None, "biased_even": None,
        "looks_like": None,
    }  # fmt: skip


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r", "\n", "  ="])
def test_a_cell_that_a_spreadsheet_would_run_is_made_text(made_up, one, start):
    evil = f'{start}HYPERLINK("x";"y"),2'
    found = made_up(findings=(one(evil, evil, "risk", (1, 10), (5, 10)),))
    text = forms.csv_text(forms.rows(found))
    (row,) = csv.DictReader(io.StringIO(text, newline=""))
    assert row["group"] == row["identity"] == f"'{evil}"
    assert float(row["difference"]) == -0.4  # a number may be negative
    assert forms.rows(found)[0]["group"] == evil


def test_other_tables_have_rows_of_their_own(made_up):
    found = made_up()
    waits = forms.csv_text(forms.wait_rows(found), forms.WAIT_COLUMNS).splitlines()
    assert waits[3] == "age,Elder,240,160,,0.55,0.49,0.61,0.15,0.4,0.33,0.46,0.0006"
    measures = forms.csv_text(forms.measure_rows(found), forms.MEASURE_COLUMNS).splitlines()
    assert measures[1] == "smiles,age,Elder,240,1.25,2.5,0.002,1.0,2.0,0.06"
    seen = forms.csv_text(forms.resemblance_rows(found), forms.RESEMBLANCE_COLUMNS).splitlines()
    assert seen[1] == "age,0.135 0.031 0.032 0.121,0.42,0.11,ageism"


def test_json_says_with_what_it_was_made(made_up, about):
    whole = forms.plain(made_up(), about)
    assert whole["verdict"] == "disparity"
    assert whole["seed"] == 7
    assert whole["settings"]["verdict"] == {
        "alpha": 0.05, "delta": 0.1, "power": 0.8, "permutations": 2000,
    }  # fmt: skip
    assert set(whole["versions"]) >= {"evenhand", "numpy"}
    assert whole["command"] == about.command
    assert whole["mapping"][4] == {"role": "response time", "column": "waited", "unit": "s"}
    assert whole["log"]["from"] is None
    assert whole["synthetic"] is True
    assert whole["late_seconds"] == 4.0
    assert forms.plain(made_up(), replace(about, late=NAN))["late_seconds"] is None
    assert whole["summary"]["disparities"][0].startswith("“Elder” (age) was not answered")


def test_the_terminal_shows_disparities_first_and_no_group_vanishes(made_up, capsys):
    heads, rows = forms.terminal(made_up())
    assert len(rows) == 32
    assert all(len(row) == len(heads) for row in rows)
    assert [row[1] for row in rows[:4]] == ["Elder", "Elder", "Child", "Child"]
    assert [row[9] for row in rows[:4]] == ["disparity"] * 3 + ["no evidence"]
    assert [row[1] for row in rows[-4:]] == ["unknown"] * 4
    terminal.table("Findings", heads, rows)
    shown = capsys.readouterr().out
    assert shown.count("visitor") == 4
    assert "+18.0 [+13.0, +23.0]" in shown
    assert "13,000" in shown
    assert shown.count("missing") == 4 * 4


def test_a_name_with_markup_or_escape_codes_is_shown_as_it_is(made_up, one, capsys):
    evil = "[bold]x[/bold]\x1b[31m"
    heads, rows = forms.terminal(made_up(findings=(one("age", evil, "risk", (1, 9), (1, 9)),)))
    terminal.table("Findings", heads, rows)
    shown = capsys.readouterr().out
    assert "[bold]x[/bold]�[31m" in shown
    assert "\x1b[31m" not in shown
