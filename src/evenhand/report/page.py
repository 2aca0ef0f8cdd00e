"""Room: the page. Takes: results and drawn figures. Gives: one HTML text that needs nothing else.

Pure. Everything that came from a table or a claim is escaped by the template engine; only the
SVG that this package drew is put in as it is.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evenhand.core import templates
from evenhand.core.wording import NOT_DEFINED
from evenhand.report import style
from evenhand.report.figure import Drawn
from evenhand.report.table import Table, say

NOT_PRINTED = "not printed"
LISTED = 60  # rows of a data table in the page; the CSV file holds all


@dataclass(frozen=True)
class Listing:
    """A data table as text: heads, rows, and what was left out."""

    heads: list[str]
    rows: list[list[str]]
    numeric: list[bool]
    note: str


TEMPLATES = Path(__file__).parent / "templates"
"""What all pages include."""


def fill(template: str, folder: Path, **context: Any) -> str:
    """A page from a template in a folder of its own, which may include what all pages do."""
    return templates.fill(template, folder, TEMPLATES, **context)


def figure_context(drawn: Drawn) -> dict[str, Any]:
    """What the template needs of one figure."""
    plate = drawn.plate
    return {
        "name": plate.name,
        "title": plate.title,
        "paper": plate.paper,
        "half": plate.half,
        "alt": f"{plate.title}. {plate.alt} The numbers are in the table under the figure.",
        "caption": drawn.caption,
        "wide": Markup(style.inline_svg(drawn.svg, plate.name)),
        "narrow": Markup(style.inline_svg(drawn.narrow_svg, f"{plate.name}-narrow"))
        if drawn.narrow_svg
        else None,
        "listing": listing(drawn.data),
    }


def value_text(value: Any, exact: bool = False) -> str:
    """A number, a list or a text for a reader.

    Args:
        value: from JSON; None and NaN are not defined.
        exact: keep a number as it was printed, instead of rounding it to three decimals.
    """
    if value is None:
        return NOT_DEFINED
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return f"{value:g}" if exact and not math.isnan(value) else say(value)
    if isinstance(value, list):
        return f"[{', '.join(value_text(entry, exact) for entry in value)}]"
    return value if isinstance(value, str) else json.dumps(value)


def flat(settings: Mapping[str, Any], before: str = "") -> list[tuple[str, str]]:
    """Nested settings as pairs of a dotted name and a text."""
    pairs: list[tuple[str, str]] = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            pairs += flat(value, f"{before}{name}.")
        else:
            pairs.append((f"{before}{name}", value_text(value, exact=True)))
    return pairs


def duration(seconds: float) -> str:
    """Seconds as minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"


def listing(data: Table) -> Listing:
    """The table drawn, for the page: means instead of single seeds, some epochs instead of all."""
    rows, note = list(data.rows()), ""
    whole = len(rows)
    if any(row.get("seed") == "mean" for row in rows):
        rows = [row for row in rows if row["seed"] == "mean"]
        note = "Means over seeds; single seeds are in the CSV file."
    elif whole > LISTED and any(row.get("alarm") for row in rows):
        rows = [row for row in rows if row["alarm"]][:LISTED]
        note = f"Updates with an alarm; all {whole:,} updates are in the CSV file."
    elif "epoch" in data.columns and whole > LISTED:
        lines = len({(row["preset"], row["arm"]) for row in rows})
        epochs = sorted({row["epoch"] for row in rows})
        step = -(-len(epochs) * lines // LISTED)
        kept = set(islice(reversed(epochs), 0, None, step))
        rows = [row for row in rows if row["epoch"] in kept]
        note = f"Every {step} epochs, counted from the last; all {whole:,} are in the CSV file."
    elif whole > LISTED:
        rows = rows[:LISTED]
        note = f"The first {LISTED} of {whole:,} rows; all are in the CSV file."
    heads = list(data.columns)
    return Listing(
        heads=[head.replace("_", " ") for head in heads],
        rows=[[_cell(head, row[head]) for head in heads] for row in rows],
        numeric=[all(not isinstance(row[head], str) for row in rows) for head in heads],
        note=note,
    )


def _cell(head: str, value: Any) -> str:
    if isinstance(value, str):
        return value
    if value is None or math.isnan(value):  # None in a column of text
        return NOT_PRINTED if head.startswith("paper") else NOT_DEFINED
    return str(value) if isinstance(value, int) else f"{value:.4g}".replace("-", "\N{MINUS SIGN}")
