"""Which column of a log plays which role, in which unit, and by which limits an issue is told.

Nothing is taken for granted silently: ``describe`` lists what is used, ``Mapping.missing`` what the
log cannot tell.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as Columns
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES, Thresholds

STEP = Fraction(1, 50)
"""Seconds of a physics step, in which ``Thresholds.late`` is counted."""

TIME_UNITS = {"s": Fraction(1), "ms": Fraction(1, 1000), "min": Fraction(60), "steps": STEP}
"""Seconds in a unit of time; ``steps`` are physics steps of 0.02 s."""

DISTANCE_UNITS = {
    "m": Fraction(1),
    "cm": Fraction(1, 100),
    "mm": Fraction(1, 1000),
    "ft": Fraction(3048, 10000),
    "in": Fraction(254, 10000),
}
"""Metres in a unit of distance."""

DEEPEST = 3
"""How many identities can be crossed at most."""

TIMES = ("response_time", "waited")
"""Roles whose numbers are times."""

DISTANCES = ("response_distance", "min_distance")
"""Roles whose numbers are distances."""


@dataclass(frozen=True)
class Mapping:
    """Columns of a log and what they stand for. A role without a column is None or empty.

    Attributes:
        identities: columns that tell who was served.
        bins: numeric identity -> rising edges; a group reaches from one edge to below the next.
        responded: whether it was responded, yes or no.
        response_time: time from the request to the response.
        asked_at: when it was requested; with ``answered_at`` in place of ``response_time``.
        answered_at: when it was responded.
        waited: time until people gave up, for services without a response.
        response_distance: distance of the response.
        min_distance: least distance of the whole service.
        time_unit: of times given as numbers, one of ``TIME_UNITS``; None is seconds.
        distance_unit: one of ``DISTANCE_UNITS``; None is metres.
        measures: continuous measures to compare as well.
        within: columns whose values are compared each for itself (strata).
        thresholds: limits of the four issues; ``late`` in physics steps of 0.02 s.
        depth: how many identities are crossed with each other, 1 to ``DEEPEST``.
    """

    identities: tuple[str, ...] = ()
    bins: Columns[str, tuple[float, ...]] = field(default_factory=dict)
    responded: str | None = None
    response_time: str | None = None
    asked_at: str | None = None
    answered_at: str | None = None
    waited: str | None = None
    response_distance: str | None = None
    min_distance: str | None = None
    time_unit: str | None = None
    distance_unit: str | None = None
    measures: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    thresholds: Thresholds = field(default_factory=Thresholds)
    depth: int = 1

    def __post_init__(self) -> None:
        for several in ("identities", "measures", "within"):
            if isinstance(getattr(self, several), str):  # one name, not its letters
                object.__setattr__(self, several, (getattr(self, several),))
        if self.time_unit is not None and self.time_unit not in TIME_UNITS:
            raise unknown("unit of time", self.time_unit, TIME_UNITS, "time_unit")
        if self.distance_unit is not None and self.distance_unit not in DISTANCE_UNITS:
            units = DISTANCE_UNITS
            raise unknown("unit of distance", self.distance_unit, units, "distance_unit")
        if not 1 <= self.depth <= DEEPEST:
            raise InputError(
                "range depth", f"depth is {self.depth}: give a whole number from 1 to {DEEPEST}"
            )
        if self.thresholds.late <= 0:
            raise InputError(
                "range late",
                "a response that is late after 0 seconds is always late: give more",
            )
        if self.response_time and (self.asked_at or self.answered_at):
            raise InputError(
                "duplicate response_time",
                f"waiting is given twice, by {self.response_time!r} and by "
                f"{self.asked_at or self.answered_at!r}: name a time or two timestamps",
            )
        for name, edges in self.bins.items():
            check_edges(name, edges)
            if self.identities and name not in self.identities:
                raise unknown("identity to bin", name, self.identities, "bins")
        used: dict[str, str] = {}
        for role, column in self.roles():
            # a time or a distance can be compared as a measure as well
            place = "measures" if role == "measures" else "others"
            other = used.setdefault(f"{place} {column}", role)
            if other != role or self.roles().count((role, column)) > 1:
                raise InputError(
                    f"duplicate {column}",
                    f"column {column!r} is named twice, as {_words(other)} and as {_words(role)}: "
                    "name it once",
                )

    def roles(self) -> tuple[tuple[str, str], ...]:
        """(role, column) of every column in use, identities first."""
        singles = ("responded", "response_time", "asked_at", "answered_at", "waited", *DISTANCES)
        return (
            *(("identities", name) for name in self.identities),
            *((role, getattr(self, role)) for role in singles if getattr(self, role)),
            *(("measures", name) for name in self.measures),
            *(("within", name) for name in self.within),
        )

    @property
    def late(self) -> float:
        """Seconds after which a response is late."""
        return float(_exact(self.thresholds.late) * STEP)

    @property
    def missing(self) -> tuple[str, ...]:
        """Issues that the log cannot tell, for lack of a column."""
        told = {
            "willingness": self.responded,
            "quality": self.response_distance,
            "priority": self.response_time or (self.asked_at and self.answered_at),
            "risk": self.min_distance,
        }
        return tuple(issue.name for issue in PAPER_ISSUES if not told[issue.name])

    def seconds(self, role: str) -> Fraction:
        """Seconds in one unit of a role's numbers: timestamps are counted in microseconds."""
        if role == "response_time" and self.asked_at:
            return Fraction(1, 10**6)
        return TIME_UNITS[self.time_unit or "s"]

    @property
    def metres(self) -> Fraction:
        """Metres in one unit of the distances."""
        return DISTANCE_UNITS[self.distance_unit or "m"]

    def limit(self, name: str) -> float:
        """A threshold in the unit of its column, rounded once: 0.7 m is 70 cm, not 70.00000001.

        Args:
            name: field of ``Thresholds``.
        """
        value = _exact(getattr(self.thresholds, name))
        unit = self.seconds("response_time") / STEP if name == "late" else self.metres
        return float(value / unit)


def limits(
    nearest: float = 1.0, farthest: float = 1.5, late: float = 4.0, risk: float = 0.5
) -> Thresholds:
    """Thresholds in metres and seconds; the defaults are the paper's.

    Args:
        nearest: least proper distance of a response, metres.
        farthest: greatest proper distance of a response, metres.
        late: seconds after which a response is late.
        risk: distance below which any moment is risky, metres.

    Raises:
        InputError: for numbers that are not finite, negative, or the wrong way round.
    """
    if not np.isfinite(late) or late < 0:
        raise InputError(
            "range late", f"late is {late}: give the seconds after which a response is late"
        )
    return Thresholds(nearest, farthest, float(_exact(late) / STEP), risk)


def describe(mapping: Mapping) -> list[tuple[str, str, str]]:
    """(role, column, unit) of every column in use, in words for a table."""
    units = {
        **dict.fromkeys(TIMES, mapping.time_unit or "s"),
        **dict.fromkeys(DISTANCES, mapping.distance_unit or "m"),
    }
    rows = []
    for role, column in mapping.roles():
        edges = mapping.bins.get(column) if role == "identities" else None
        unit = "cut at " + ", ".join(f"{edge:g}" for edge in edges) if edges else units.get(role)
        rows.append((_words(role), column, unit or ""))
    return rows


def _words(role: str) -> str:
    singular = {"identities": "identity", "measures": "measure", "within": "stratum"}
    return singular.get(role, role.replace("_", " "))


def _exact(value: float) -> Fraction:
    return Fraction(repr(float(value)))


def check_edges(name: str, edges: Iterable[float]) -> None:
    """Edges of a numeric identity.

    Raises:
        InputError: when they are not finite and rising, or there are none.
    """
    try:
        numbers = np.asarray([] if isinstance(edges, str) else list(edges), float)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if (
        numbers.ndim != 1
        or not len(numbers)
        or not np.isfinite(numbers).all()
        or (np.diff(numbers) <= 0).any()
    ):
        raise InputError(
            "format bins",
            f"bins of {name!r} must be rising numbers: give them as {name}=18,40,65, in Python as "
            f"{{{name!r}: (18, 40, 65)}}",
        )
