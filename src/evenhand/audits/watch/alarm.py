"""A growing log under watch: an alarm that may be looked at at any time.

Services are taken in the order of the log, a fixed number at a time; each batch gives one signed
gap for every group and issue, and wealth is bet on them (:mod:`evenhand.statistics.sequential`).
Were everybody served alike, the chance that any of the alarms below is ever raised is at most
``alpha``, however often one looks: half of it goes to the alarms of single groups and issues
(Bonferroni over a number of streams that is fixed before anything is seen), half to the alarm of
all of them together (the average of their wealth). A group that turns up later begins with wealth
1 then, which spends nothing: its share was set aside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evenhand.audits.count.tally import Tally
from evenhand.core.errors import InputError, whole
from evenhand.methods.paper.scores import Counts, count, signed_gaps
from evenhand.methods.vocabulary import WINDOW
from evenhand.statistics import sequential
from evenhand.statistics.chance import check_level

TOGETHER = "all groups and issues together"


@dataclass(frozen=True)
class WatchSettings:
    """When an alarm is raised.

    Attributes:
        alpha: greatest chance of any false alarm, ever.
        batch: services that give one gap; chosen before the log is seen.
        most_groups: groups for which a share is set aside; later ones are not watched.
    """

    alpha: float = 0.05
    batch: int = WINDOW
    most_groups: int = 64

    def __post_init__(self) -> None:
        check_level("alpha", self.alpha)
        whole("batch", self.batch, 2, 1_000_000)
        whole("most_groups", self.most_groups, 2, 10_000)


@dataclass(frozen=True)
class Alarm:
    """Evidence that has become strong enough.

    Attributes:
        services: taken in until then.
        identity: empty for the alarm of all together.
        group: or ``TOGETHER``.
        issue: empty for the alarm of all together.
        gap: rate in the group less that of the rest, over all services so far; NaN for all.
        evidence: wealth, as a multiple of the limit that it reached.
    """

    services: int
    identity: str
    group: str
    issue: str
    gap: float
    evidence: float


@dataclass(frozen=True, eq=False)
class Watching:
    """Where the watch stands. G groups seen so far, K issues.

    Attributes:
        settings: of the watch.
        issues: names, [K].
        groups: (identity, group) in the order in which they turned up.
        wealth: of each group and issue, [G, K].
        counts: of all services so far, [G, K].
        services: taken in.
        raised: what has been raised so far; an alarm stays.
        left_out: groups beyond ``most_groups``.
    """

    settings: WatchSettings
    issues: tuple[str, ...]
    groups: tuple[tuple[str, str], ...]
    wealth: sequential.Wealth
    counts: Counts
    services: int = 0
    raised: tuple[Alarm, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()


def begin(settings: WatchSettings, issues: Sequence[str]) -> Watching:
    """Nothing seen yet."""
    k = len(issues)
    nothing = np.zeros((0, k))
    return Watching(
        settings,
        tuple(issues),
        (),
        sequential.start(0, k),
        Counts(nothing, nothing, nothing, nothing),
    )


def take(state: Watching, batches: Tally) -> Watching:
    """Take in some batches.

    Args:
        state: before.
        batches: counts of the next services, each stratum a batch, in order; strata are named by
            whole numbers and hold ``settings.batch`` services each.

    Returns:
        The state after them, with the alarms that they raised.

    Raises:
        InputError: when the log tells other issues now, or a batch is not full.
    """
    if batches.issues != state.issues:
        raise InputError(
            "changed log",
            f"the log told {', '.join(state.issues)} before and tells "
            f"{', '.join(batches.issues)} now: begin a new watch",
        )
    names, inside = batches.names(), batches.inside()
    for place in np.argsort([int(name) for name in batches.strata]):
        rows = np.flatnonzero(batches.stratum == place)
        n = batches.n[rows]
        if n.sum() != state.settings.batch:
            raise InputError(
                "shape batch", f"a batch has {n.sum()} services in place of {state.settings.batch}"
            )
        # whoever is seen in this batch for the first time, in an order that no later batch changes
        state = _with_groups(
            state, sorted(names[g] for g in np.flatnonzero(inside[rows].any(axis=0)))
        )
        every = np.zeros((len(rows), len(state.groups)))
        for g, name in enumerate(state.groups):
            if name in names:
                every[:, g] = inside[rows, names.index(name)]
        x, who = np.repeat(batches.x[rows], n, axis=0), np.repeat(every, n, axis=0)
        state = _bet(state, count(x, who))
    return state


def _with_groups(state: Watching, names: Sequence[tuple[str, str]]) -> Watching:
    """New groups begin with wealth 1; all services so far were outside of them."""
    new = [name for name in names if name not in state.groups and name not in state.left_out]
    room = state.settings.most_groups - len(state.groups)
    state = replace(state, left_out=(*state.left_out, *new[room:]))
    new = new[:room]
    if not new:
        return state
    shape = (len(new), len(state.issues))
    fresh = sequential.start(*shape)
    old, seen = state.wealth, state.counts
    nothing = np.zeros(shape)
    x, n = nothing, nothing
    if state.groups:
        x = np.tile(seen.inside_x[0] + seen.outside_x[0], (len(new), 1))
        n = np.tile(seen.inside_n[0] + seen.outside_n[0], (len(new), 1))
    later = Counts(inside_x=nothing, inside_n=nothing, outside_x=x, outside_n=n)
    return replace(
        state,
        groups=(*state.groups, *new),
        wealth=sequential.Wealth(
            np.concatenate([old.log_wealth, fresh.log_wealth]),
            np.concatenate([old.bet, fresh.bet]),
            np.concatenate([old.squares, fresh.squares]),
            np.concatenate([old.steps, fresh.steps]),
        ),
        counts=Counts(
            *(
                np.concatenate([getattr(seen, name), getattr(later, name)])
                for name in Counts.__dataclass_fields__
            )
        ),
    )


def _bet(state: Watching, counts: Counts) -> Watching:
    settings, k = state.settings, len(state.issues)
    wealth = sequential.bet(state.wealth, signed_gaps(counts))
    sums = state.counts + counts
    services = state.services + settings.batch
    streams = settings.most_groups * k
    known = {(one.identity, one.group, one.issue) for one in state.raised}
    raised = []
    evidence = wealth.log_wealth - np.log(2 * streams / settings.alpha)
    gaps = signed_gaps(sums)
    for g, i in np.argwhere(evidence >= 0.0):
        identity, group = state.groups[g]
        if (identity, group, state.issues[i]) not in known:
            raised.append(
                Alarm(
                    services,
                    identity,
                    group,
                    state.issues[i],
                    float(gaps[g, i]),
                    float(np.exp(evidence[g, i])),
                )
            )
    together = together_evidence(state, wealth)
    if together >= 1.0 and ("", TOGETHER, "") not in known:
        raised.append(Alarm(services, "", TOGETHER, "", float("nan"), together))
    return replace(
        state,
        wealth=wealth,
        counts=sums,
        services=services,
        raised=(*state.raised, *raised),
    )


def together_evidence(state: Watching, wealth: sequential.Wealth | None = None) -> float:
    """Average wealth of all streams, those not seen yet with 1, as a multiple of its limit."""
    now = state.wealth if wealth is None else wealth
    streams = state.settings.most_groups * len(state.issues)
    unseen = streams - now.log_wealth.size
    # far beyond any limit the exact number says nothing more
    average = (np.exp(np.minimum(now.log_wealth, 500.0)).sum() + unseen) / streams
    return float(average * state.settings.alpha / 2)
