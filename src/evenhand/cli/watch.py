"""``evenhand watch``."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from evenhand.cli.audit import FOUND, Columns
from evenhand.core.errors import InputError

if TYPE_CHECKING:
    from evenhand.audits.watch.alarm import Alarm, Watching, WatchSettings
    from evenhand.audits.watch.tail import Follower


@dataclass(frozen=True)
class Watch(Columns):
    """Watch a growing log and raise an alarm when a group is served worse.

    A batch of services at a time, in the order of the log, bets are made against evenness; their
    wealth is the evidence. Were everybody served alike, the chance of any false alarm is at most
    --alpha, however long and however often one looks. Stop it with Ctrl-C.

    For instance: evenhand watch fleet.csv --once
    """

    log: Positional[Annotated[str, arg(metavar="LOG", help_behavior_hint="(required)")]] = ""
    """CSV, TSV or JSON Lines file that is appended to, or the URL of a database (--order-by)."""

    order_by: Annotated[str | None, arg(metavar="COLUMN", help_behavior_hint="(optional)")] = None
    """In a database: the column of time. Rows must not be added before rows already seen."""

    batch: int = 30
    """Services that are compared together; choose it before looking at the log."""

    alpha: float = 0.05
    """Greatest chance of any false alarm, ever."""

    most_groups: int = 64
    """Groups for which evidence is kept; later ones are named, and not watched."""

    every: float = 2.0
    """Seconds between two looks."""

    once: bool = False
    """Take in what is there, and end."""

    fail_on: Literal["nothing", "alarm"] = "nothing"
    """For pipelines: alarm ends with exit code 3 at the first alarm."""

    def run(self, command: str) -> int:
        """Look again and again; print each alarm as it is raised."""
        if not self.log:
            raise InputError("missing log", "no log is given: name a file or the URL of a database")
        if not 0.05 <= self.every <= 86_400:
            raise InputError("range every", f"every is {self.every}: give 0.05 to 86,400 seconds")
        from evenhand.audits import api
        from evenhand.audits.watch import alarm, tail

        settings = alarm.WatchSettings(self.alpha, self.batch, self.most_groups)
        mapping = self.mapping()
        log = tail.follower(
            self.log,
            self.table,
            self.order_by,
            self.batch,
            lambda source: api.mapping_for(source, mapping, {}),
            self.once,
        )
        try:
            return self._follow(log, settings)
        finally:
            log.source.close()

    def _follow(self, log: Follower, settings: WatchSettings) -> int:
        from evenhand.audits.watch import alarm

        grows = not self.once and (log.tail is not None or log.order is not None)
        state: Watching | None = None
        while True:
            new = log.next()
            if new is not None:
                before = state or alarm.begin(settings, new.issues)
                state = alarm.take(before, new)
                _tell(before, state)
                if state.raised and self.fail_on == "alarm":
                    return FOUND
                continue
            if not grows:
                break
            time.sleep(self.every)
        print(_conclusion(state, self.batch, log.left))
        return 0


def _tell(before: Watching, after: Watching) -> None:
    for one in after.raised[len(before.raised) :]:
        print(_sentence(one), flush=True)
    for identity, group in after.left_out[len(before.left_out) :]:
        print(f"note: {group} ({identity}) came too late to be watched", file=sys.stderr)


def _sentence(one: Alarm) -> str:
    if not one.identity:
        return f"alarm after {one.services:,} services: {one.group} are not served alike"
    more = "more" if one.gap > 0 else "less"
    return (
        f"alarm after {one.services:,} services: {one.group} ({one.identity}), {one.issue}: "
        f"{100 * abs(one.gap):.1f} percentage points {more} than the others so far"
    )


def _conclusion(state: Watching | None, batch: int, left: int) -> str:
    if state is None:
        return f"no alarm: there are fewer than {batch} services, which make a batch"
    log_wealth = state.wealth.log_wealth
    at = divmod(int(log_wealth.argmax()), log_wealth.shape[1])
    identity, group = state.groups[at[0]]
    streams = state.settings.most_groups * len(state.issues)
    limit = math.log(2 * streams / state.settings.alpha)
    share = math.exp(min(0.0, float(log_wealth[at]) - limit))
    said = f"{len(state.raised)} alarms" if state.raised else "no alarm"
    rest = f"; {left:,} more make no full batch and were not looked at" if left else ""
    return (
        f"{said} in {state.services:,} services; the strongest evidence is {group} ({identity}), "
        f"{state.issues[at[1]]}, at {100 * share:.3g} % of what raises an alarm of its own{rest}"
    )
