"""Room: figures of the detector (the paper's Fig. 12, calibration, confusion, corrected scores).

Takes: tables. Gives: the data drawn, figures, captions. Pure apart from matplotlib objects.
"""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.core.wording import NOT_DEFINED, percent
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, say_estimate
from evenhand.statistics.means import Estimate

# --- calibration ------------------------------------------------------------------------------


def calibration_data(results: Results) -> Table:
    """The table of calibration as it is."""
    return results["calibration"]


def calibration_draw(data: Table, wide: bool) -> Figure:
    """Share judged as biased against the predicted probability; the diagonal is perfect."""
    figure, (ax,) = style.panels(False, 1, 1, 3.0)
    ax.plot([0, 1], [0, 1], color=style.GREY, linestyle=(0, (2, 1.5)), linewidth=1)
    ax.vlines(data["predicted"], data["ci_low"], data["ci_high"], color=style.BLUE, linewidth=1.4)
    ax.plot(data["predicted"], data["observed"], "-", color=style.BLUE, linewidth=0.8, alpha=0.6)
    area = 14 + 90 * data["n"] / max(1, int(data["n"].max()))
    ax.scatter(data["predicted"], data["observed"], s=area, color=style.BLUE, zorder=4)
    ax.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03), aspect="equal")
    ax.set_xlabel("probability given by the detector")
    ax.set_ylabel("share judged as biased")
    ticks = [0, 0.25, 0.5, 0.75, 1]
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.set_yticks(ticks, [str(tick) for tick in ticks])
    return figure


def detector_metric(results: Results, metric: str) -> tuple[Estimate, int] | None:
    """A held-out metric of the detector with its interval and number of windows."""
    for row in results["detector"].where(metric=metric).rows():
        return Estimate(row["value"], row["ci_low"], row["ci_high"], 2), row["n"]
    return None


def metric_text(results: Results, metric: str, share: bool = True) -> str:
    """A metric for a reader; a metric that the run lacks is not defined."""
    found = detector_metric(results, metric)
    nothing = Estimate(math.nan, math.nan, math.nan, 0)
    estimate = found[0] if found and not math.isnan(found[0].mean) else nothing
    if estimate.n and not estimate.has_interval:
        return percent(estimate.mean) if share else f"{estimate.mean:.3f}"
    return say_estimate(estimate, share)


def calibration_caption(results: Results, data: Table) -> str:
    """Held-out windows, and the three numbers that describe the detector."""
    return (
        f"{int(data['n'].sum()):,} held-out windows in {len(data)} bins; vertical lines are 95 % "
        "intervals, the area of a dot grows with its windows, the dashed line is perfect "
        f"calibration. Accuracy {metric_text(results, 'accuracy')}, agreement with the manual "
        f"threshold {metric_text(results, 'threshold_agreement')}, Brier score "
        f"{metric_text(results, 'brier', share=False)} (0 is perfect). The judgements come from "
        "simulated respondents."
    )


# --- confusion --------------------------------------------------------------------------------


def confusion_data(results: Results) -> Table:
    """The table of confusion, with the share of each row."""
    data = results["confusion"]
    share = [
        row["count"] / total
        if (total := int(data.where(judged=row["judged"])["count"].sum()))
        else math.nan
        for row in data.rows()
    ]
    return Table({**data.columns, "share_of_judged": np.array(share, dtype=np.float64)})


def confusion_draw(data: Table, wide: bool) -> Figure:
    """Judged by respondents (rows) against said by the detector (columns)."""
    judged = data.distinct("judged")
    said = [*(name for name in judged if name in data["predicted"])]
    said += [name for name in data.distinct("predicted") if name not in said]
    share = np.full((len(judged), len(said)), np.nan)
    figure, (ax,) = style.panels(False, 1, 1, 3.0)
    for row in data.rows():
        y, x = judged.index(row["judged"]), said.index(row["predicted"])
        share[y, x] = row["share_of_judged"]
        dark = row["share_of_judged"] > 0.55
        percent = "" if math.isnan(share[y, x]) else f"\n{100 * share[y, x]:.0f} %"
        ax.text(
            x,
            y,
            f"{row['count']}{percent}",
            ha="center",
            va="center",
            fontsize=7,
            color="white" if dark else style.INK,
        )
    edges_x, edges_y = np.arange(len(said) + 1) - 0.5, np.arange(len(judged) + 1) - 0.5
    ax.pcolormesh(
        edges_x, edges_y, share, cmap="Blues", vmin=0, vmax=1, edgecolors="white", linewidth=1.5
    )
    ax.set_xticks(range(len(said)), said, rotation=30, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(judged)), judged)
    ax.set_xlabel("said by the detector")
    ax.set_ylabel("judged by respondents")
    ax.set_ylim(len(judged) - 0.5, -0.5)
    ax.grid(False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    return figure


def confusion_caption(results: Results, data: Table) -> str:
    """What a cell shows."""
    right = int(data["count"][data["judged"] == data["predicted"]].sum())
    total = int(data["count"].sum())
    agree = f"{right:,} of {total:,} windows lie on the diagonal"
    return (
        "Which discrimination the detector says a window looks like, against what the simulated "
        f"respondents said; windows and share of their row. {agree}."
    )


# --- raw and corrected scores -----------------------------------------------------------------

_JUDGES = {
    "raw": style.Look("detector,\nraw scores", style.BLUE, "o"),
    "corrected": style.Look("detector,\ncorrected scores", style.VERMILLION, "^"),
    "threshold": style.Look("manual\nthreshold", style.ORANGE, "s", filled=False),
    "respondents": style.Look("respondents", style.GREY, "D", filled=False),
}
_MEASURES = {
    "accuracy": "Accuracy",
    "agreement": "Agreement with the threshold",
    "false_alarms": "Even robot called biased",
}


def judges_data(results: Results) -> Table:
    """The table of judges as it is."""
    return results["judges"]


def judges_draw(data: Table, wide: bool) -> Figure:
    """One panel a measure, one line a judge; calibration of both detectors beside them."""
    figure, axes = style.panels(wide, *((2, 2) if wide else (4, 1)), 4.6 if wide else 7.6)
    names = [name for name in _JUDGES if name in data.distinct("judge")]
    for ax, (measure, title) in zip(axes, _MEASURES.items(), strict=False):
        part = data.where(measure=measure)
        shown = [name for name in names if name in part.distinct("judge")]
        for row in part.rows():
            if row["judge"] not in shown:
                continue
            y, look = shown.index(row["judge"]), _JUDGES[row["judge"]]
            ax.plot([100 * row["ci_low"], 100 * row["ci_high"]], [y, y], color=look.colour)
            ax.plot(100 * row["value"], y, **look.marks(), zorder=4)
        ax.set_title(title)
        ax.set_yticks(range(len(shown)), [_JUDGES[name].label for name in shown])
        ax.set_ylim(max(len(shown), 1) - 0.5, -0.5)
        ax.set_xlabel("windows, %")
        style.bare(ax, "x")
    axes[2].set_xlim(left=0)
    ax = axes[3]
    ax.plot([0, 100], [0, 100], color=style.GREY, linestyle=(0, (2, 1.5)), linewidth=1)
    for name in names:
        part = data.where(measure="calibration", judge=name)
        look = _JUDGES[name]
        if len(part):
            given, seen = 100 * part["predicted"], 100 * part["value"]
            ax.vlines(
                given, 100 * part["ci_low"], 100 * part["ci_high"], color=look.colour, alpha=0.5
            )
            ax.plot(given, seen, linestyle="none", **look.marks())
    ax.set_title("Calibration")
    ax.set(xlim=(-3, 103), ylim=(-3, 103))
    ax.set_xlabel("probability given, %")
    ax.set_ylabel("judged as biased, %")
    return figure


def judge_text(results: Results, judge: str, measure: str) -> str:
    """A measure of a judge with its interval, for a reader."""
    for row in results["judges"].where(judge=judge, measure=measure).rows():
        if math.isnan(row["value"]):
            break
        if math.isnan(row["ci_low"]):
            return f"{row['value']:.3f}"
        return say_estimate(Estimate(row["value"], row["ci_low"], row["ci_high"], row["n"]), True)
    return NOT_DEFINED


def judges_caption(results: Results, data: Table) -> str:
    """What was taken out, how many windows, and each number for both detectors."""
    n = {measure: data.where(measure=measure)["n"] for measure in ("accuracy", "false_alarms")}
    held, even = (int(cells.max()) if len(cells) else 0 for cells in n.values())

    alarms = {
        name: judge_text(results, name, "false_alarms") for name in ("threshold", "respondents")
    }

    def both(measure: str) -> str:
        raw, corrected = (judge_text(results, name, measure) for name in ("raw", "corrected"))
        return f"{raw} on raw, {corrected} on corrected scores"

    return (
        f"Two detectors on the same {held:,} held-out windows and folds; accuracy is the share "
        "judged as the simulated respondents did. Corrected: of every gap, "
        "the one that chance alone makes in that window is taken out. Accuracy "
        f"{both('accuracy')}; agreement with the manual threshold on the raw total "
        f"{both('agreement')}; Brier score {both('brier')}. Of the even robot’s {even:,} windows "
        f"called biased: {both('false_alarms')}, {alarms['threshold']} by the manual threshold, "
        f"{alarms['respondents']} by the respondents. They judge raw "
        "scores, so accuracy and agreement favour the raw detector by construction. Lines are 95 % "
        "intervals. Learning uses the raw detector, as the paper does."
    )


# --- t-SNE (Fig. 12) --------------------------------------------------------------------------


def tsne_data(results: Results) -> Table:
    """The table of the embedding as it is."""
    return results["tsne"]


def tsne_draw(data: Table, wide: bool) -> Figure:
    """Three planes of the embedding; filled marks were judged as biased."""
    planes = (("x", "y"), ("x", "z"), ("y", "z"))
    shape = (1, 3) if wide else (3, 1)
    figure, axes = style.panels(wide, *shape, 2.8 if wide else 7.4)
    looks = style.looks(data.distinct("kind"), style.KINDS)
    for ax, (across, up) in zip(axes, planes, strict=True):
        for kind, look in looks.items():
            for biased in (0.0, 1.0):
                part = data.where(kind=kind, biased=biased)
                marks = {**look.marks(), "markersize": 3, "markeredgewidth": 0.6, "alpha": 0.75}
                if not biased:
                    marks["markerfacecolor"] = "none"
                ax.plot(part[across], part[up], linestyle="none", **marks)
        ax.set_xlabel(f"dimension {across}")
        ax.set_ylabel(f"dimension {up}", labelpad=1)
        ax.locator_params(nbins=5)
    marks = [
        Line2D([], [], linestyle="none", label=look.label, **look.marks())
        for look in looks.values()
    ]
    style.legend(figure, marks, wide, columns=len(marks) if wide else 3)
    return figure


def tsne_caption(results: Results, data: Table) -> str:
    """What a mark is, and what must not be read into distances."""
    return (
        f"t-SNE embedding in three dimensions of the issue scores of {len(data):,} judged "
        "windows, on its three planes. Filled: judged as biased by a simulated respondent; "
        "hollow: not. The axes have no unit, and distances between far clusters mean nothing."
    )
