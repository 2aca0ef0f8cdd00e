"""Room: the figure of the test (the paper's Fig. 8): scores, the chance floor, quality.

Takes: tables. Gives: the data drawn, a figure, a caption. Pure apart from matplotlib objects.
"""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.methods.vocabulary import ISSUES
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import arms_in
from evenhand.report.table import Table, seeds_text, table
from evenhand.statistics.means import SCORE, SHARE, mean_interval

TESTED = ("total", *ISSUES, "perfect_rate")


def scores_data(results: Results) -> Table:
    """Each seed, and the mean over seeds with its t interval."""
    rows: list[tuple[object, ...]] = []
    test = results["test"]
    for preset in test.distinct("preset"):
        for arm in arms_in(test.where(preset=preset)):
            part = test.where(preset=preset, arm=arm)
            for measure in TESTED:
                floor = mean_interval(part["floor"]).mean if measure == "total" else math.nan
                mean = mean_interval(part[measure], within=SCORE if measure == "total" else SHARE)
                rows.append((preset, arm, measure, "mean", mean.mean, mean.low, mean.high, floor))
                for row in part.rows():
                    own = row["floor"] if measure == "total" else math.nan
                    rows.append(
                        (
                            preset,
                            arm,
                            measure,
                            str(row["seed"]),
                            row[measure],
                            math.nan,
                            math.nan,
                            own,
                        )
                    )
    names = ("preset", "arm", "measure", "seed", "value", "ci_low", "ci_high", "chance_floor")
    return table(names, rows)


def scores_draw(data: Table, wide: bool) -> Figure:
    """Total score, the four issues, and service quality beside them; one row a preset."""
    presets, arms = data.distinct("preset"), arms_in(data)
    looks = style.looks(arms, style.ARMS)
    figure = style.new_figure(wide, (2.35 if wide else 3.7) * len(presets) + 0.4)
    parts = {"T": ("total",), "I": ISSUES, "Q": ("perfect_rate",)}
    titles = {"T": "total issue score", "I": "four issues", "Q": "perfect services, %"}
    mosaic = "TIIIQ" if wide else "TQ\nII"
    tops = {
        key: np.nanmax([_top(data, measures), _top(data, measures, "chance_floor"), 0.05])
        for key, measures in parts.items()
    }
    blocks = figure.subfigures(len(presets), 1, squeeze=False, hspace=0.03)[:, 0]
    for block, preset in zip(blocks, presets, strict=True):
        block.suptitle(style.preset_short(preset), x=0.01, ha="left", fontsize=8.5, weight="bold")
        for key, ax in block.subplot_mosaic(mosaic).items():
            scale = 100 if key == "Q" else 1
            for place, measure in enumerate(parts[key]):
                for rank, arm in enumerate(arms):
                    x = place + (rank - (len(arms) - 1) / 2) * 0.8 / max(len(arms), 4)
                    _dot(
                        ax,
                        data.where(preset=preset, arm=arm, measure=measure),
                        x,
                        scale,
                        looks[arm],
                    )
            ax.set_title(titles[key], fontweight="normal", fontsize=8)
            labels = ISSUES if key == "I" else [""]
            ax.set_xticks(range(len(parts[key])), labels)
            ax.tick_params(axis="x", length=0)
            ax.set_xlim(-0.55, len(parts[key]) - 0.45)
            ax.set_ylim(0, 100 if key == "Q" else 1.12 * tops[key])
            ax.locator_params(axis="y", nbins=5)
            style.bare(ax, "y")
    marks = [
        Line2D([], [], linestyle="none", label=look.label, **look.marks())
        for look in looks.values()
    ]
    marks.append(Line2D([], [], color=style.INK, linewidth=1.4, label="chance floor"))
    style.legend(figure, marks, wide, columns=5 if wide else 2)
    return figure


def _top(data: Table, measures: tuple[str, ...], column: str = "value") -> float:
    cells = np.concatenate(
        [
            np.r_[part[column], part["ci_high"] if column == "value" else []]
            for part in (data.where(measure=measure) for measure in measures)
        ]
    )
    return float(np.nanmax(np.r_[cells, 0.0]))


def _dot(ax: Axes, part: Table, x: float, scale: float, look: style.Look) -> None:
    """A mean with its interval, the seeds beside it, the chance floor across."""
    for row in part.rows():
        value = scale * row["value"]
        if row["seed"] != "mean":
            ax.plot(x + 0.065, value, ".", color=look.colour, markersize=2.8, alpha=0.6)
            continue
        ax.plot([x, x], [scale * row["ci_low"], scale * row["ci_high"]], color=look.colour)
        ax.plot(x, value, **look.marks(), markersize=4.6, zorder=4, clip_on=False)
        floor = row["chance_floor"]
        ax.plot([x - 0.085, x + 0.085], [floor, floor], color=style.INK, linewidth=1.4, zorder=5)


def scores_caption(results: Results, data: Table) -> str:
    """Services, seeds, intervals and the floor."""
    services = sorted(set(results["test"]["services"].tolist()))
    n = f"{services[0]:,}" if len(services) == 1 else f"{services[0]:,} to {services[-1]:,}"
    return (
        f"Test on {n} services a seed that no robot was trained on; "
        f"{seeds_text(results['test']['seed'].tolist())}. Large marks: mean over seeds; lines: "
        "95 % t intervals over seeds; small dots: single seeds. Chance floor: the total score that "
        "a perfectly even robot with the same issue rates is expected to get by chance alone. "
        "Right: the share of perfect services, without which a low score says little."
    )
