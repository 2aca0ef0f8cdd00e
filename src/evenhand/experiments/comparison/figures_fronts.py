"""Room: the figure of hypervolumes. Takes: the table of fronts. Gives: a figure.

A panel a scenario, a line a method, a mark an algorithm: evenness and service in one number.
"""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.experiments.comparison.figures import looks as looks_of
from evenhand.experiments.comparison.figures import own
from evenhand.report import figure as figures
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table

COLUMNS = ("scenario", "algorithm", "method", "hypervolume", "low", "high", "seeds", "arms")
_LOOKS = {
    "ppo": style.Look("PPO", style.BLUE, "s"),
    "reinforce": style.Look("REINFORCE", style.VERMILLION, "o", filled=False),
    "ppo-all": style.Look("PPO, all answers", style.GREEN, "D"),
    "reinforce-all": style.Look("REINFORCE, all answers", style.ORANGE, "^", filled=False),
}


def draw_all(fronts: Table) -> list[figures.Drawn]:
    """The figure, if any method that learns has a hypervolume.

    Args:
        fronts: at least the columns of ``COLUMNS``.
    """
    known = (fronts["algorithm"] != "none") & ~np.isnan(fronts["hypervolume"])
    if not known.any():
        return []
    keep = fronts["method"] != "untrained"
    data = Table({name: fronts[name][keep] for name in COLUMNS})
    return [figures.draw(_PLATE, Results({"fronts": data}, {}, []))]


def draw(data: Table, wide: bool) -> Figure:
    """The farther right, the more evenness and service together."""
    scenarios = data.distinct("scenario")
    there = data.where(algorithm="none")["method"].tolist()
    methods = [name for name in looks_of() if name in data["method"] and name not in there]
    columns = min(len(scenarios), 3 if wide else 1)
    lines = math.ceil(len(scenarios) / columns)
    algorithms = [name for name in data.distinct("algorithm") if name != "none"]
    looks = style.looks(algorithms, _LOOKS)
    figure, axes = style.panels(
        wide, lines, columns, (0.175 * len(methods) + 0.75) * lines + 0.3, sharey=True
    )
    for place, (ax, scenario) in enumerate(zip(axes, scenarios, strict=False)):
        part = data.where(scenario=scenario)
        _panel(ax, part, methods, looks)
        ax.set_title(scenario)
        if place % columns == 0:
            for label, name in zip(ax.get_yticklabels(), methods, strict=True):
                label.set_fontweight("bold" if name in own() else "normal")
        if place + columns >= len(scenarios):
            ax.set_xlabel("hypervolume")
    for ax in axes[len(scenarios) :]:
        ax.set_axis_off()
    marks: list[Any] = [
        Line2D([], [], linestyle="none", label=look.label, **look.marks())
        for look in looks.values()
    ]
    if "reference" in data["method"]:
        line = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (1, 1.5))}
        marks.append(Line2D([], [], label="reference robot", **line))
    style.legend(figure, marks, wide, columns=3)
    return figure


def _panel(ax: Axes, part: Table, methods: list[str], looks: dict[str, style.Look]) -> None:
    for row in part.where(method="reference").rows():
        ax.axvline(row["hypervolume"], color=style.INK, linewidth=0.9, linestyle=(0, (1, 1.5)))
    offsets = np.linspace(-0.17, 0.17, len(looks)) if len(looks) > 1 else np.zeros(1)
    for offset, (algorithm, look) in zip(offsets, looks.items(), strict=True):
        for row in part.where(algorithm=algorithm).rows():
            y = methods.index(row["method"]) + float(offset)
            ax.plot([row["low"], row["high"]], [y, y], color=look.colour, linewidth=1.0)
            ax.plot(row["hypervolume"], y, **look.marks(), markersize=4)
    ax.set_yticks(range(len(methods)), [looks_of()[name].label for name in methods])
    ax.set_ylim(len(methods) - 0.5, -0.5)
    ax.locator_params(axis="x", nbins=5)
    style.bare(ax, "x")


def caption(results: Results, data: Table) -> str:
    """What the number is, seeds and strengths."""
    del results
    seeds = sorted(set(data["seeds"].tolist()))
    n = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
    return (
        "Area between a method's results (each strength one point: corrected total issue score and "
        "share of perfect services) and the worst point, which is no perfect service and as uneven "
        "as the worst arm that learned. 1 is even and perfect; it can be a little more, for chance "
        f"can make a corrected score negative. Interquartile means over {n} seeds, lines: 95 % "
        "bootstrap intervals. Evenhand's own methods are in bold."
    )


_PLATE = figures.Plate(
    "hypervolume",
    "Hypervolume: evenness and service in one number",
    "",
    "learning",
    "Dot charts, one panel a scenario, one line a method, one mark an algorithm.",
    lambda results: results["fronts"],
    draw,
    caption,
)
