"""What an operator should know of a count before believing it, one sentence each."""

from __future__ import annotations

from evenhand.audits.count.groups import numeric, twins
from evenhand.audits.count.tally import UNKNOWN, Tally
from evenhand.audits.read.mapping import Mapping
from evenhand.core.errors import InputError

MANY_NUMBERS = 30
"""Numeric groups of an identity beyond which binning is proposed."""


def remarks(tally: Tally, mapping: Mapping, name: str, alone: bool = False) -> tuple[str, ...]:
    """Doubts about the groups and about waiting.

    Args:
        tally: the counts.
        mapping: by which it was counted.
        name: of the log.
        alone: accept that nothing can be compared.

    Raises:
        InputError: when no identity has two groups, so that nothing can be compared.
    """
    found = []
    if not alone and all(len(one.groups) < 2 for one in tally.identities):
        shown = ", ".join(f"{one.name} ({', '.join(one.groups)})" for one in tally.identities)
        raise InputError(
            "empty identities",
            f"{name}: every identity has one group only, {shown}: nothing to compare",
        )
    for one in tally.identities:
        known = [group for group in one.groups if group != UNKNOWN]
        if len(one.groups) < 2:
            found.append(f"identity {one.name!r} has one group only: there is nothing to compare")
        if one.name not in mapping.bins and len(known) > MANY_NUMBERS and numeric(known):
            found.append(
                f"identity {one.name!r} has {len(known)} groups that are numbers: bin them, as "
                f"{one.name}=18,40,65"
            )
        for a, b in twins(one.groups)[:3]:
            found.append(f"groups {a!r} and {b!r} of {one.name!r} differ in spelling only")
    if tally.waits is not None:
        lost = tally.services - tally.waits.services
        if lost:
            found.append(
                f"{lost} of {tally.services} services do not tell how long people waited: they are "
                "left out where waiting is compared"
            )
    return tuple(found)
