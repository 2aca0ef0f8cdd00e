"""How long people waited, and continuous measures, as counts by who was served where."""

from __future__ import annotations

import numpy as np

from evenhand.audits.count import checks
from evenhand.audits.count.arrow_arrays import floats, integers
from evenhand.audits.count.group_by import MOST_ROWS, Lookup, count, merged, truth
from evenhand.audits.count.tally import Values, Waits
from evenhand.audits.read import facts
from evenhand.audits.read.engines import number
from evenhand.audits.read.facts import CAP, GRID, Facts

EXACT = 200_000
"""Services up to which a continuous measure is counted value by value."""

FINE = 200
"""Steps between the quartiles of a measure that is counted in steps."""

_EVEN = 100 * FINE  # steps of one width on either side; those beyond grow by a 200th each


def waits(lookup: Lookup, read: Facts) -> Waits | None:
    """Waiting as counts, or None where the log says nothing of it.

    All identities are counted together while that stays a count, else each by itself: waiting is
    compared in one identity after the other.
    """
    mapping, keys = lookup.mapping, lookup.keys
    found = facts.waiting(read, mapping)
    if found is None:
        return None
    few = lookup.combinations * CAP <= MOST_ROWS
    told, n = [], []
    for names in [keys.identities] if few else [(name,) for name in keys.identities]:
        columns = {name: keys.columns[name] for name in (*names, *keys.strata)}
        counted = count(lookup.source, {**columns, **found})
        step, responses = facts.ended(
            floats(counted["step"]),
            truth(counted, "late"),
            truth(counted, "short"),
            truth(counted, "responded") if "responded" in found else None,
            mapping.waited is not None,
        )
        rows = np.column_stack([lookup.codes(counted), lookup.stratum(counted), step, responses])
        known = ~np.isnan(step)
        told.append(rows[known])
        n.append(integers(counted["n"])[known])
    rows, n = merged(np.concatenate(told), np.concatenate(n))
    if not len(n):
        return None
    d = len(lookup.identities)
    return Waits(
        codes=rows[:, :d].astype(np.int64),
        stratum=rows[:, d].astype(np.int64),
        step=rows[:, d + 1].astype(np.int64),
        responded=rows[:, d + 2] == 1.0,
        n=n,
        seconds=mapping.late / GRID,
        late=GRID,
    )


def values(
    lookup: Lookup, read: Facts, column: str, spread: checks.Spread, services: int
) -> Values:
    """A measure as counts: value by value, or in fine steps where there are too many values."""
    value = f"({read.value(f'measures {column}')})"
    stepped = in_steps(spread, services)
    sums = {"total": value} if stepped else {}
    columns = {**lookup.keys.columns, "key": _step(value, spread) if stepped else value}
    counted = count(lookup.source, columns, **sums)
    counted = counted.filter(counted["key"].is_valid())
    told = np.column_stack([lookup.codes(counted), lookup.stratum(counted), floats(counted["key"])])
    rows, n, *added = merged(told, integers(counted["n"]), *(floats(counted[one]) for one in sums))
    d = len(lookup.identities)
    middle = mean = rows[:, d + 1]
    if stepped:
        (total,) = added
        _, at = np.unique(middle, return_inverse=True)
        middle = (np.bincount(at, total) / np.bincount(at, n))[at]
        mean = total / n
    return Values(
        name=column,
        codes=rows[:, :d].astype(np.int64),
        stratum=rows[:, d].astype(np.int64),
        value=middle,
        mean=mean,
        n=n,
    )


def in_steps(spread: checks.Spread, services: int) -> bool:
    """Whether a measure is counted in steps."""
    return services > EXACT and spread.distinct > 10 * FINE and spread.high > spread.low


def _step(value: str, spread: checks.Spread) -> str:
    """Number of the step that a value lies in.

    Far out a step grows with its distance, to a 200th of it, so that what lies in one is nearly
    alike wherever it is.
    """
    width = number((spread.high - spread.low) / FINE)
    place = f"(({value} - {number(spread.low)}) / {width})"
    # 1 in place of what is near: some engines end a query at the logarithm of 0
    far = f"greatest(abs({place}) / {_EVEN}, {number(1.0)})"
    beyond = f"({_EVEN} + ceil(ln({far}) * {FINE})) * sign({place})"
    return f"case when abs({place}) > {_EVEN} then {beyond} else floor({place}) end"
