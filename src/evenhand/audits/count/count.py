"""A table and a mapping become a Tally: grouped counts, the same on every engine.

The engine counts services that agree in raw identities, stratum and issues; what they waited and
their measures are counted after that (:mod:`evenhand.audits.count.waits_and_measures`).
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from evenhand.audits.count import checks, group_by, waits_and_measures
from evenhand.audits.count.arrow_arrays import integers
from evenhand.audits.count.group_by import Lookup, truth
from evenhand.audits.count.remarks import remarks
from evenhand.audits.count.tally import Tally
from evenhand.audits.read.facts import Facts, facts, issues
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.sources import Source
from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES


def tally(
    source: Source, mapping: Mapping, alone: bool = False, waiting: bool = True
) -> tuple[Tally, tuple[str, ...]]:
    """Count a log.

    Args:
        source: the log.
        mapping: what its columns stand for.
        alone: accept a log in which every identity has one group only.
        waiting: count how long people waited too.

    Returns:
        The counts, and what is hardly meant or was left out, one sentence each.

    Raises:
        InputError: for a column that does not exist or holds something else, with row and value;
            for identities with too many groups or with one only; for a log that cannot be read or
            changes meanwhile.
    """
    for _, column in mapping.roles():
        if column not in source.table.columns:
            raise unknown(f"column of {source.name}", column, source.table.columns)
    read = facts(source.table, mapping)
    checked = checks.look(source, mapping, read)
    keys = group_by.keys_of(source.table, mapping, read)
    try:
        counted = group_by.count(
            source, {**keys.columns, **_flags(read, mapping), **checks.doubts(read, mapping)}
        )
    except InputError:
        checks.refuse_wrong(source, mapping, read)
        raise
    warnings = checks.check(source, mapping, read, counted)
    n = integers(counted["n"])
    _check_total(source, checked.services, int(n.sum()))

    codes, identities = [], []
    for i, name in enumerate(mapping.identities):
        one, code = group_by.identity(source, name, counted[f"i{i}"], mapping.bins.get(name))
        identities.append(one)
        codes.append(code)
    stratum, strata = group_by.strata_of(source, counted, keys.strata)
    names, x = _issues(counted, mapping)
    told = np.column_stack([*codes, stratum, x])
    rows, n = group_by.merged(told, n)
    d = len(codes)
    combinations = len(np.unique(rows[:, : d + 1], axis=0))
    lookup = Lookup(source, mapping, keys, tuple(identities), strata, combinations)
    result = Tally(
        identities=tuple(identities),
        issues=names,
        strata=strata,
        codes=rows[:, :d].astype(np.int64),
        stratum=rows[:, d].astype(np.int64),
        x=rows[:, d + 1 :],
        n=n,
        waits=waits_and_measures.waits(lookup, read) if waiting else None,
        values=tuple(
            waits_and_measures.values(lookup, read, column, spread, checked.services)
            for column, spread in checked.spreads.items()
        ),
    )
    source.check_unchanged()
    return result, (
        *warnings,
        *remarks(result, mapping, source.name, alone),
        *(
            f"measure {column!r} is counted in {waits_and_measures.FINE} steps between its "
            "quartiles: means are exact, medians to a step"
            for column, spread in checked.spreads.items()
            if waits_and_measures.in_steps(spread, checked.services)
        ),
    )


def _flags(read: Facts, mapping: Mapping) -> dict[str, str]:
    responded = read.value("responded")
    flags = dict(issues(read, mapping))
    return flags if responded is None else {"responded": responded, **flags}


def _check_total(source: Source, before: int, after: int) -> None:
    if after != before or source.rows not in (None, after):
        raise InputError(
            "changed log",
            f"{source.name} changed while it was read, from {source.rows or before} to {after} "
            "services: audit a copy",
        )


def _issues(counted: pa.Table, mapping: Mapping) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the issues that the log tells, and 1, 0 or NaN for each, float64 [C, K]."""
    responded = truth(counted, "responded")
    columns = []
    names = [issue.name for issue in PAPER_ISSUES if issue.name not in mapping.missing]
    for name in names:
        if name == "willingness":
            columns.append(1.0 - responded)
        elif name == "risk" or not mapping.responded:
            columns.append(truth(counted, name))
        else:
            columns.append(np.where(responded == 1.0, truth(counted, name), np.nan))
    return tuple(names), np.stack(columns, axis=1) if columns else np.empty((counted.num_rows, 0))
