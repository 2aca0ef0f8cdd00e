"""What a terminal shows, at several widths."""

import re
import sys

import pytest

from evenhand.core import terminal

HEADS = ("identity", "group", "issue", "services", "rate", "difference, 95 % interval", "verdict")
ROWS = [
    ("age_group", "child", "willingness", 649, "28.8 %", "+18.8 [+13.2, +25.0]", "disparity"),
    ("mobility", "wheelchair", "risk", 28, None, "+4.4 [−10.0, +18.0]", "insufficient data"),
]


@pytest.fixture
def printed(monkeypatch, capsys):
    """``printed(width, *table)``: what a terminal of this width shows; without one, a pipe."""

    def run(width: int | None, title: str, columns, rows) -> str:
        monkeypatch.setenv("COLUMNS", str(width or 80))
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys.stdout, "isatty", lambda: width is not None)
        terminal.table(title, columns, rows)
        return re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out)

    return run


def test_a_wide_terminal_has_a_table(printed):
    lines = printed(120, "Groups", HEADS, ROWS).splitlines()
    assert lines[0] == "Groups"
    assert len(lines) == 1 + 6  # head, two rows, three rules
    assert "│ 28.8 % " in lines[4]
    assert max(map(len, lines)) <= 120


def test_a_narrow_terminal_has_a_paragraph_a_row(printed):
    assert printed(80, "Groups", HEADS, ROWS).splitlines() == [
        "Groups",
        "age_group · child · willingness",
        "  services 649; rate 28.8 %; difference, 95 % interval +18.8 [+13.2, +25.0];",
        "  verdict disparity",
        "mobility · wheelchair · risk",
        "  services 28; rate missing; difference, 95 % interval +4.4 [−10.0, +18.0];",
        "  verdict insufficient data",
    ]


def test_a_row_without_numbers_is_named_by_its_first_cell(printed):
    text = printed(20, "Read as", ("role", "column", "unit"), [("responded", "answered", "")])
    assert text.splitlines() == ["Read as", "responded", "  column answered"]


def test_a_pipe_has_a_table_whatever_the_terminal(printed):
    assert len(printed(None, "Groups", HEADS, ROWS).splitlines()) == 1 + 6


def test_nothing_is_shown_of_no_rows(printed):
    assert printed(20, "Groups", HEADS, []).splitlines() == ["Groups"]
