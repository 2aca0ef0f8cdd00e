"""Figures of an audit: differences of each identity, and how long groups wait.

Made with ``with style.drawing():`` around drawing and saving, as every figure of Evenhand.
Verdicts differ in colour, marker and filling. Each figure comes wide or narrow, for a phone.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator

from evenhand.audits.show.wording import NOT_KNOWN, shown
from evenhand.core.wording import MINUS
from evenhand.report import style
from evenhand.statistics.verdicts import DISPARITY, INSUFFICIENT, NO_EVIDENCE

if TYPE_CHECKING:
    from evenhand.audits.judge.results import Finding, Findings, WaitFinding

BETWEEN = " × "
"""Parts the names of a combined group."""

MOST = 40
"""Groups in a figure; more cannot be read. Tables hold all."""

LOOKS = {
    DISPARITY: style.Look("disparity", style.VERMILLION, "s"),
    NO_EVIDENCE: style.Look("no evidence", style.BLUE, "o"),
    INSUFFICIENT: style.Look("insufficient data", style.GREY, "o", (0, (2.5, 1.5)), filled=False),
}
_ROW, _LETTERS_WIDE, _LETTERS_NARROW = 0.21, 26, 15


def identities(findings: Findings) -> list[str]:
    """Names of the identities, in order; intersections are identities of their own."""
    return list(dict.fromkeys(one.identity for one in findings.findings))


def drawn_groups(findings: Findings, identity: str) -> list[str]:
    """Groups of an identity that its figure shows, in order.

    All of them up to ``MOST``; of more, those with a disparity and then the largest ones.
    """
    these = [one for one in findings.findings if one.identity == identity]
    groups = list(dict.fromkeys(one.group for one in these))
    if len(groups) <= MOST:
        return groups
    unequal = {one.group for one in these if one.verdict == DISPARITY}
    size = {group: max(one.n for one in these if one.group == group) for group in groups}
    chosen = sorted(groups, key=lambda group: (group not in unequal, -size[group]))[:MOST]
    return [group for group in groups if group in set(chosen)]


def differences(findings: Findings, identity: str, wide: bool = True) -> Figure:
    """Difference of each group against the others with its interval, a panel an issue."""
    groups = drawn_groups(findings, identity)
    these = [o for o in findings.findings if o.identity == identity and o.group in set(groups)]
    issues = list(dict.fromkeys(one.issue for one in these))
    delta = findings.settings.verdict.delta
    reach = 100 * max([delta, *(abs(x) for o in these for x in _ends(o) if not math.isnan(x))])
    # Up to four panels beside each other; on a phone all below each other.
    columns = min(len(issues), 4) if wide else 1
    rows = -(-len(issues) // columns)
    height = rows * (0.42 + _ROW * len(groups)) + 0.75
    figure, axes = style.panels(wide, rows, columns, height, sharex=True, sharey=True)
    for ax, issue in zip(axes, issues, strict=False):
        found = {one.group: one for one in these if one.issue == issue}
        ax.axvspan(-100 * delta, 100 * delta, color=style.PALE, alpha=0.55, linewidth=0)
        ax.axvline(0, color=style.INK, linewidth=0.8)
        for place, group in enumerate(groups):
            if group in found:
                _difference(ax, place, found[group])
        ax.set_title(shown(issue))
        style.bare(ax, "x")
        ax.tick_params(axis="y", length=0)
    for ax in axes[len(issues) :]:
        ax.remove()
    letters = _LETTERS_WIDE if wide else _LETTERS_NARROW
    axes[0].set_yticks(range(len(groups)), [elided(group, letters) for group in groups])
    axes[0].set_ylim(len(groups) - 0.4, -0.6)
    axes[0].set_xlim(-1.06 * reach, 1.06 * reach)
    axes[0].xaxis.set_major_locator(_ticks(reach))
    axes[0].xaxis.set_major_formatter(
        lambda value, _: f"{value:+.3g}".replace("-", MINUS) if value else "0"
    )
    figure.supxlabel("difference against the others, percentage points", fontsize=8)
    band = Patch(color=style.PALE, label=f"below ±{100 * delta:g}")
    style.legend(figure, [*_keys({one.verdict for one in these}), band], wide)
    return figure


def waiting(findings: Findings, wide: bool = True) -> Figure:
    """Share of each group still waiting at the limit with its interval, a panel an identity."""
    panels: dict[str, list[WaitFinding]] = {}
    for one in findings.waits:
        panels.setdefault(one.identity, []).append(one)
    for name, these in panels.items():
        largest = sorted(these, key=lambda one: -one.n)[:MOST]
        panels[name] = [one for one in these if one in largest]
    sizes = [len(these) for these in panels.values()]
    height = sum(0.42 + _ROW * size for size in sizes) + 0.75
    options = {"height_ratios": [size + 0.6 for size in sizes]}
    figure, axes = style.panels(wide, len(panels), 1, height, sharex=True, gridspec_kw=options)
    alpha = findings.settings.verdict.alpha
    unequal, alike = LOOKS[DISPARITY], LOOKS[NO_EVIDENCE]
    letters = _LETTERS_WIDE if wide else _LETTERS_NARROW
    for ax, (identity, these) in zip(axes, panels.items(), strict=True):
        for place, one in enumerate(these):
            look = unequal if one.p <= alpha else alike
            if math.isnan(one.unserved):
                ax.text(0, place, f" {NOT_KNOWN}", va="center", fontsize=7, color=style.GREY)
                continue
            ends = [100 * one.unserved_low, 100 * one.unserved_high]
            ax.plot(ends, [place, place], color=look.colour)
            ax.plot(100 * one.unserved, place, linestyle="none", **look.marks())
            ax.plot(100 * one.rest_unserved, place, **_OTHERS)
        ax.set_yticks(range(len(these)), [elided(one.group, letters) for one in these])
        ax.set_ylim(len(these) - 0.4, -0.6)
        ax.set_title(elided(identity, 2 * letters))
        ax.tick_params(axis="y", length=0)
        style.bare(ax, "x")
    axes[-1].set_xlim(left=0)
    axes[-1].set_xlabel("still waiting at the limit, % of services")
    keys = [_key(unequal, "waits differ"), _key(alike, "no difference found")]
    style.legend(figure, [*keys, Line2D([], [], label="the others", **_OTHERS)], wide)
    return figure


_OTHERS = {
    "marker": "|",
    "markersize": 8,
    "markeredgewidth": 1.6,
    "color": style.INK,
    "linestyle": "none",
}


def elided(name: str, letters: int) -> str:
    """A name from a log that fits beside a panel; wide letters count twice.

    Of the parts of a combined group the longest gives way first, so that few look the same.
    """
    parts = shown(name).split(BETWEEN)
    kept = list(parts)
    while _width(BETWEEN.join(kept)) > letters and max(map(len, kept)) > 2:
        longest = max(range(len(kept)), key=lambda place: _width(kept[place]))
        left = len(kept[longest]) - (2 if kept[longest] != parts[longest] else 1)
        kept[longest] = f"{parts[longest][:left].rstrip()}…"
    return BETWEEN.join(kept)


def _width(said: str) -> int:
    return sum(2 if unicodedata.east_asian_width(letter) in "WF" else 1 for letter in said)


def _ends(one: Finding) -> tuple[float, float, float]:
    return one.difference, one.low, one.high


def _difference(ax: Axes, place: int, one: Finding) -> None:
    if math.isnan(one.difference):
        white = {"facecolor": "white", "edgecolor": "none", "pad": 1.2}
        ax.text(0, place, NOT_KNOWN, va="center", ha="center", fontsize=6.5, bbox=white)
        return
    look = LOOKS[one.verdict]
    ends = [100 * one.low, 100 * one.high]
    ax.plot(ends, [place, place], color=look.colour, linestyle=look.line, linewidth=1.4)
    ax.plot(100 * one.difference, place, linestyle="none", **look.marks())


def _keys(present: set[str]) -> list[Line2D]:
    return [_key(look, look.label) for verdict, look in LOOKS.items() if verdict in present]


def _key(look: style.Look, label: str) -> Line2D:
    return Line2D([], [], color=look.colour, linestyle=look.line, label=label,
                  marker=look.marker, markerfacecolor=look.marks()["markerfacecolor"])  # fmt: skip


def _ticks(reach: float) -> FixedLocator:
    """Five round ticks around 0 at most."""
    steps: Sequence[float] = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 25, 50, 100)
    step = next((step for step in steps if reach / step < 2.5), 100)
    whole = math.floor(0.95 * reach / step)  # a label at the edge would touch the next panel's
    return FixedLocator([step * place for place in range(-whole, whole + 1)])
