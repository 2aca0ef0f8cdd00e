"""Room: figure of self-reflection: every update along the bias gradient, and which were abnormal.

Takes: tables. Gives: the data drawn, figures, captions. Pure apart from matplotlib objects.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from evenhand.core.wording import percent
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import Look, arms_in
from evenhand.report.table import Table, say

NAMED = 3  # favoured groups in a caption, the most frequent first
_IDENTITIES = {
    "race": Look("race", style.BLUE, "s"),
    "gender": Look("gender", style.PURPLE, "v"),
    "age": Look("age", style.VERMILLION, "^"),
    "disability": Look("disability", style.GREEN, "D"),
    "skin": Look("skin", style.ORANGE, "P"),
}
_LIMIT: dict[str, Any] = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (1, 1.5))}
_UPDATE: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 1.7,
    "markeredgewidth": 0,
    "color": style.GREY,
    "alpha": 0.6,
}


def reflection_data(results: Results) -> Table:
    """Every examined update, see `able_or_not`."""
    return able_or_not(results["reflection"])


def able_or_not(data: Table) -> Table:
    """Examined updates with a column more: ``able``, whether an alarm could have been raised.

    Of m earlier updates and itself an update ranks 1/(m + 1) at best: no alarm can be raised
    before that is down at the stated rate.
    """
    able = 1.0 / (np.maximum(data["earlier"], 0) + 1.0) <= data["rate"]
    return Table({**data.columns, "able": able.astype(np.int64)})


def reflection_draw(data: Table, wide: bool, unit: str = "epoch") -> Figure:
    """One column an arm: the change of the score above, how rare the update is below."""
    cells = _arms(data)
    shape = (2, len(cells)) if wide else (2 * len(cells), 1)
    height = 4.3 if wide else 3.5 * len(cells) + 0.7
    figure, axes = style.panels(wide, *shape, height, sharex=True)
    looks = style.looks(sorted(set(map(_who, data.where(alarm=1.0).rows()))), _IDENTITIES)
    span = max(0.01, 1.15 * float(np.nanmax(np.abs(np.r_[data["projection"], 0.0]))))
    for place, (preset, arm) in enumerate(cells):
        part = data.where(preset=preset, arm=arm)
        above, below = (
            (axes[place], axes[place + len(cells)]) if wide else axes[2 * place : 2 * place + 2]
        )
        title = style.arm_label(arm)
        above.set_title(title if len(data.distinct("preset")) == 1 else f"{title}, {preset}")
        above.axhline(0.0, color=style.GREY, linewidth=0.7)
        _updates(above, part, "projection", looks)
        above.set_yscale("symlog", linthresh=0.01, linscale=0.6)
        ticks = [tick for tick in (0.01, 0.1, 1.0) if tick <= span]
        values = [*(-tick for tick in reversed(ticks)), 0.0, *ticks]
        above.set_yticks(values, [say(v, 2).replace("0.00", "0") for v in values])
        above.set_ylim(-span, span)
        below.axhline(float(part["rate"][0]), **_LIMIT)
        _updates(below, part, "p_value", looks)
        below.set_yscale("log")
        low = max(1e-4, min(0.005, 0.7 * float(part["p_value"].min())))
        below.set_ylim(1.2, low)  # the rarest on top
        marks = [tick for tick in (1.0, 0.1, 0.01, 0.001) if tick >= low]
        below.set_yticks(marks, [f"{100 * tick:g} %" for tick in marks])
        below.set_xlabel(unit)
        for ax in (above, below):
            ax.yaxis.set_minor_locator(NullLocator())
            _too_few(ax, part)
            ax.margins(x=0.01)
            style.bare(ax, "y")
        if not (wide and place):
            above.set_ylabel("change of the\ntotal score")
            below.set_ylabel("updates as extreme")
    handles: list[Artist] = [
        Line2D([], [], linestyle="none", label=f"abnormal: {look.label}", **look.marks())
        for look in looks.values()
    ]
    handles.append(Line2D([], [], label="limit of an alarm", **_LIMIT))
    handles.append(Patch(color=style.PALE, label="too few earlier updates"))
    handles.append(Line2D([], [], label="an update", **_UPDATE))
    style.legend(figure, handles, wide)
    return figure


def _who(row: Mapping[str, Any]) -> str:
    return row["identity"] or "not said"


def _updates(ax: Axes, part: Table, column: str, looks: dict[str, Look]) -> None:
    ax.plot(part["epoch"], part[column], **_UPDATE)
    for row in part.where(alarm=1.0).rows():
        at = (row["epoch"], row[column])
        if math.isnan(at[1]):
            continue
        ax.plot(*at, zorder=4, clip_on=False, **looks[_who(row)].marks())
        ax.annotate(
            row["issue"][:1].upper(),
            at,
            (5, 0),
            textcoords="offset points",
            va="center",
            fontsize=6.5,
            zorder=5,
        )


def _too_few(ax: Axes, part: Table) -> None:
    """Shade the epochs in which no alarm was possible."""
    early = part["epoch"][part["able"] == 0]
    if len(early):
        ax.axvspan(early.min() - 0.5, early.max() + 0.5, color=style.PALE, alpha=0.6, zorder=0)


def reflection_caption(results: Results, data: Table) -> str:
    """Alarms against the stated rate: seeds, n, and what was favoured."""
    seeds = len(data.distinct("seed"))
    counts = [_count(data.where(preset=preset, arm=arm)) for preset, arm in _arms(data)]
    favoured = Counter(
        f"{row['identity']} {row['favoured'].split(', ')[0]} in {row['issue']}"
        for row in data.where(alarm=1.0).rows()
        if row["favoured"]
    )
    named = "; ".join(f"{what}, {n}×" for what, n in favoured.most_common(NAMED))
    words = (
        f"{seeds} {'seed' if seeds == 1 else 'seeds'} an arm. Every update is examined along the "
        "directions that raise the issue scores. Above: the change of the total issue score that "
        "it makes to first order; where no group differed there is no direction and no dot. Below: "
        "the share of the latest updates, itself included, that raise bias at least as abnormally "
        "in some identity and issue; an alarm is raised from the stated rate of "
        f"{percent(float(data['rate'].max()))} down; its mark is the identity, "
        "its letter the issue (Willingness, Quality, Priority, Risk). As it is about one identity "
        "and issue, the total may fall all the same. "
        "Alarms, of the updates with enough earlier ones to raise one, beside the most that the "
        f"rate lets expect where nothing is wrong: {'; '.join(counts)}."
    )
    most = "Most often favoured" if len(favoured) > NAMED else "Favoured"
    return f"{words} {most}: {named}." if named else words


def _arms(data: Table) -> list[tuple[str, str]]:
    presets = data.distinct("preset")
    return [(preset, arm) for preset in presets for arm in arms_in(data.where(preset=preset))]


def _count(part: Table) -> str:
    able = part["able"] == 1
    arm = style.arm_label(part["arm"][0])
    if not able.any():
        return f"{arm}, none could be raised"
    expected = float(part["rate"][able].sum())
    return f"{arm}, {int(part['alarm'].sum())} of {int(able.sum()):,} ({expected:.1f})"
