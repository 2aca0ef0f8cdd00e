"""Figures of an analysis: what was named, ratings, scenarios against controls, order, progress.

Simulated participants are hatched and grey, and called so in every figure; people are in colour.
"""

import math
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evenhand.report import figure as figures
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table
from evenhand.study.analysis.analyse import Analysis, Part

MOST = 24
"""Sets in a figure; the tables hold all."""
INTERVALS = "Lines: 95 % intervals."
_ROW = 0.23
_BLOCK = 122  # from one set to the next, in percentage points
_LETTERS = 22


def draw_all(part: Part, analysis: Analysis) -> list[figures.Drawn]:
    """Every figure of a part that has something to show, in the order of the page."""
    of = part.tables
    who = "simulated participants" if part.kind == "simulated" else "participants"
    n = f"{part.used:,} {who}"
    said = f"{INTERVALS} n = {n}."
    middle = _middle(analysis)
    plates: list[tuple[str, str, str, str, Table, Callable[..., Figure], str, bool]] = []
    for role, title, asks in (
        ("identity", "Towards whom?", "which identity was named"),
        ("issue", "What was worst?", "which issue was named"),
    ):
        rows = of["named"].where(question=role) if len(of["named"]) else of["named"]
        plates.append((
            role, title, "Fig. 5",
            f"Bar charts, a panel a set: {asks}, in per cent of answers.", rows, _named,
            f"Share of those who answered, by set. {said}", False,
        ))  # fmt: skip
    plates += [
        ("ratings", "How fair was it?", "", "Dot chart, a row a set: mean rating, and share judged "
         "biased.", of["ratings"], partial(_ratings, middle=middle),
         "Mean rating, 1 is the unfair end; the dotted line is the middle of the scale. Beside it "
         f"the share of ratings on its unfair side. {said}", False),
        ("controls", "Scenarios against even controls", "", "Dot chart, a row a scenario: mean "
         "difference of ratings within participants.", of["controls"], _controls,
         "Rating of a scenario less the mean rating of the controls, within each participant. "
         f"Left of 0: less fair than the controls. {said}", True),
        ("places", "Does the order matter?", "", "Dot chart: mean rating by place in the order.",
         of["places"], _places, "Rating less the mean rating of the set, by how many sets had been "
         f"seen before. {said}", True),
        ("progress", "How far did they come?", "", "Step chart: share of participants by pages "
         "answered.", of["progress"], _progress,
         f"Share of those who answered at least one page. n = {n}, the flagged included.", True),
    ]  # fmt: skip
    with warnings.catch_warnings():
        # letters that the figure's font lacks are left to the reader's browser
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        return [_drawn(part, who, *plate) for plate in plates if len(plate[4])]


def _drawn(
    part: Part,
    who: str,
    name: str,
    title: str,
    paper: str,
    alt: str,
    data: Table,
    draw: Callable[..., Figure],
    caption: str,
    half: bool,
) -> figures.Drawn:
    plate = figures.Plate(
        name=f"{part.kind}_{name}",
        title=f"{title}{_suffix(part)}",
        paper=paper,
        section="study",
        alt=f"{alt} {who.capitalize()}.",
        data=lambda results: results[name],
        draw=partial(draw, kind=part.kind),
        caption=lambda _, __: caption,
        half=half,
    )
    return figures.draw(plate, Results({name: data}, {}, []))


def _suffix(part: Part) -> str:
    return " (simulated)" if part.kind == "simulated" else ""


def _middle(analysis: Analysis) -> float:
    found = [q for q in analysis.study.asked("set") if q.role == "fair"]
    return (found[0].points + 1) / 2 if found and analysis.known else math.nan


def short(name: str, letters: int = _LETTERS) -> str:
    """A name that fits beside a panel, without what cannot be printed."""
    name = "".join(c if c.isprintable() else " " for c in name)
    return name if len(name) <= letters else f"{name[: letters - 1]}…"


def _look(kind: str, colour: str) -> dict[str, Any]:
    if kind == "people":
        return {"color": colour}
    return {"facecolor": style.PALE, "edgecolor": style.GREY, "hatch": "////", "linewidth": 0.5}


def _told(kind: str, colour: str) -> Patch:
    label = "participants" if kind == "people" else "simulated participants"
    return Patch(label=label, **_look(kind, colour))


def _named(data: Table, wide: bool, kind: str) -> Figure:
    """Bars of every answer with its interval, a block a set; blocks of a line share their axes."""
    sets = data.distinct("set")[:MOST]
    answers = data.distinct("answer")
    colour = style.BLUE if data["question"][0] == "identity" else style.ORANGE
    columns = min(len(sets), 4 if wide else 2)
    lines = -(-len(sets) // columns)
    height = lines * (0.5 + 0.2 * len(answers)) + 0.75
    figure, axes = style.panels(wide, lines, 1, height, sharey=True)
    for line, ax in enumerate(axes):
        here = sets[line * columns : (line + 1) * columns]
        for block, name in enumerate(here):
            left = _BLOCK * block
            part = data.where(set=name)
            y = [answers.index(answer) for answer in part["answer"]]
            ax.barh(y, 100 * part["share"], left=left, height=0.68, **_look(kind, colour))
            low, high = left + 100 * part["low"], left + 100 * part["high"]
            ax.hlines(y, low, high, color=style.INK, linewidth=0.9)
            ax.vlines(left, -0.5, len(answers) - 0.4, color=style.GREY, linewidth=0.7)
            said = f"{short(name, 16)}, n = {int(part['n'][0])}"
            ax.text(left, -0.62, said, fontsize=7.5, fontweight="bold")
        at = [(_BLOCK * block + tick, tick) for block in range(len(here)) for tick in (0, 50, 100)]
        ax.set_xticks([x for x, _ in at], [f"{tick}" for _, tick in at])
        ax.set_xlim(0, _BLOCK * columns - 8)
        ax.spines[["left", "bottom"]].set_visible(False)
        ax.tick_params(length=0)
        style.bare(ax, "x")
    axes[0].set_yticks(range(len(answers)), [short(a, 14) for a in answers])
    axes[0].set_ylim(len(answers) - 0.4, -1.2)
    figure.supxlabel("% of answers", fontsize=8)
    interval = Line2D([], [], color=style.INK, linewidth=0.9, label="95 % interval")
    style.legend(figure, [_told(kind, colour), interval], wide)
    return figure


def _dots(ax: Axes, rows: list[dict[str, Any]], value: str, low: str, high: str, looks: list[Any],
          scale: float = 1.0) -> None:  # fmt: skip
    for y, (row, look) in enumerate(zip(rows, looks, strict=True)):
        if math.isnan(row[value]):
            ax.text(0.02, y, "not known", va="center", fontsize=6.5, color=style.GREY,
                    transform=ax.get_yaxis_transform())  # fmt: skip
            continue
        ax.plot([scale * row[low], scale * row[high]], [y, y], color=look.colour, linewidth=1.3)
        ax.plot(scale * row[value], y, linestyle="none", **look.marks())
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    style.bare(ax, "x")


def _looks(kind: str) -> dict[str, style.Look]:
    colours = (style.VERMILLION, style.BLUE) if kind == "people" else (style.GREY, style.GREY)
    aside = "" if kind == "people" else ", simulated"
    return {
        "scenario": style.Look(f"scenario{aside}", colours[0], "s"),
        "control": style.Look(f"even control{aside}", colours[1], "o", filled=False),
        "not known": style.Look(f"sets{aside}", style.GREY if aside else style.BLUE, "o"),
    }


def _keys(looks: list[style.Look]) -> list[Line2D]:
    return [
        Line2D(
            [],
            [],
            color=one.colour,
            label=one.label,
            marker=one.marker,
            markerfacecolor=one.marks()["markerfacecolor"],
        )
        for one in dict.fromkeys(looks)
    ]


def _ratings(data: Table, wide: bool, kind: str, middle: float) -> Figure:
    rows = list(data.rows())[:MOST]
    known = not all(math.isnan(row["biased"]) for row in rows)
    looks = [_looks(kind)[row["kind"]] for row in rows]
    panels = 1 + known
    height = (_ROW * len(rows) + 0.5) * (1 if wide else panels) + 0.7
    shape = (1, panels) if wide else (panels, 1)
    figure, axes = style.panels(wide, *shape, height, sharey=True)
    _dots(axes[0], rows, "mean", "low", "high", looks)
    axes[0].set_xlabel("mean rating, 1 is unfair")
    if not math.isnan(middle):
        axes[0].axvline(middle, color=style.INK, linewidth=0.8, linestyle=":")
        points = round(2 * middle - 1)
        axes[0].set_xlim(0.8, points + 0.2)
        axes[0].set_xticks(range(1, points + 1))
    if known:
        _dots(axes[1], rows, "biased", "biased_low", "biased_high", looks, 100)
        axes[1].set_xlim(-3, 103)
        axes[1].set_xlabel("% judged biased")
    axes[0].set_yticks(range(len(rows)), [short(row["set"]) for row in rows])
    style.legend(figure, _keys(looks), wide, 2 if wide else 1)
    return figure


def _controls(data: Table, wide: bool, kind: str) -> Figure:
    rows = list(data.rows())
    rows = [*rows[: MOST - 1], rows[-1]] if len(rows) > MOST else rows
    look = _looks(kind)["scenario"]
    figure, (ax,) = style.panels(False, 1, 1, _ROW * len(rows) + 1.1)
    ax.axvline(0, color=style.INK, linewidth=0.8)
    _dots(ax, rows, "difference", "low", "high", [look] * len(rows))
    names = ["all scenarios" if row["set"] == "all" else short(row["set"]) for row in rows]
    ax.set_yticks(range(len(rows)), names)
    ax.set_xlabel("points of the scale")
    style.legend(figure, _keys([look]), False, 1)
    return figure


def _places(data: Table, wide: bool, kind: str) -> Figure:
    """Ratings by place, less the mean of their set; the slope is left to the table."""
    rows = [row for row in data.rows() if row["place"].isdigit()]
    look = _looks(kind)["not known"]
    figure, (ax,) = style.panels(False, 1, 1, 2.3)
    ax.axhline(0, color=style.INK, linewidth=0.8)
    for x, row in enumerate(rows):
        ax.plot([x, x], [row["low"], row["high"]], color=look.colour, linewidth=1.3)
        ax.plot(x, row["mean"], linestyle="none", **look.marks())
    step = -(-len(rows) // 12)
    ax.set_xticks(range(0, len(rows), step), [row["place"] for row in rows[::step]])
    ax.set_xlabel("place of the set in the order")
    ax.set_ylabel("points beside the set's mean")
    style.bare(ax, "y")
    style.legend(figure, _keys([look]), False, 1)
    return figure


def _progress(data: Table, wide: bool, kind: str) -> Figure:
    figure, (ax,) = style.panels(False, 1, 1, 2.3)
    colour = style.BLUE if kind == "people" else style.GREY
    ax.bar(data["pages"], 100 * data["share"], width=0.72, **_look(kind, colour))
    for x, low, high in zip(data["pages"], data["low"], data["high"], strict=True):
        ax.plot([x, x], [100 * low, 100 * high], color=style.INK, linewidth=0.9)
    step = -(-len(data) // 12)
    ax.set_xticks(data["pages"][::step])
    ax.set_ylim(0, 104)
    ax.set_xlabel("pages answered, at least")
    ax.set_ylabel("% of participants")
    style.bare(ax, "y")
    style.legend(figure, [_told(kind, colour)], False, 1)
    return figure
