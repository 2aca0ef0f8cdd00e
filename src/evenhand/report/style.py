"""Room: how every figure looks. Takes: names. Gives: colours, markers, sizes, SVG and PDF bytes.

May touch: matplotlib. Colours are Okabe and Ito's (2008), safe for colour-blind readers; marker
and line style tell the same series apart, so that a figure also works in grey. Each figure comes
in two widths, one for paper and laptop and one for a phone, because text that shrinks with its
figure cannot be read on a phone.
"""

import io
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from evenhand.core.palette import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
)
from evenhand.report.table import Table

# Inches. At these widths 8 pt text is about 14 px on a laptop and 10 px on a phone 375 px wide.
WIDE, NARROW = 7.2, 3.5

# What the paper printed has the same mark in every figure.
PAPER: dict[str, Any] = {
    "marker": "D",
    "markersize": 5.5,
    "markerfacecolor": "white",
    "markeredgecolor": INK,
    "markeredgewidth": 1.1,
    "linestyle": "none",
}

_RC: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # ships with matplotlib: the same layout everywhere
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 7,
    "axes.labelsize": 8,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "text.color": INK,
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.4,
    "lines.linewidth": 1.6,
    "lines.markersize": 5,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",  # text stays text: searchable, selectable, read aloud
    "pdf.fonttype": 42,
}


@dataclass(frozen=True)
class Look:
    """How one series is drawn, in every figure the same."""

    label: str
    colour: str
    marker: str
    line: Any = "-"
    filled: bool = True

    def marks(self) -> dict[str, Any]:
        """Arguments for ``Axes.plot`` that set colour and marker."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "markerfacecolor": self.colour if self.filled else "white",
            "markeredgecolor": self.colour,
            "markeredgewidth": 1.2,
        }


_DASHED = (0, (4, 1.6))
ARMS = {
    "reinforce": Look("REINFORCE", VERMILLION, "o", _DASHED, filled=False),
    "reinforce+guidance": Look("REINFORCE + guidance", ORANGE, "o"),
    "reinforce+levelup": Look("REINFORCE + level-up", PURPLE, "D"),
    "ppo": Look("PPO", BLUE, "s", _DASHED, filled=False),
    "ppo+guidance": Look("PPO + guidance", GREEN, "s"),
    "ppo+levelup": Look("PPO + level-up", SKY, "^"),
}
KINDS = {
    "none": Look("none", GREY, "o"),
    "even": Look("even", GREY, "o"),
    "racism": Look("racism", BLUE, "s"),
    "racist": Look("racist", BLUE, "s"),
    "sexism": Look("sexism", PURPLE, "v"),
    "sexist": Look("sexist", PURPLE, "v"),
    "ageism": Look("ageism", VERMILLION, "^"),
    "ageist": Look("ageist", VERMILLION, "^"),
    "ableism": Look("ableism", GREEN, "D"),
    "ableist": Look("ableist", GREEN, "D"),
    "colourism": Look("colourism", ORANGE, "P"),
}
_SPARE = [(PURPLE, "^"), (BLACK, "v"), (SKY, "P"), (ORANGE, "X"), (GREEN, "<"), (BLUE, ">")]

PRESETS = {
    "paper": "Preset paper: the printed reward alone",
    "service": "Preset service: quality of service and the printed reward",
    "prejudiced": "Preset service after imitating biased robots",
}


def looks(names: Sequence[str], known: dict[str, Look]) -> dict[str, Look]:
    """A look for each name: its own where it has one, a spare one otherwise."""
    spare = 0
    found: dict[str, Look] = {}
    for name in names:
        if name in known:
            found[name] = known[name]
            continue
        colour, marker = _SPARE[spare % len(_SPARE)]
        found[name] = Look(name, colour, marker)
        spare += 1
    return found


def arm_label(arm: str) -> str:
    """The name of an arm for readers."""
    return ARMS[arm].label if arm in ARMS else arm


def preset_title(preset: str) -> str:
    """The name of a preset for readers."""
    return PRESETS.get(preset, f"Preset {preset}")


def preset_short(preset: str) -> str:
    """The name of a preset that fits over a panel, on a phone too."""
    return preset_title(preset).replace("quality of service and the", "quality +")


def drawing() -> AbstractContextManager[None]:
    """The context in which figures are made and saved; what is set outside stays as it was."""
    settings: Any = {**mpl.rcParamsDefault, **_RC, "backend": "agg"}
    return mpl.rc_context(settings)


def new_figure(wide: bool, height: float) -> Figure:
    """An empty figure of one of the two widths."""
    return Figure(figsize=(WIDE if wide else NARROW, height))


def panels(
    wide: bool, rows: int, columns: int, height: float, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A grid of axes, read row by row; ``options`` go to ``Figure.subplots``."""
    figure = new_figure(wide, height)
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(grid.flat)


def legend(figure: Figure, handles: Sequence[Any], wide: bool, columns: int = 0) -> None:
    """A legend above the panels, so that it never covers data."""
    figure.legend(
        handles=list(handles),
        loc="outside upper left",
        ncols=columns or (4 if wide else 2),
        borderaxespad=0.1,
    )


def bare(axes: Axes, grid: Literal["x", "y"]) -> None:
    """Keep grid lines along one axis only."""
    axes.grid(False, axis="y" if grid == "x" else "x")


def svg_text(figure: Figure, name: str) -> str:
    """The figure as SVG: the same bytes for the same data, without a date."""
    out = io.StringIO()
    # print_svg draws once where savefig draws twice: half the time of a report.
    with mpl.rc_context({"svg.hashsalt": name}):
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    """The figure as PDF with embedded fonts: the same bytes for the same data.

    Call it after ``svg_text``: it keeps the layout that was found there.
    """
    figure.set_layout_engine("none")
    out = io.BytesIO()
    stamps = {"CreationDate": None, "Creator": None, "Producer": None}
    FigureCanvasPdf(figure).print_pdf(out, metadata=stamps)
    return out.getvalue()


def inline_svg(svg: str, prefix: str) -> str:
    """An SVG file as an element of a page.

    The prolog, comments and metadata go; identifiers get a prefix, since several figures share
    one page; numbers keep two decimals, a hundredth of a point; the size is left to the page, and
    so is the name for screen readers.
    """
    body = svg[svg.index("<svg") :]
    for pattern in (r"<!--.*?-->", r"<metadata>.*?</metadata>", r"<defs>\s*<style.*?</defs>"):
        body = re.sub(pattern, "", body, flags=re.DOTALL)

    def tag(found: re.Match[str]) -> str:
        text = re.sub(r"(\.\d\d)\d+", r"\1", found[0].replace("\n", " "))
        text = re.sub(r'\bid="', f'id="{prefix}-', text)
        return re.sub(r'(?:xlink:)?(href="|url\()#', rf"\1#{prefix}-", text)

    body = re.sub(r">\s*\n\s*<", "><", body)
    head, rest = re.sub(r"<[^>]+>", tag, body).split(">", 1)
    head = re.sub(r'\s(width|height|version|xmlns:xlink|xmlns)="[^"]*"', "", head)
    return f'{head} aria-hidden="true" focusable="false">{rest}'.strip()


def arms_in(data: Table) -> list[str]:
    """The arms of a table, the paper's four first and in their order."""
    found = data.distinct("arm")
    return [arm for arm in ARMS if arm in found] + [a for a in found if a not in ARMS]
