"""Room: figures of the study and of the biased robots (the paper's Fig. 5, 6 and 11).

Takes: tables. Gives: the data drawn, figures, captions. Pure apart from matplotlib objects.
Each figure is three functions: what is drawn (a table, also written as CSV), how it is drawn
(from that table alone, in two widths), and the words under it.
"""

import textwrap

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evenhand.methods.vocabulary import ISSUES
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, say, table
from evenhand.statistics.intervals import wilson

_MEASURES = {
    "mean_response_distance": "Mean response distance",
    "mean_response_time": "Mean response time",
    "ignore_rate": "Ignore rate",
}
_ALL = "judged windows"


def in_order(names: list[str], order: tuple[str, ...]) -> list[str]:
    """Known names in their usual order, then the others as they came."""
    return [name for name in order if name in names] + [n for n in names if n not in order]


# --- questionnaire answers (Fig. 5) -----------------------------------------------------------


def questionnaire_data(results: Results) -> Table:
    """Share of answers by scenario, then by all judged windows (the simulated data)."""
    rows: list[tuple[object, ...]] = []
    for row in results["questionnaire"].rows():
        rows.append(
            (
                "identity",
                row["scenario"],
                row["scenario_name"],
                row["identity"],
                row["share"],
                row["count"],
                *_limits(row["count"], row["respondents"]),
                row["paper_share"],
            )
        )
    asked = dict(
        zip(
            results["questionnaire"]["scenario"],
            results["questionnaire"]["respondents"],
            strict=True,
        )
    )
    for row in results["questionnaire_issue"].rows():
        rows.append(
            (
                "issue",
                row["scenario"],
                row["scenario_name"],
                row["issue"],
                row["share"],
                row["count"],
                *_limits(row["count"], asked[row["scenario"]]),
                None,
            )
        )
    judged = results["judgements"]
    for question in ("identity", "issue"):
        answers = [answer or "none" for answer in judged[question].tolist()]
        for answer in dict.fromkeys(answers):
            count = answers.count(answer)
            share = count / len(answers)
            limits = _limits(count, len(answers))
            rows.append((question, _ALL, _ALL, answer, share, count, *limits, None))
    names = (
        *("question", "scenario", "scenario_name", "answer"),
        *("share", "count", "ci_low", "ci_high", "paper_share"),
    )
    return table(names, rows)


def _limits(count: int, n: int) -> tuple[float, float]:
    low, high = wilson(np.array(count), np.array(n))
    return float(low), float(high)


def questionnaire_draw(data: Table, wide: bool) -> Figure:
    """One column (or row, on a phone) a scenario: identities above, issues below."""
    scenarios = data.distinct("scenario")
    names = {row["scenario"]: row["scenario_name"] for row in data.rows()}
    orders = {
        "identity": ("race", "gender", "age", "disability", "skin", "none"),
        "issue": (*ISSUES, "none"),
    }
    answers = {
        question: in_order(data.where(question=question).distinct("answer"), order)
        for question, order in orders.items()
    }
    count = len(scenarios)
    shape = (2, count) if wide else (count, 2)
    top = max(0.05, float(np.nanmax(np.r_[data["ci_high"], data["paper_share"]])))
    figure, axes = style.panels(
        wide,
        *shape,
        3.5 if wide else 1.35 * count + 0.5,
        sharex=True,
        sharey="row" if wide else "col",
    )
    for place, scenario in enumerate(scenarios):
        for half, question in enumerate(("identity", "issue")):
            ax = axes[half * count + place] if wide else axes[place * 2 + half]
            labels = answers[question]
            part = data.where(question=question, scenario=scenario)
            found = {row["answer"]: row for row in part.rows()}
            at = np.arange(len(labels))
            shares = [100 * found[a]["share"] if a in found else 0.0 for a in labels]
            colour = style.GREY if scenario == _ALL else style.BLUE if half == 0 else style.ORANGE
            ax.barh(at, shares, height=0.68, color=colour)
            for y, label in enumerate(labels):
                if label in found:
                    row = found[label]
                    ends = [100 * row["ci_low"], 100 * row["ci_high"]]
                    ax.plot(ends, [y, y], color=style.INK, linewidth=0.9)
                    ax.plot(100 * row["paper_share"], y, **style.PAPER)
            ax.set_yticks(at, labels)
            if ax.get_ylim()[0] < ax.get_ylim()[1]:
                ax.invert_yaxis()
            ax.set_xlim(0, min(100.0, 115 * top))
            style.bare(ax, "x")
            if half == 0:
                ax.set_title(_wrap(names[scenario], 16 if wide else 40))
            if (half == 1) if wide else place == count - 1:
                ax.set_xlabel("% of answers")
    marks = [
        Patch(color=style.BLUE, label="identity named"),
        Patch(color=style.ORANGE, label="worst issue"),
        Patch(color=style.GREY, label="simulated data"),
        Line2D([], [], color=style.INK, linewidth=0.9, label="95 % interval"),
        Line2D([], [], label="printed in the paper", **style.PAPER),
    ]
    style.legend(figure, marks, wide)
    return figure


def _wrap(text: str, width: int) -> str:
    """At most three lines of ``width`` letters, cut at spaces where there are some."""
    return textwrap.fill(text, width, max_lines=3, placeholder="…")


def questionnaire_caption(results: Results, data: Table) -> str:
    """Who answered, and what the grey bars are."""
    asked = sorted(set(results["questionnaire"]["respondents"].tolist()))
    who = f"{asked[0]}" if len(asked) == 1 else f"{asked[0]} to {asked[-1]}"
    return (
        f"Answers of {who} simulated respondents a scenario: which identity the robot treats "
        "unevenly, and which issue is worst. Grey: the answers in the simulated data set, "
        f"{len(results['judgements']):,} judged windows. Lines: 95 % intervals (Wilson), of "
        "windows as if each had a respondent of its own. Diamonds: the shares that the paper "
        "prints."
    )


# --- signatures (Fig. 6) ----------------------------------------------------------------------


def signatures_data(results: Results) -> Table:
    """The table of signatures as it is."""
    return results["signatures"]


def signatures_draw(data: Table, wide: bool) -> Figure:
    """One panel a discrimination, one line an issue."""
    kinds = data.distinct("discrimination")
    issues = in_order(data.distinct("issue"), ISSUES)
    columns = len(kinds) if wide else 2
    rows = -(-len(kinds) // columns)
    figure, axes = style.panels(
        wide, rows, columns, 2.3 if wide else 1.6 * rows + 0.5, sharex=True, sharey=True
    )
    for ax, kind in zip(axes, kinds, strict=False):
        for y, issue in enumerate(issues):
            for row in data.where(discrimination=kind, issue=issue).rows():
                if not np.isnan(row["ceiling"]):
                    ax.plot(
                        [row["ceiling"]] * 2,
                        [y - 0.36, y + 0.36],
                        color=style.GREY,
                        linestyle=(0, (2, 1)),
                        linewidth=1.3,
                    )
                ax.plot([row["ci_low"], row["ci_high"]], [y + 0.13] * 2, color=style.BLUE)
                ax.plot(row["ours"], y + 0.13, "o", color=style.BLUE, clip_on=False, zorder=4)
                ax.plot(row["paper"], y - 0.13, **style.PAPER, clip_on=False, zorder=3)
        ax.set_yticks(range(len(issues)), issues)
        ax.set_title(kind)
        ax.set_xlim(0, 1)
        ax.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        style.bare(ax, "x")
        ax.set_xlabel("issue score")
    axes[0].set_ylim(len(issues) - 0.5, -0.5)
    for ax in axes[len(kinds) :]:
        ax.set_visible(False)
    for place, ax in enumerate(axes[: len(kinds)]):
        ax.label_outer()
        if place + columns >= len(kinds):  # nothing below: this panel carries the scale
            ax.tick_params(labelbottom=True)
            ax.set_xlabel("issue score")
    marks = [
        Line2D([], [], marker="o", color=style.BLUE, label="this run, 95 % interval"),
        Line2D([], [], label="printed in the paper", **style.PAPER),
        Line2D([], [], color=style.GREY, linestyle=(0, (2, 1)), label="ceiling"),
    ]
    style.legend(figure, marks, wide)
    return figure


def signatures_caption(results: Results, data: Table) -> str:
    """Windows, intervals, and where the paper's numbers lie beyond reach."""
    windows = sorted(set(data["windows"].tolist()))
    n = f"{windows[0]}" if len(windows) == 1 else f"{windows[0]} to {windows[-1]}"
    beyond = [
        f"{row['discrimination']}, {row['issue']}"
        for row in data.rows()
        if row["paper"] > row["ceiling"]  # false where either is not defined
    ]
    reach = f" The printed value lies above the ceiling for {'; '.join(beyond)}." if beyond else ""
    return (
        f"Mean issue scores of {n} windows of {results.manifest['people']} services that the "
        "simulated respondents judged as this discrimination, with 95 % intervals over windows. "
        "Diamonds: the paper. Dashed tick: ceiling, the most that a robot which treats one "
        f"identity unevenly can score.{reach} The paper prints no vector for sexism."
    )


# --- behaviour of the biased robots (Fig. 11) -------------------------------------------------


def measure_title(measure: str) -> str:
    """The name of a measure for readers."""
    return _MEASURES.get(measure, measure)


def behaviour_data(results: Results) -> Table:
    """The table of behaviour, with the largest value of each measure marked."""
    data = results["behaviour"]
    largest = [
        int(row["value"] == np.nanmax(np.r_[data.where(measure=row["measure"])["value"], -np.inf]))
        for row in data.rows()
    ]
    return Table({**data.columns, "largest": np.array(largest, dtype=np.int64)})


def behaviour_draw(data: Table, wide: bool) -> Figure:
    """One panel a measure, one line a robot; the largest in bold."""
    robots, measures = data.distinct("robot"), in_order(data.distinct("measure"), tuple(_MEASURES))
    shape = (1, len(measures)) if wide else (len(measures), 1)
    figure, axes = style.panels(
        wide, *shape, 2.4 if wide else 1.75 * len(measures) + 0.4, sharey=True
    )
    for ax, measure in zip(axes, measures, strict=True):
        part = data.where(measure=measure)
        for row in part.rows():
            y = robots.index(row["robot"])
            look = style.looks([row["robot"]], style.KINDS)[row["robot"]]
            if np.isnan(row["value"]):
                ax.text(
                    0.02,
                    y,
                    "not defined",
                    transform=ax.get_yaxis_transform(),
                    va="center",
                    color=style.GREY,
                )
            else:
                ax.plot([row["ci_low"], row["ci_high"]], [y, y], color=look.colour)
                ax.plot(row["value"], y, **look.marks(), zorder=4)
                top = np.nanmax([row["value"], row["ci_high"]])
                ax.annotate(
                    say(row["value"], 2),
                    (top, y),
                    (6, 0),
                    textcoords="offset points",
                    va="center",
                    fontweight="bold" if row["largest"] else "normal",
                    fontsize=7.5,
                )
            ax.plot(row["paper"], y - 0.32, **style.PAPER, zorder=3)
        unit = next((row["unit"] for row in part.rows() if row["unit"]), "")
        ax.set_title(measure_title(measure))
        ax.set_xlabel(unit)
        high = np.nanmax(np.r_[part["value"], part["ci_high"], part["paper"], 0.0])
        ax.set_xlim(0, 1.28 * high if high > 0 else 1)
        ax.set_yticks(range(len(robots)), robots)
        style.bare(ax, "x")
    axes[0].set_ylim(len(robots) - 0.5, -0.65)
    marks = [
        Line2D([], [], marker="o", color=style.GREY, label="this run, 95 % interval"),
        Line2D([], [], label="printed in the paper", **style.PAPER),
    ]
    style.legend(figure, marks, wide)
    return figure


def behaviour_caption(results: Results, data: Table) -> str:
    """How many services, and what the paper prints."""
    services = sorted(set(data["services"].tolist()))
    n = f"{services[0]:,}" if len(services) == 1 else f"{services[0]:,} to {services[-1]:,}"
    return (
        f"What the scripted robots do, over {n} services each, with 95 % intervals; the largest "
        "value of each measure is bold. Diamonds: the three numbers that the paper prints, each "
        "the largest of its column. The paper gives no unit for its ignore rate."
    )
