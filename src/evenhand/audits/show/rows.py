"""The findings of an audit as rows: CSV, JSON, a table for the terminal.

CSV and JSON keep the order of the findings and all their digits; the table shows what matters
most first. What is not known is an empty cell, null, or "missing".
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.markup import escape

from evenhand.audits.show.sentences import summary
from evenhand.audits.show.wording import About, number, points, rounded_up, share, shown
from evenhand.core import csv_file
from evenhand.statistics.verdicts import VERDICTS

if TYPE_CHECKING:
    from evenhand.audits.judge.results import Finding, Findings

COLUMNS = (
    "identity",
    "group",
    "issue",
    "n",
    "cases",
    "rate",
    "rest_n",
    "rest_rate",
    "difference",
    "low",
    "high",
    "corrected",
    "p",
    "p_adjusted",
    "verdict",
    "needed",
    "shrunk",
)
"""Columns of the CSV file, one row a group and issue; new ones go to the end."""

WAIT_COLUMNS = (
    "identity",
    "group",
    "n",
    "responses",
    "median",
    "unserved",
    "unserved_low",
    "unserved_high",
    "rest_unserved",
    "difference",
    "low",
    "high",
    "p",
)
MEASURE_COLUMNS = (
    "measure",
    "identity",
    "group",
    "n",
    "mean",
    "rest_mean",
    "mean_p",
    "median",
    "rest_median",
    "median_p",
)
RESEMBLANCE_COLUMNS = ("identity", "scores", "biased", "biased_even", "looks_like")

TERMINAL = (
    "identity",
    "group",
    "issue",
    "n",
    "rate",
    "others",
    "difference [interval]",
    "corrected",
    "adj. p",
    "verdict",
    "services that would do",
)
"""Heads of the terminal table."""

FORMAT = 1
"""Of the JSON; grows when a field changes its meaning or goes."""

_ENGINES = ("duckdb", "numpy", "scipy")


def rows(findings: Findings) -> list[dict[str, Any]]:
    """One row a group and issue, as plain values; None where a number is not known."""
    return [_row(one, COLUMNS) for one in findings.findings]


def wait_rows(findings: Findings) -> list[dict[str, Any]]:
    """One row a group: how long it waits."""
    return [_row(one, WAIT_COLUMNS) for one in findings.waits]


def measure_rows(findings: Findings) -> list[dict[str, Any]]:
    """One row a measure and group."""
    return [_row(one, MEASURE_COLUMNS) for one in findings.measures]


def resemblance_rows(findings: Findings) -> list[dict[str, Any]]:
    """One row an identity: what the detector sees."""
    return [_row(one, RESEMBLANCE_COLUMNS) for one in findings.resemblance]


def csv_text(listed: Sequence[Mapping[str, Any]], columns: Sequence[str] = COLUMNS) -> str:
    """Rows as CSV: a header, all digits, an empty cell for what is not known.

    Text from the log that a spreadsheet would run as a formula gets an apostrophe before it.
    """
    return csv_file.text_of(columns, ([_cell(row[name]) for name in columns] for row in listed))


def plain(findings: Findings, about: About) -> dict[str, Any]:
    """The whole audit as values that JSON knows; NaN becomes null."""
    told = summary(findings, about)
    return {
        "format": FORMAT,
        "verdict": findings.verdict,
        "summary": as_plain(dataclasses.asdict(told)),
        "synthetic": about.synthetic,
        "services": int(findings.services),
        "total": as_plain(findings.total),
        "even_total": as_plain(findings.even_total),
        "p_total": as_plain(findings.p_total),
        "findings": rows(findings),
        "waits": wait_rows(findings),
        "measures": measure_rows(findings),
        "resemblance": resemblance_rows(findings),
        "log": {"title": about.title} | as_plain(about.log),
        "mapping": [
            dict(zip(("role", "column", "unit"), row, strict=True)) for row in about.mapping
        ],
        "meanings": as_plain(about.meanings),
        "within": about.within or None,
        "late_seconds": as_plain(about.late),
        "left_out": list(about.left_out),
        "warnings": list(about.doubts),
        "settings": as_plain(dataclasses.asdict(findings.settings)),
        "seed": int(findings.settings.seed),
        "versions": versions(),
        "command": about.command,
    }


def versions() -> dict[str, str]:
    """Versions of what counted and calculated; packages that are not there are left out."""
    from evenhand import __version__

    found = {"evenhand": __version__}
    for name in _ENGINES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def terminal(findings: Findings) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Heads and rows for `core.terminal.table`, disparities first, then the largest gaps.

    Every group and issue has its row, however small.
    """
    ordered = sorted(findings.findings, key=importance)
    return TERMINAL, [
        (
            _said(one.identity),
            _said(one.group),
            _said(one.issue),
            int(one.n),
            _known(one.rate, share(one.rate)),
            _known(one.rest_rate, share(one.rest_rate)),
            _known(
                one.difference,
                f"{points(one.difference)} [{points(one.low)}, {points(one.high)}]",
            ),
            _known(one.corrected, number(100 * one.corrected, 1)),
            _known(one.p_adjusted, f"{one.p_adjusted:.4f}"),
            one.verdict,
            "" if math.isnan(one.needed) else f"{rounded_up(one.needed):,}",
        )
        for one in ordered
    ]


def importance(one: Finding) -> tuple[int, float]:
    """Sorts disparities first, then by the size of the difference, the unknown last."""
    if math.isnan(one.difference):
        return len(VERDICTS), 0.0
    return VERDICTS.index(one.verdict), -abs(one.difference)


def _known(value: float, said: str) -> str | None:
    return None if math.isnan(value) else said


def _said(name: str) -> str:
    """A name for the terminal: its brackets are no markup, its escape codes do nothing."""
    return escape(shown(name))


def _row(one: object, columns: Sequence[str]) -> dict[str, Any]:
    return {column: as_plain(getattr(one, column)) for column in columns}


def as_plain(value: Any) -> Any:
    """Python values only; None for NaN and for what is infinite."""
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, np.generic):
        return as_plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): as_plain(entry) for name, entry in value.items()}
    if isinstance(value, np.ndarray):
        return as_plain(value.tolist())
    if isinstance(value, Sequence):
        return [as_plain(entry) for entry in value]
    return str(value)  # a path, a date


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    if isinstance(value, str):
        return csv_file.neutralised(value)
    if isinstance(value, list):
        return " ".join(str(_cell(entry)) for entry in value)
    return repr(value) if isinstance(value, float) else value
