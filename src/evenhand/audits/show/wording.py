"""Words, numbers and names as an audit shows them, and what it says of its log."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from evenhand.core import wording
from evenhand.core.wording import SPACE
from evenhand.methods.paper.issues import Thresholds
from evenhand.methods.vocabulary import SIMULATED

if TYPE_CHECKING:
    from evenhand.audits.judge.results import Findings

NOT_KNOWN = "not known"
number = partial(wording.number, missing=NOT_KNOWN)
share = partial(wording.percent, missing=NOT_KNOWN)
points = partial(wording.points, missing=NOT_KNOWN)
HAPPENED = {
    "willingness": ("was not answered", "services"),
    "quality": ("was answered from an improper distance", "answered services"),
    "priority": ("was answered late", "answered services"),
    "risk": ("was approached too closely", "services"),
}
"""What befell the person when a service has an issue, and of which services it is said."""

_UNSEEN = {"Cc", "Cs", "Zl", "Zp"}
_TURNING = set("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


@dataclass(frozen=True)
class About:
    """What was audited and how, for readers; nothing here changes a number.

    Attributes:
        title: short name of the log.
        log: description of the log: name and value, may be nested.
        mapping: how its columns were read: (role, column, unit) of each.
        command: repeats the audit.
        synthetic: whether the log says that it is synthetic.
        doubts: what looks odd in the log, a sentence each.
        left_out: a sentence for everything that the log cannot tell, with the reason.
        meanings: issue -> when a service has it, with the thresholds used.
        within: what the strata are; empty without strata.
        late: seconds after which a response is late; NaN if the log says nothing of waiting.
        judges: whose judgements the detector learned from.
    """

    title: str
    log: Mapping[str, Any]
    mapping: Sequence[tuple[str, str, str]]
    command: str
    synthetic: bool = False
    doubts: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    meanings: Mapping[str, str] = field(default_factory=dict)
    within: str = ""
    late: float = math.nan
    judges: str = SIMULATED


def meanings(thresholds: Thresholds, late: float) -> dict[str, str]:
    """When a service has each of the paper's issues, in words.

    Args:
        thresholds: distances in metres.
        late: seconds after which a response is late.
    """
    near, far, risk = (f"{d:g}{SPACE}m" for d in
                       (thresholds.nearest, thresholds.farthest, thresholds.risk))  # fmt: skip
    return {
        "willingness": "no response",
        "quality": f"a response nearer than {near} or farther than {far}",
        "priority": f"a response after more than {seconds(late)}",
        "risk": f"nearer than {risk} at any moment",
    }


class OfGroup(Protocol):
    """A finding of one group of an identity."""

    @property
    def identity(self) -> str:
        """Name of the identity."""
        ...

    @property
    def group(self) -> str:
        """Name of the group."""
        ...


def shown(name: str) -> str:
    """A name from a log without what would break or turn around the line that shows it."""
    return "".join(
        "\N{REPLACEMENT CHARACTER}"
        if letter in _TURNING or unicodedata.category(letter) in _UNSEEN
        else letter
        for letter in name
    )


def p_value(p: float, sign: bool = False) -> str:
    """A p-value with three decimals; ``sign`` puts = before it where there is no <."""
    if math.isnan(p):
        return NOT_KNOWN
    if p < 0.001:
        return f"<{SPACE}0.001"
    return f"={SPACE}{p:.3f}" if sign else f"{p:.3f}"


def seconds(value: float) -> str:
    """A time; NaN in words."""
    if math.isnan(value):
        return NOT_KNOWN
    return f"{value:,.2f}".rstrip("0").rstrip(".") + f"{SPACE}s"


def level(findings: Findings) -> str:
    """Coverage of the intervals."""
    return f"{100 * (1 - findings.settings.verdict.alpha):g}{SPACE}%"


def delta(findings: Findings) -> str:
    """The relevant difference in percentage points."""
    return f"{100 * findings.settings.verdict.delta:g} percentage points"


def who(one: OfGroup) -> str:
    """A group with its identity."""
    return f"“{shown(one.group)}” ({shown(one.identity)})"


def services(n: int, kind: str = "services") -> str:
    """How many services; ``kind`` is a plural in s."""
    return f"{n:,} {kind if n != 1 else kind[:-1]}"


def of_groups(n: int) -> str:
    """How many groups."""
    return f"{n:,} group{'s' if n != 1 else ''}"


def last(p: float) -> float:
    """A p-value for sorting: what is not known comes last."""
    return math.inf if math.isnan(p) else p


def same(within: str) -> str:
    """Such as "within the same site"."""
    return f"within the same {shown(within)}"


def rounded_up(needed: float) -> int:
    """An estimate of how many are needed, with two leading digits."""
    unit = 10 ** max(0, len(str(int(needed))) - 2)
    return math.ceil(needed / unit) * unit
