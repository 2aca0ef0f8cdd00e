"""Figure of self-reflection for learners of other libraries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from evenhand.core.errors import InputError
from evenhand.methods.beyond.reflection import Reflection, ReflectionSettings
from evenhand.report import reflection_figure
from evenhand.report.table import Table, say_share, table

HEADS = (
    "preset", "arm", "epoch", "projection", "p_value", "earlier", "rate", "alarm", "identity",
    "issue", "favoured", "able",
)  # fmt: skip


@dataclass(frozen=True)
class Examined:
    """Updates of a run, examined one after the other.

    Attributes:
        updates: the first one first.
        settings: by which they were examined.
    """

    updates: Sequence[Reflection]
    settings: ReflectionSettings


def updates_table(runs: Mapping[str, Examined]) -> Table:
    """A row for each update: change of the total score, how rare it is, what it favoured."""
    rows = [
        (
            "", name, number, float(one.projection[-1, -1]), one.p_value,
            min(number, run.settings.history), run.settings.rate, float(one.alarm),
            one.identity if one.alarm else None, one.issue if one.alarm else None,
            ", ".join(one.favoured) if one.alarm else None,
        )
        for name, run in runs.items()
        for number, one in enumerate(run.updates)
    ]  # fmt: skip
    if not rows:
        raise InputError("no update was examined: leave these runs out")
    return reflection_figure.able_or_not(table(HEADS[:-1], rows))


def caption(data: Table, runs: Mapping[str, Examined]) -> str:
    """What the figure shows, and alarms beside what is to be expected by chance."""
    counts = []
    for name in runs:
        part = data.where(arm=name)
        able = part["able"] == 1
        if not able.any():
            counts.append(f"{name}, none could be raised")
            continue
        expected = float(part["rate"][able].sum())
        alarms = int(part["alarm"].sum())
        counts.append(f"{name}, {alarms} of {int(able.sum()):,} ({expected:.1f})")
    return (
        "Above: change of the total issue score that an update makes, to first order. Below: share "
        "of the latest updates, itself included, that raise bias at least as abnormally in some "
        f"identity and issue; an alarm is raised from {say_share(float(data['rate'].max()))} down; "
        "its mark is the identity, its letter the first of the issue. Alarms, of the updates with "
        "enough earlier ones to raise one, beside the most that the rate lets expect where nothing "
        f"is wrong: {'; '.join(counts)}."
    )
