"""Room: the figures of the comparison: evenness against service, a panel a scenario.

Takes: one row for each arm. Gives: a figure of each algorithm.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.methods import registry
from evenhand.report import figure as figures
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, say, table
from evenhand.training.learners import LABELS

Look = style.Look
CONTROLS = {
    "reference": Look("reference robot", style.INK, "*"),
    "untrained": Look("untrained", style.GREY, "x"),
}
_AIMS = ("corrected_total", "perfect_rate")
_ENDS = ("", "_low", "_high")
POOLED = "all"
"""Rows over all scenarios but even; they are no panel."""
RECOMMENDED = "levelup"


def looks() -> dict[str, Look]:
    """How every arm's method is drawn: the paper's and Evenhand's filled, published ones hollow."""
    entries = [registry.entry(name) for name in registry.names()]
    spare = style.looks([one.name for one in entries if one.colour is None], {})
    return CONTROLS | {
        one.name: Look(
            one.label,
            one.colour or spare[one.name].colour,
            one.marker or (spare[one.name].marker if one.name in spare else "o"),
            filled=one.filled,
        )
        for one in entries
    }


def own() -> list[str]:
    """Evenhand's own methods, the recommended one first."""
    found = [name for name in registry.names() if registry.entry(name).own]
    return sorted(found, key=lambda name: name != RECOMMENDED)


def draw_all(rows: Sequence[Mapping[str, Any]], services: int) -> list[figures.Drawn]:
    """Draw a figure for each algorithm, with the arms that learn nothing.

    Args:
        rows: scenario, algorithm, arm, seeds, and corrected_total and perfect_rate each with
            _low and _high; NaN where missing.
        services: in the test of every run.
    """
    return [
        figures.draw(_plate(algorithm, services), Results({"compare": part}, {}, []))
        for algorithm, part in _parts(rows).items()
    ]


def figure_of(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """The wide figure of the first algorithm; rows as `draw_all`."""
    return draw(next(iter(_parts(rows).values())), True)


def _parts(rows: Sequence[Mapping[str, Any]]) -> dict[str, Table]:
    """What is drawn of each algorithm."""
    columns = [f"{aim}{end}" for aim in _AIMS for end in _ENDS]
    names = ["scenario", "algorithm", "arm", "seeds", *columns]
    data = table(
        names, [[row[name] for name in names] for row in rows if row["scenario"] != POOLED]
    )
    learning = [name for name in data.distinct("algorithm") if name != "none"]
    found = {}
    for algorithm in learning or ["none"]:
        keep = (data["algorithm"] == algorithm) | (data["algorithm"] == "none")
        found[algorithm] = Table({name: cells[keep] for name, cells in data.columns.items()})
    return found


def _plate(algorithm: str, services: int) -> figures.Plate:
    labels = [LABELS[algorithm]] if algorithm in LABELS else []
    return figures.Plate(
        f"compare_{algorithm}",
        ", ".join(["Evenness against service", *labels]),
        "",
        "learning",
        "Scatter charts, one panel a scenario, one mark an arm: corrected total issue score "
        "against the share of perfect services.",
        lambda results: results["compare"],
        draw,
        lambda results, data: caption(data, services),
    )


def draw(data: Table, wide: bool) -> Figure:
    """A panel for each scenario; the better an arm, the nearer to the lower right corner."""
    scenarios = data.distinct("scenario")
    columns = min(len(scenarios), 3 if wide else 1)
    lines = math.ceil(len(scenarios) / columns)
    known = looks()
    methods = [name for name in known if name in {_method(arm) for arm in data["arm"]}]
    legend = 0.18 * math.ceil(len(methods) / (5 if wide else 2)) + 0.15
    figure, axes = style.panels(wide, lines, columns, (2.3 if wide else 2.5) * lines + legend)
    for place, (ax, scenario) in enumerate(zip(axes, scenarios, strict=False)):
        part = data.where(scenario=scenario)
        for method in methods:
            _series(ax, part, method, known[method])
        _look_closer(ax, part)
        ax.axhline(0.0, color=style.GREY, linewidth=0.8, linestyle=":")
        ax.set_title(scenario, pad=15)
        if place + columns >= len(scenarios):  # nothing below it
            ax.set_xlabel("perfect services, %")
        if place % columns == 0:
            ax.set_ylabel("corrected total issue score")
        ax.locator_params(nbins=5)
    for ax in axes[len(scenarios) :]:
        ax.set_axis_off()
    marks = [
        Line2D([], [], linestyle="none", label=known[name].label, **known[name].marks())
        for name in methods
    ]
    style.legend(figure, marks, wide, columns=5 if wide else 2)
    return figure


def _method(arm: str) -> str:
    return arm.partition("@")[0]


def _series(ax: Axes, part: Table, method: str, look: Look) -> None:
    """The strengths of a method with their intervals, joined from the least service on."""
    rows = [row for row in part.rows() if _method(row["arm"]) == method]
    rows.sort(key=lambda row: row["perfect_rate"])
    x, x_low, x_high = (np.array([100 * row[f"perfect_rate{e}"] for row in rows]) for e in _ENDS)
    y, y_low, y_high = (np.array([row[f"corrected_total{e}"] for row in rows]) for e in _ENDS)
    front = 7 if method == RECOMMENDED else 6 if method in own() else 5 if look.filled else 4
    for i, row in enumerate(rows):
        line = {"color": look.colour, "linewidth": 0.9, "alpha": 0.7, "zorder": front - 2.5}
        ax.plot([x_low[i], x_high[i]], [y[i], y[i]], **line)
        ax.plot([x[i], x[i]], [y_low[i], y_high[i]], **line)
        size = 3.6 if "@" in row["arm"] else 5.2
        ax.plot(x[i], y[i], **look.marks(), markersize=size, linestyle="none", zorder=front)
    ax.plot(x, y, color=look.colour, linewidth=0.9, linestyle="--", zorder=front - 0.5)


_MARK = 0.04
"""Half a mark, as a share of an axis."""


def _look_closer(ax: Axes, part: Table) -> None:
    """Show what learned; an untrained robot far from it is given in numbers instead."""
    learned = part["arm"] != "untrained"
    at = [
        (100 * row["perfect_rate"], row["corrected_total"])
        for row in part.rows()
        if row["arm"] == "untrained" and not math.isnan(row["corrected_total"])
    ]
    for axis, aim, scale in (("x", "perfect_rate", 100), ("y", "corrected_total", 1)):
        numbers = scale * np.concatenate([part[f"{aim}{end}"][learned] for end in _ENDS])
        if np.isnan(numbers).all():
            return
        low, high = float(np.nanmin(numbers)), float(np.nanmax(numbers))
        margin = max(0.08 * (high - low), 0.005 * scale)
        low, high = low - margin, high + margin
        if aim == "perfect_rate":  # nothing lies beyond 100 %; half a mark has to fit in
            width = high - low
            low, high = max(low, -_MARK * width), min(high, 100 + _MARK * width)
        ax.set(**{f"{axis}lim": (low, high)})
    for x, y in at:
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        across, up = _MARK * (right - left), _MARK * (top - bottom)
        if left - across <= x <= right + across and bottom - up <= y <= top + up:
            ax.set_xlim(min(left, x - across), max(right, x + across))  # the whole mark
            ax.set_ylim(min(bottom, y - up), max(top, y + up))
        else:
            text = f"untrained: {x:.0f} % perfect, score {say(y)}"
            ax.annotate(text, (0, 1), (0, 4), xycoords="axes fraction",
                        textcoords="offset points", color=style.GREY, fontsize=7)  # fmt: skip


def caption(data: Table, services: int) -> str:
    """Services, seeds, intervals, and what the axes mean."""
    seeds = sorted({int(n) for n in data["seeds"].tolist()})
    n = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
    return (
        f"Tests on {services:,} services a seed that no robot was trained on, {n} seeds an arm. "
        "Marks: interquartile means; lines: 95 % bootstrap intervals. The corrected total issue "
        "score is that of all services less what chance alone gives: 0 is even, so the best place "
        "is at the lower right. Small marks are other strengths of a method, joined to it. An "
        "untrained robot far from all others is given in numbers."
    )
