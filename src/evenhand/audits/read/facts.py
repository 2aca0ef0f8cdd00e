"""Cells of a log as numbers, answers and moments: Ibis expressions that any engine runs.

Text is taken for a number only where it is written as one; whatever else stands there is wrong and
is told by ``Reading.wrong``, never passed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import ibis
import numpy as np
from ibis.expr import types as ir

from evenhand.audits.read.mapping import STEP, Mapping
from evenhand.core.errors import InputError

YES = (
    *("1", "1.0", "yes", "y", "true", "t", "on", "ja", "j", "oui", "o", "si", "sí", "s", "wahr"),
    # what some databases make of SÍ: they know small letters of ASCII only
    "sÍ",
)
NO = ("0", "0.0", "no", "n", "false", "f", "off", "nein", "non", "falsch")
"""Spellings of an answer, in small letters."""

BLANK = ("", "na", "n/a", "null")
"""What stands in cells of facts where nothing is known, in small letters."""

GREATEST = 1.7976931348623157e308
"""The greatest finite number: what lies beyond is infinite, or NaN, on every engine."""

GRID = 200
"""Whole steps of waiting up to the time after which a response is late."""

CAP = 2 * GRID
"""Steps up to which waiting is told apart; whoever waits longer was waiting still at that step."""

_NUMBER = r"^[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?$"
# Only days that the calendar has: some engines end a whole query at the 30th of February.
_LEAP = r"([0-9]{2}(0[48]|[2468][048]|[13579][26])|([02468][048]|[13579][26])00)"
_DAY = (
    r"([0-9]{4}-(0[13578]|1[02])-(0[1-9]|[12][0-9]|3[01])|[0-9]{4}-(0[469]|11)-(0[1-9]|[12][0-9]|30)"
    rf"|[0-9]{{4}}-02-(0[1-9]|1[0-9]|2[0-8])|{_LEAP}-02-29)"
)
_MOMENT = (
    rf"^{_DAY}[T ]([01][0-9]|2[0-3]):[0-5][0-9]:[0-5][0-9]"
    r"(\.[0-9]{1,9})?(Z|[+-]([01][0-9]|2[0-3]):?[0-5][0-9])?$"
)


@dataclass(frozen=True)
class Reading:
    """A fact of every service.

    Attributes:
        role: as in ``Mapping``.
        columns: that it is read from.
        value: number or yes/no; null where not known.
        wrong: where a cell says something that is no such fact, never null.
    """

    role: str
    columns: tuple[str, ...]
    value: Any
    wrong: Any


def answer(table: ir.Table, column: str) -> Reading:
    """Yes or no, in the usual spellings.

    Raises:
        InputError: for a column of another type.
    """
    cell: Any = table[column]
    kind = table.schema()[column]
    value: Any
    if kind.is_boolean():
        return Reading("responded", (column,), cell, ibis.literal(False))
    if kind.is_numeric():
        number = cell.cast("float64")
        value = ibis.cases((number == 1.0, True), (number == 0.0, False))
        # Spark is told by Ibis that NaN is null
        known = cell.notnull() | _beyond(number)
    elif kind.is_string():
        text = cell.strip().lower()
        value = ibis.cases((text.isin(YES), True), (text.isin(NO), False))
        known = cell.notnull() & ~text.isin(BLANK)
    else:
        raise _other(column, kind, "yes or no")
    return Reading("responded", (column,), value, (known & value.isnull()).fill_null(False))


def number(table: ir.Table, column: str, role: str, signed: bool = False) -> Reading:
    """A finite number, not negative unless ``signed``.

    Raises:
        InputError: for a column of another type.
    """
    cell: Any = table[column]
    kind = table.schema()[column]
    value: Any
    wrong: Any
    if kind.is_string():
        text = cell.strip()
        value = ibis.ifelse(text.re_search(_NUMBER), text.try_cast("float64"), ibis.null("float64"))
        wrong = cell.notnull() & ~text.lower().isin(BLANK) & (value.isnull() | _beyond(value))
    elif kind.is_numeric():
        value = cell.cast("float64")
        wrong = _beyond(value) if kind.is_floating() else ibis.literal(False)
    else:
        raise _other(column, kind, "numbers")
    if not signed:
        wrong = wrong | (value < 0.0)
    return Reading(role, (column,), value, wrong.fill_null(False))


def between(table: ir.Table, asked_at: str, answered_at: str) -> tuple[Reading, ...]:
    """Microseconds from one moment to another, after the two moments themselves.

    Raises:
        InputError: for a column of another type.
    """
    first, first_more, first_wrong = _moment(table, asked_at)
    last, last_more, last_wrong = _moment(table, answered_at)
    value = last.delta(first, unit="microsecond") + last_more - first_more
    columns = (asked_at, answered_at)
    return (
        Reading("asked_at", columns[:1], first, first_wrong.fill_null(False)),
        Reading("answered_at", columns[1:], last, last_wrong.fill_null(False)),
        Reading("response_time", columns, value.cast("float64"), (value < 0).fill_null(False)),
    )


def _moment(table: ir.Table, column: str) -> tuple[Any, Any, Any]:
    """Whole seconds as a timestamp, microseconds to add, and where it is wrong."""
    cell: Any = table[column]
    kind = table.schema()[column]
    if kind.is_timestamp() or kind.is_date():
        return cell.cast("timestamp"), ibis.literal(0), ibis.literal(False)
    if not kind.is_string():
        raise _other(column, kind, "timestamps, as 2026-03-14 15:09:26")
    text = cell.strip()
    # no calendar agrees on the year before the first
    plain = text.re_search(_MOMENT) & ~text.startswith("0000")
    blank = ibis.null("string")
    base: Any = ibis.ifelse(plain, text.substr(0, 10) + " " + text.substr(11, 8), blank)
    moment = base.try_cast("timestamp")
    fraction = text.re_extract(r"\.([0-9]{1,9})", 1).fill_null("")
    micros = ibis.ifelse(plain, (fraction + "000000").substr(0, 6), blank).cast("int64")
    zone = text.re_extract(r"[+-]([0-9]{2}:?[0-9]{2})$", 1).fill_null("").replace(":", "")
    away: Any = ibis.ifelse(plain & (zone != ""), zone, "0000")
    minutes = away.substr(0, 2).cast("int64") * 60 + away.substr(2, 2).cast("int64")
    west = text.re_search(r"-[0-9]{2}:?[0-9]{2}$")
    more = micros - ibis.ifelse(west, -1, 1) * minutes * 60_000_000
    wrong = cell.notnull() & ~text.lower().isin(BLANK) & moment.isnull()
    return moment, more, wrong


@dataclass(frozen=True)
class Facts:
    """All that a log tells of its services, read by a mapping.

    Attributes:
        readings: of each role that has a column, by role; measures and binned identities under
            the role and the column's name.
    """

    readings: dict[str, Reading]

    def value(self, role: str) -> Any:
        """The fact, or None where the log lacks it."""
        return self.readings[role].value if role in self.readings else None


def facts(table: ir.Table, mapping: Mapping) -> Facts:
    """Read every mapped column.

    Raises:
        InputError: for a column of a type that cannot be what it is named as.
    """
    found: dict[str, Reading] = {}
    if mapping.responded:
        found["responded"] = answer(table, mapping.responded)
    if mapping.asked_at and mapping.answered_at:
        for reading in between(table, mapping.asked_at, mapping.answered_at):
            found[reading.role] = reading
    for role in ("response_time", "waited", "response_distance", "min_distance"):
        column = getattr(mapping, role)
        if column:
            found[role] = number(table, column, role)
    for role, columns in (("identities", mapping.bins), ("measures", mapping.measures)):
        for column in columns:
            found[f"{role} {column}"] = number(table, column, role, signed=True)
    return Facts(found)


def issues(read: Facts, mapping: Mapping) -> dict[str, Any]:
    """Where a service has an issue, as far as it can be told; null where not known.

    Quality and priority are told of every distance and time; that they are said of responses only
    is left to whoever counts.
    """
    distance = read.value("response_distance")
    time = read.value("response_time")
    least = read.value("min_distance")
    found = {}
    if distance is not None:
        near, far = mapping.limit("nearest"), mapping.limit("farthest")
        found["quality"] = (distance < near) | (distance > far)
    if time is not None:
        found["priority"] = time > mapping.limit("late")
    if least is not None:
        found["risk"] = least < mapping.limit("risk")
    return found


def binned(value: Any, edges: tuple[float, ...]) -> Any:
    """How many edges a number reaches, int; null where it is not known."""
    code = ibis.cases(*((value < edge, i) for i, edge in enumerate(edges)), else_=len(edges))
    return ibis.ifelse(value.isnull(), ibis.null("int64"), code.cast("int64"))


def waiting(read: Facts, mapping: Mapping) -> dict[str, Any] | None:
    """What services are counted by for waiting; None where the log lacks times.

    Comparisons and one rounding only: an engine is slow at cases within cases. ``ended`` makes
    of the counts how long people waited.

    Returns:
        ``step``, time in whole steps, rounded up; ``late`` and ``short``, whether it is beyond the
        limit and whether it is told apart; ``responded`` where the log has that. Without a
        response the time is how long people waited, null unless the log says it.
    """
    time, responded = read.value("response_time"), read.value("responded")
    if time is None:
        return None
    found = _step(time, mapping.seconds("response_time"), mapping)
    if responded is None:
        return found
    waited = read.value("waited")
    if waited is not None:
        left = _step(waited, mapping.seconds("waited"), mapping)
        found = {name: ibis.ifelse(responded, found[name], left[name]) for name in found}
    return {**found, "responded": responded}


def _step(value: Any, unit: Fraction, mapping: Mapping) -> dict[str, Any]:
    late = Fraction(repr(mapping.thresholds.late)) * STEP
    limit, most = float(late / unit), float(2 * late / unit)
    # a millionth of a step makes up for numbers such as 0.14, which is a little more as a double
    near: Any = ibis.least(value, most)
    scaled = near * float(GRID * unit / late) - 1e-6
    # some engines take the least of a number and nothing for the number
    step = ibis.ifelse(value.isnull(), ibis.null("int16"), scaled.ceil().cast("int16"))
    return {"step": step, "late": value > limit, "short": value <= most}


def ended(
    step: np.ndarray,
    late: np.ndarray,
    short: np.ndarray,
    responded: np.ndarray | None,
    says_waited: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Step at which waiting ended, and whether by a response, from what ``waiting`` counted by.

    Without a response people waited as long as the log says, else until the limit: at least so
    long is known only then, and it is censored there.

    Args:
        step: whole steps, NaN where not known, [C].
        late: 1, 0 or NaN, [C].
        short: 1, 0 or NaN, [C].
        responded: 1, 0 or NaN, [C]; None where the log has times alone.
        says_waited: whether the log tells how long people waited without response.

    Returns:
        Steps, NaN where nothing is known, and responses, bool; [C] each.
    """
    inner = np.clip(step, 0, GRID)
    steps = np.where(late == 1.0, np.maximum(step, GRID + 1), inner)
    if responded is None:
        return steps, short == 1.0
    left = np.where(np.isnan(steps), GRID, steps) if says_waited else np.full(len(step), GRID)
    steps = np.where(responded == 1.0, steps, np.where(responded == 0.0, left, np.nan))
    return steps, (responded == 1.0) & (short == 1.0)


def _beyond(value: Any) -> Any:
    """Infinite or NaN, which engines take for the greatest number of all."""
    return (value > GREATEST) | (value < -GREATEST)


def _other(column: str, kind: object, wanted: str) -> InputError:
    return InputError(f"column {column!r} holds {kind}, expected {wanted}: name another column")
