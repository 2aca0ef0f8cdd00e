"""Cells of a log as numbers, answers and moments: SQL that every engine runs.

Text is taken for a number only where it is written as one; whatever else stands there is wrong and
is told by ``Reading.wrong``, never passed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from evenhand.audits.read.engines import Dialect, Kind, Table, number
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

_NUMBER = r"^[+-]?([0-9]+([.][0-9]*)?|[.][0-9]+)([eE][+-]?[0-9]+)?$"
# Only days that the calendar has: some engines end a whole query at the 30th of February.
_LEAP = r"([0-9]{2}(0[48]|[2468][048]|[13579][26])|([02468][048]|[13579][26])00)"
_DAY = (
    r"([0-9]{4}-(0[13578]|1[02])-(0[1-9]|[12][0-9]|3[01])|[0-9]{4}-(0[469]|11)-(0[1-9]|[12][0-9]|30)"
    rf"|[0-9]{{4}}-02-(0[1-9]|1[0-9]|2[0-8])|{_LEAP}-02-29)"
)
_MOMENT = (
    rf"^{_DAY}[T ]([01][0-9]|2[0-3]):[0-5][0-9]:[0-5][0-9]"
    r"([.][0-9]{1,9})?(Z|[+-]([01][0-9]|2[0-3]):?[0-5][0-9])?$"
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
    value: str
    wrong: str


def answer(table: Table, column: str) -> Reading:
    """Yes or no, in the usual spellings.

    Raises:
        InputError: for a column of another type.
    """
    cell, kind = table[column], table.kinds[column]
    if kind.family == "boolean":
        return Reading("responded", (column,), cell, "false")
    if kind.numeric:
        value = f"case when {cell} = 1 then true when {cell} = 0 then false end"
        known = f"{cell} is not null"
    elif kind.family == "text":
        text = _small(table.engine.dialect, cell)
        value = f"case when {_among(text, YES)} then true when {_among(text, NO)} then false end"
        known = f"{cell} is not null and not {_among(text, BLANK)}"
    else:
        raise _other(column, kind, "yes or no")
    return Reading("responded", (column,), value, f"({known} and ({value}) is null)")


def amount(table: Table, column: str, role: str, signed: bool = False) -> Reading:
    """A finite number, not negative unless ``signed``.

    Raises:
        InputError: for a column of another type.
    """
    cell, kind, sql = table[column], table.kinds[column], table.engine.dialect
    if kind.family == "text":
        text = sql.trim.format(cell)
        value = f"case when {sql.matches.format(text, _NUMBER)} then {sql.number.format(text)} end"
        odd = f"({value}) is null or {_beyond(f'({value})')}"
        wrong = f"{cell} is not null and not {_among(_small(sql, cell), BLANK)} and ({odd})"
    elif kind.numeric:
        value = f"cast({cell} as {sql.double})"
        wrong = _beyond(value) if kind.family == "float" else "false"
    else:
        raise _other(column, kind, "numbers")
    if not signed:
        wrong = f"({wrong}) or ({value}) < 0"
    return Reading(role, (column,), value, f"coalesce({wrong}, false)")


def between(table: Table, asked_at: str, answered_at: str) -> tuple[Reading, ...]:
    """Microseconds from one moment to another, after the two moments themselves.

    Raises:
        InputError: for a column of another type.
    """
    asked, answered = (
        _moment(table, asked_at, "asked_at"),
        _moment(table, answered_at, "answered_at"),
    )
    value = f"(({answered.value}) - ({asked.value}))"
    time = Reading(
        "response_time",
        (asked_at, answered_at),
        f"cast({value} as {table.engine.dialect.double})",
        f"coalesce({value} < 0, false)",
    )
    return asked, answered, time


def _moment(table: Table, column: str, role: str) -> Reading:
    """Microseconds since 1970."""
    cell, kind, sql = table[column], table.kinds[column], table.engine.dialect
    if kind.family == "moment":
        return Reading(role, (column,), sql.micros.format(cell), "false")
    if kind.family != "text":
        raise _other(column, kind, "timestamps, as 2026-03-14 15:09:26")
    text = sql.trim.format(cell)
    # no calendar agrees on the year before the first
    plain = f"({sql.matches.format(text, _MOMENT)} and substr({text}, 1, 4) <> '0000')"
    # engines may look at what is not asked for: nothing but a moment is ever cast
    base = _only(plain, f"substr({text}, 1, 10) || ' ' || substr({text}, 12, 8)")
    fraction = sql.part.format(text, "[.]([0-9]{1,9})")
    micros = _only(plain, f"substr({fraction} || '000000', 1, 6)")
    zone = sql.part.format(text, "[+-]([0-9]{2}:?[0-9]{2})$")
    away = f"case when {plain} and {zone} <> '' then replace({zone}, ':', '') else '0000' end"
    hours, minutes = f"substr({away}, 1, 2)", f"substr({away}, 3, 2)"
    west = sql.matches.format(text, "-[0-9]{2}:?[0-9]{2}$")
    value = (
        f"{sql.text_micros.format(base)} + cast({micros} as bigint)"
        f" + case when {west} then 60000000 else -60000000 end"
        f" * (60 * cast({hours} as bigint) + cast({minutes} as bigint))"
    )
    known = f"{cell} is not null and not {_among(_small(sql, cell), BLANK)}"
    return Reading(role, (column,), value, f"coalesce({known} and ({value}) is null, false)")


def _small(sql: Dialect, cell: str) -> str:
    return f"lower({sql.trim.format(cell)})"


def _among(text: str, words: tuple[str, ...]) -> str:
    return f"{text} in ({', '.join(repr(word) for word in words)})"


def _only(condition: str, value: str) -> str:
    return f"case when {condition} then {value} end"


@dataclass(frozen=True)
class Facts:
    """All that a log tells of its services, read by a mapping.

    Attributes:
        readings: of each role that has a column, by role; measures and binned identities under
            the role and the column's name.
    """

    readings: dict[str, Reading]

    def value(self, role: str) -> str | None:
        """The fact, or None where the log lacks it."""
        return self.readings[role].value if role in self.readings else None


def facts(table: Table, mapping: Mapping) -> Facts:
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
            found[role] = amount(table, column, role)
    for role, columns in (("identities", mapping.bins), ("measures", mapping.measures)):
        for column in columns:
            found[f"{role} {column}"] = amount(table, column, role, signed=True)
    return Facts(found)


def issues(read: Facts, mapping: Mapping) -> dict[str, str]:
    """Where a service has an issue, as far as it can be told; null where not known.

    Quality and priority are told of every distance and time; that they are said of responses only
    is left to whoever counts.
    """
    distance = read.value("response_distance")
    time = read.value("response_time")
    least = read.value("min_distance")
    limit = {name: number(mapping.limit(name)) for name in ("nearest", "farthest", "late", "risk")}
    found = {}
    if distance is not None:
        near, far = limit["nearest"], limit["farthest"]
        found["quality"] = f"(({distance}) < {near} or ({distance}) > {far})"
    if time is not None:
        found["priority"] = f"(({time}) > {limit['late']})"
    if least is not None:
        found["risk"] = f"(({least}) < {limit['risk']})"
    return found


def binned(value: str, edges: tuple[float, ...]) -> str:
    """How many edges a number reaches, int; null where it is not known."""
    cases = " ".join(f"when ({value}) < {number(edge)} then {i}" for i, edge in enumerate(edges))
    return f"case when ({value}) is null then null {cases} else {len(edges)} end"


def waiting(read: Facts, mapping: Mapping) -> dict[str, str] | None:
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
        found = {
            name: f"case when {responded} then {sql} else {left[name]} end"
            for name, sql in found.items()
        }
    return {**found, "responded": responded}


def _step(value: str, unit: Fraction, mapping: Mapping) -> dict[str, str]:
    late = Fraction(repr(mapping.thresholds.late)) * STEP
    limit, most = number(float(late / unit)), number(float(2 * late / unit))
    # a millionth of a step makes up for numbers such as 0.14, which is a little more as a double
    near = f"greatest(least({value}, {most}), {number(0.0)})"
    step = f"cast(ceil({near} * {number(float(GRID * unit / late))} - {number(1e-6)}) as smallint)"
    return {
        # engines take the least of a number and nothing for the number
        "step": f"case when ({value}) is not null then {step} end",
        "late": f"(({value}) > {limit})",
        "short": f"(({value}) <= {most})",
    }


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


def _beyond(value: str) -> str:
    """Infinite or NaN, which engines take for the greatest number of all."""
    return f"({value} > {number(GREATEST)} or {value} < {number(-GREATEST)})"


def _other(column: str, kind: Kind, wanted: str) -> InputError:
    return InputError(
        f"type {column}",
        f"column {column!r} holds {kind.name}, expected {wanted}: name another column",
    )
