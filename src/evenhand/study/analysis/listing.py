"""The tables of a study's report as text: shares in per cent, and heads that say what they are."""

import math
from dataclasses import replace

from evenhand.core.wording import percent
from evenhand.report import page
from evenhand.report.page import Listing
from evenhand.report.table import Table

_NAMED = ("share", "low", "high")
SHARES = {
    "ratings": ("biased", "biased_low", "biased_high"),
    "early": ("early", "late", "difference", "low", "high"),
    **dict.fromkeys(("identity", "issue", "pairs", "others", "progress"), _NAMED),
}
"""Columns that are shown in per cent, by table."""
HEADS = {
    "ratings": {"biased": "judged biased", "biased_low": "from", "biased_high": "to"},
    "early": {"early_n": "n, seen early", "early": "judged biased, seen early",
              "late_n": "n, seen late", "late": "judged biased, seen late"},
}  # fmt: skip
"""What is said instead of a column's name, by table."""
NOTES = {
    "ratings": "Where all ratings are the same they have no interval: they do not tell how others "
    "would differ.",
    "controls": "All scenarios together are one test: its p needs no adjustment. Where all "
    "differences are the same there is no interval.",
}
"""Why a number is not defined, by table."""


def listing(name: str, table: Table, excluded: bool) -> Listing:
    """A table for the page."""
    shown = page.listing(table)
    columns = list(table.columns)
    other = "with" if excluded else "without"
    said = HEADS.get(name, {})
    heads = [
        f"{column.removeprefix('other_')}, {other} the flagged"
        if column.startswith("other_")
        else said.get(column, head)
        for column, head in zip(columns, shown.heads, strict=True)
    ]
    shares = [column in SHARES.get(name, ()) for column in columns]
    rows = [
        [
            percent(row[column]) if share and not math.isnan(row[column]) else cell
            for column, share, cell in zip(columns, shares, cells, strict=True)
        ]
        for row, cells in zip(table.rows(), shown.rows, strict=False)  # the page has the first ones
    ]
    missing = any(isinstance(cell, float) and math.isnan(cell)
                  for row in table.rows() for cell in row.values())  # fmt: skip
    notes = [shown.note, NOTES.get(name, "") if missing else ""]
    return replace(shown, heads=heads, rows=rows, note=" ".join(filter(None, notes)))
