"""Room: figures of epochs that were detected as biased (the paper's Fig. 9 and 10).

Takes: tables. Gives: the data drawn, figures, captions. Pure apart from matplotlib objects.
"""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evenhand.methods.vocabulary import MANUAL_THRESHOLD
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import arms_in
from evenhand.report.table import Table, seeds_text, table
from evenhand.statistics.means import mean_interval

ZOOM = 40  # epochs in the close view of Fig. 10
PAPER_BIASED = {"ppo": 54, "ppo+guidance": 39}  # biased epochs, caption of Fig. 9
PAPER_EPOCHS = 300  # 9,000 recorded services / 30 people

# --- biased epochs (Fig. 9) -------------------------------------------------------------------


def biased_data(results: Results) -> Table:
    """Number of biased epochs by detector and by threshold: seeds, mean, interval, paper."""
    rows: list[tuple[object, ...]] = []
    epochs = results["epochs"]
    for preset in epochs.distinct("preset"):
        for arm in arms_in(epochs.where(preset=preset)):
            part = epochs.where(preset=preset, arm=arm)
            for judge in ("detector", "threshold"):
                counts: dict[int, float] = {}
                judged: dict[int, int] = {}
                for seed in part.distinct("seed"):
                    flags = part.where(seed=seed)[f"biased_{judge}"]
                    judged[seed] = int((~np.isnan(flags)).sum())
                    counts[seed] = float(np.nansum(flags)) if judged[seed] else math.nan
                length = max(judged.values())
                mean = mean_interval(counts.values(), within=(0.0, length))
                printed = PAPER_BIASED.get(arm) if judge == "detector" else None
                paper = printed * length / PAPER_EPOCHS if printed and length else None
                rows.append(
                    (preset, arm, judge, "mean", mean.mean, mean.low, mean.high, length, paper)
                )
                for seed, count in counts.items():
                    rows.append(
                        (preset, arm, judge, str(seed), count, None, None, judged[seed], None)
                    )
    names = (
        "preset",
        "arm",
        "judge",
        "seed",
        "biased_epochs",
        "ci_low",
        "ci_high",
        "judged_epochs",
        "paper",
    )
    return table(names, rows)


def biased_draw(data: Table, wide: bool) -> Figure:
    """One panel a preset, one line an arm that ran there; detector above, threshold below."""
    presets = data.distinct("preset")
    arms = {preset: arms_in(data.where(preset=preset)) for preset in presets}
    lines = [len(names) for names in arms.values()]
    shape = (1, len(presets)) if wide else (len(presets), 1)
    height = 0.42 * (max(lines) if wide else sum(lines) + len(presets)) + 0.9
    ratios = None if wide else lines
    figure, axes = style.panels(wide, *shape, height, sharex=True, height_ratios=ratios)
    judges = {
        "detector": style.Look("by the detector", style.BLUE, "o"),
        "threshold": style.Look("by the threshold 0.5", style.ORANGE, "s", filled=False),
    }
    for ax, preset in zip(axes, presets, strict=True):
        for row in data.where(preset=preset).rows():
            look = judges[row["judge"]]
            y = arms[preset].index(row["arm"]) + (-0.15 if row["judge"] == "detector" else 0.2)
            if row["seed"] != "mean":
                ax.plot(
                    row["biased_epochs"], y + 0.13, ".", color=look.colour, markersize=3, alpha=0.6
                )
                continue
            ax.plot([row["ci_low"], row["ci_high"]], [y, y], color=look.colour)
            ax.plot(row["biased_epochs"], y, **look.marks(), zorder=4, clip_on=False)
            ax.plot(row["paper"], y - 0.2, **style.PAPER, zorder=3, clip_on=False)
        ax.set_title(style.preset_short(preset) if wide else f"Preset {preset}")
        ax.set_xlabel("biased epochs")
        labels = [style.arm_label(arm).replace(" + ", "\n+ ") for arm in arms[preset]]
        ax.set_yticks(range(len(labels)), labels)
        ax.set_ylim(len(labels) - 0.5, -0.6)
        style.bare(ax, "x")
        if not wide:
            ax.label_outer()
    high = np.nanmax(np.r_[data["biased_epochs"], data["ci_high"], data["paper"], 1.0])
    axes[0].set_xlim(0, max(1.0, min(1.05 * high, data["judged_epochs"].max())))
    marks = [Line2D([], [], label=look.label, **look.marks()) for look in judges.values()]
    marks.append(Line2D([], [], label="printed in the paper", **style.PAPER))
    style.legend(figure, marks, wide)
    return figure


def biased_caption(results: Results, data: Table) -> str:
    """Epochs, seeds, and the paper's two counts."""
    length = int(data["judged_epochs"].max())
    if not length:
        return "No epoch of this run was judged."
    scaled = "" if length == PAPER_EPOCHS else f", scaled from {PAPER_EPOCHS} to {length} epochs"
    return (
        f"Epochs judged as biased, of {length}, during learning; "
        f"{seeds_text(results['epochs']['seed'].tolist())}, 95 % t intervals over seeds, cut at 0 "
        f"and {length}, small dots are single seeds. Diamonds: the paper’s 54 (PPO) and 39 (PPO + "
        f"guidance) by its detector{scaled}."
    )


# --- zoom on detection and correction (Fig. 10) -----------------------------------------------


def zoom_data(results: Results) -> Table:
    """For each preset the seed and the epochs in which PPO was detected as biased most often."""
    rows: list[tuple[object, ...]] = []
    for preset in results["epochs"].distinct("preset"):
        part = results["epochs"].where(preset=preset)
        keep = np.isin(part["arm"].astype(str), ("ppo", "ppo+guidance"))
        both = Table({name: cells[keep] for name, cells in part.columns.items()})
        best: tuple[float, int, int] | None = None
        for seed in sorted(both.distinct("seed")):
            one = both.where(seed=seed)
            flags = np.nan_to_num(one["biased_detector"])
            first, last = int(one["epoch"].min()), int(one["epoch"].max())
            for start in range(first, max(first, last - ZOOM + 1) + 1):
                inside = (one["epoch"] >= start) & (one["epoch"] < start + ZOOM)
                count = float(flags[inside].sum())
                if best is None or count > best[0]:
                    best = (count, seed, start)
        if best is None:
            continue
        _, seed, start = best
        for row in both.where(seed=seed).rows():
            if start <= row["epoch"] < start + ZOOM:
                rows.append(
                    (
                        preset,
                        row["arm"],
                        seed,
                        row["epoch"],
                        row["total"],
                        row["biased_detector"],
                        row["perfect_rate"],
                    )
                )
    names = ("preset", "arm", "seed", "epoch", "total", "detected", "perfect_rate")
    return table(names, rows)


def zoom_draw(data: Table, wide: bool) -> Figure:
    """Guided above unguided with the same axes; detected epochs are shaded and hatched."""
    cells = [(preset, arm) for arm in ("ppo+guidance", "ppo") for preset in data.distinct("preset")]
    if not wide:
        cells.sort(key=lambda cell: data.distinct("preset").index(cell[0]))
    columns = len(data.distinct("preset")) if wide else 1
    rows = len(cells) // columns
    figure, axes = style.panels(
        wide, rows, columns, 1.45 * rows + 0.45, sharey=True, sharex="col" if wide else False
    )
    looks = style.looks(["ppo+guidance", "ppo"], style.ARMS)
    for place, (ax, (preset, arm)) in enumerate(zip(axes, cells, strict=True)):
        part, look = data.where(preset=preset, arm=arm), looks[arm]
        for row in part.where(detected=1.0).rows():
            ax.axvspan(
                row["epoch"] - 0.5,
                row["epoch"] + 0.5,
                facecolor="#f6d5c3",
                edgecolor="#e2a27f",
                hatch="////",
                linewidth=0,
                zorder=0,
            )
        ax.plot(part["epoch"], part["total"], **look.marks(), markersize=2.8, linewidth=1.1)
        ax.axhline(MANUAL_THRESHOLD, color=style.INK, linewidth=0.9, linestyle=(0, (1, 1.5)))
        seed = f", seed {part['seed'][0]}" if len(part) else ""
        ax.set_title(f"{look.label}: preset {preset}{seed}")
        if place >= len(cells) - columns:
            ax.set_xlabel("epoch")
        if place % columns == 0:
            ax.set_ylabel("total score")
    axes[0].set_ylim(0, 1.1 * float(np.nanmax(np.r_[data["total"], MANUAL_THRESHOLD])))
    marks = [
        Patch(
            facecolor="#f6d5c3",
            edgecolor="#e2a27f",
            hatch="////",
            linewidth=0,
            label="detected as biased",
        ),
        Line2D(
            [],
            [],
            color=style.INK,
            linewidth=0.9,
            linestyle=(0, (1, 1.5)),
            label="manual threshold",
        ),
    ]
    style.legend(figure, marks, wide)
    return figure


def zoom_caption(results: Results, data: Table) -> str:
    """How the epochs were chosen, so that nobody takes the example for a measurement."""
    shown = []
    for preset in data.distinct("preset"):
        for arm in arms_in(data):
            part = data.where(preset=preset, arm=arm)
            count = int(np.nansum(part["detected"]))
            shown.append(f"{preset}, {style.arm_label(arm)}: {count} of {len(part)}")
    return (
        f"The {ZOOM} epochs (or fewer) of the one seed a preset in which the two PPO robots were "
        f"detected as biased most often: chosen as an example, not as a measurement. Epochs "
        f"detected: {'; '.join(shown)}."
    )
