"""Room: figures of learning (the paper's Fig. 7).

Takes: tables. Gives: the data drawn, figures, captions. Pure apart from matplotlib objects.
"""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.methods.vocabulary import MANUAL_THRESHOLD
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import arms_in
from evenhand.report.table import Table, seeds_text, table, trailing_mean

AVERAGE = 40  # epochs in the running mean of the paper's Fig. 7


# --- score and service quality per epoch (Fig. 7) ---------------------------------------------


def curve_data(results: Results, column: str) -> Table:
    """Mean over seeds per epoch, least and largest seed, and the mean of the last 40 epochs."""
    rows: list[tuple[object, ...]] = []
    epochs = results["epochs"]
    for preset in epochs.distinct("preset"):
        for arm in arms_in(epochs.where(preset=preset)):
            part = epochs.where(preset=preset, arm=arm)
            at, place = np.unique(part["epoch"], return_inverse=True)
            values = [part[column][place == i] for i in range(len(at))]
            known = [cells[~np.isnan(cells)] for cells in values]
            mean = np.array([cells.mean() if len(cells) else math.nan for cells in known])
            low = [cells.min() if len(cells) else math.nan for cells in known]
            high = [cells.max() if len(cells) else math.nan for cells in known]
            smooth = trailing_mean(mean, AVERAGE)
            for i, epoch in enumerate(at.tolist()):
                rows.append(
                    (preset, arm, epoch, len(known[i]), mean[i], low[i], high[i], smooth[i])
                )
    names = (
        "preset",
        "arm",
        "epoch",
        "seeds",
        "mean",
        "lowest_seed",
        "highest_seed",
        f"mean_of_{AVERAGE}_epochs",
    )
    return table(names, rows)


def score_data(results: Results) -> Table:
    """Total issue score per epoch."""
    return curve_data(results, "total")


def quality_data(results: Results) -> Table:
    """Share of perfect services per epoch."""
    return curve_data(results, "perfect_rate")


def _curves(
    data: Table, wide: bool, scale: float, unit: str, *more: Line2D
) -> tuple[Figure, list[Axes]]:
    presets, arms = data.distinct("preset"), arms_in(data)
    shape = (1, len(presets)) if wide else (len(presets), 1)
    height = 2.9 if wide else 2.2 * len(presets) + 0.5
    figure, axes = style.panels(wide, *shape, height, sharey=True, sharex=True)
    looks = style.looks(arms, style.ARMS)
    for ax, preset in zip(axes, presets, strict=True):
        for rank, arm in enumerate(arms):
            part, look = data.where(preset=preset, arm=arm), looks[arm]
            at = part["epoch"]
            ax.fill_between(
                at,
                scale * part["lowest_seed"],
                scale * part["highest_seed"],
                color=look.colour,
                alpha=0.11,
                linewidth=0,
            )
            ax.plot(at, scale * part["mean"], color=look.colour, alpha=0.28, linewidth=0.5)
            gap = max(1, len(at) // 6)
            ax.plot(
                at,
                scale * part[f"mean_of_{AVERAGE}_epochs"],
                linestyle=look.line,
                markevery=(rank * gap // 4, gap),
                **look.marks(),
                markersize=3.8,
                zorder=3,
            )
        ax.set_title(style.preset_short(preset))
        ax.set_xlabel("epoch")
        ax.margins(x=0.01)
        ax.label_outer()
    axes[0].set_ylabel(unit)
    marks = [
        Line2D([], [], linestyle=look.line, label=look.label, **look.marks())
        for look in looks.values()
    ]
    style.legend(figure, [*marks, *more], wide)
    return figure, axes


def score_draw(data: Table, wide: bool) -> Figure:
    """Total issue score per epoch, one panel a preset, with the manual threshold."""
    dotted: dict[str, Any] = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (1, 1.5))}
    mark = Line2D([], [], label="manual threshold", **dotted)
    figure, axes = _curves(data, wide, 1.0, "total issue score", mark)
    for ax in axes:
        ax.axhline(MANUAL_THRESHOLD, **dotted)
        ax.set_ylim(bottom=0)
    return figure


def quality_draw(data: Table, wide: bool) -> Figure:
    """Share of perfect services per epoch, in the layout of the score."""
    figure, axes = _curves(data, wide, 100.0, "perfect services, %")
    axes[0].set_ylim(0, 100)
    return figure


def _curve_words(results: Results) -> str:
    return (
        f"Lines: mean over {seeds_text(results['epochs']['seed'].tolist())} of the last {AVERAGE} "
        "epochs (fewer at the start). Faint: each epoch, its mean and the range from the lowest to "
        f"the highest seed. An epoch is {results.manifest['people']} services."
    )


def score_caption(results: Results, data: Table) -> str:
    """Seeds, bands, and why chance keeps the score above zero."""
    return (
        f"{_curve_words(results)} Dotted: the manual threshold of {MANUAL_THRESHOLD}. The raw "
        "score of a single epoch holds chance gaps between groups: an even robot reaches 0 only "
        "where it makes no issues. "
        "Read it together with the next figure: a robot that fails everybody alike scores low too."
    )


def quality_caption(results: Results, data: Table) -> str:
    """What a perfect service is."""
    return (
        f"{_curve_words(results)} A perfect service has none of the four issues: a response, at "
        "1 to 1.5 m, within 200 steps, and never nearer than 0.5 m."
    )
