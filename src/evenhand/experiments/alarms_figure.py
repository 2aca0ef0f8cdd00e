"""Room: how far verdicts can be trusted. Takes: rows of simulations. Gives: a figure as files.

The left panel is about even robots: any alarm is a false one. The right panel is about robots with
one known disparity.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.lines import Line2D

from evenhand.report import style

_COLOURS = (style.SKY, style.BLUE, style.GREEN, style.VERMILLION)
_MARKERS = ("o", "s", "^", "D")


def draw(
    false: Sequence[Mapping[str, Any]], found: Sequence[Mapping[str, Any]], seed: int
) -> tuple[str, bytes]:
    """The figure as SVG text and PDF."""
    with style.drawing():
        figure, (left, right) = style.panels(True, 1, 2, 3.0)
        sizes = [row["size"] for row in false]
        places = range(len(sizes))
        for offset, name, look in (
            (-0.1, "verdict", style.Look("verdict (corrected, max-T)", style.BLUE, "s")),
            (0.1, "raw", style.Look("raw total score > 0.5", style.VERMILLION, "o", filled=False)),
        ):
            for i, row in enumerate(false):
                x = i + offset
                left.plot([x, x], [100 * row[f"{name}_{end}"] for end in ("low", "high")],
                          color=look.colour)  # fmt: skip
                left.plot(x, 100 * row[name], **look.marks(), markersize=5, clip_on=False)
            left.plot([], [], linestyle="none", label=look.label, **look.marks())
        left.axhline(5, color=style.INK, linewidth=0.9, linestyle=(0, (1, 1.5)))
        left.annotate("5 %", (1, 5), (-2, 2), xycoords=("axes fraction", "data"),
                      textcoords="offset points", ha="right", fontsize=7)  # fmt: skip
        left.set_xticks(list(places), [f"{size:,}" for size in sizes])
        left.set_xlabel("services in a window")
        left.set_ylabel("windows with a false alarm, %")
        left.set_ylim(0, 104)
        left.set_title(f"An even robot: {false[0]['windows']:,} windows each")
        left.legend(loc="upper right", frameon=False)
        differences = list(dict.fromkeys(row["difference"] for row in found))
        for difference, colour, marker in zip(differences, _COLOURS, _MARKERS, strict=True):
            rows = [row for row in found if row["difference"] == difference]
            right.plot(places, [100 * row["found"] for row in rows], color=colour, marker=marker)
            for i, row in enumerate(rows):
                right.plot([i, i], [100 * row["low"], 100 * row["high"]], color=colour)
        right.set_xticks(list(places), [f"{size:,}" for size in sizes])
        right.set_xlabel("services in a window")
        right.set_ylabel("windows in which it is found, %")
        right.set_ylim(0, 104)
        right.set_title(f"A known disparity: {found[0]['windows']:,} windows each")
        marks = [
            Line2D([], [], color=colour, marker=marker, label=f"+{difference:g} in one rate")
            for difference, colour, marker in zip(differences, _COLOURS, _MARKERS, strict=True)
        ]
        right.legend(handles=marks, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        for axes in (left, right):
            style.bare(axes, "y")
        figure.suptitle(
            f"Simulated windows, 22 groups × 4 issues, issue rate 0.3, seed {seed}; lines: 95 % "
            "intervals", x=0.01, ha="left", fontsize=7.5,
        )  # fmt: skip
        return style.svg_text(figure, "alarms"), style.pdf_bytes(figure)
