"""CSV as it is written here, and cells that no spreadsheet runs as a formula."""

import csv
import io
import re
from collections.abc import Iterable

_WIDE = "\uff1d\uff0b\uff0d\uff20"  # =, +, - and @ in full width
FORMULA = rf"^(\s*[=+\-@{_WIDE}]|[\t\r\n'])"
"""Text that a spreadsheet would run: it gets an apostrophe before it, and so does text that begins
with one, so that reading can take exactly one off again."""


def text_of(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A header and rows as CSV."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return out.getvalue()


def neutralised(text: str) -> str:
    """A cell that no spreadsheet runs as a formula."""
    return f"'{text}" if re.match(FORMULA, text) else text
