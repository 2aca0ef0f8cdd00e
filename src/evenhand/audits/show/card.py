"""The card of an audit: one HTML file that needs no network, no script and no other file.

Everything from the log is escaped by the template engine; only the SVG drawn here is put in as it
is, and its text was escaped when it was drawn. The same findings give the same bytes.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from matplotlib.figure import Figure

from evenhand.audits.show import figures, sentences
from evenhand.audits.show import rows as forms
from evenhand.audits.show.wording import (
    NOT_KNOWN,
    About,
    delta,
    level,
    number,
    p_value,
    points,
    same,
    seconds,
    share,
    shown,
)
from evenhand.methods.vocabulary import ISSUES
from evenhand.report import page, style
from evenhand.report.page import flat
from evenhand.statistics.verdicts import DISPARITY, INSUFFICIENT, NO_EVIDENCE

if TYPE_CHECKING:
    from evenhand.audits.judge.results import Finding, Findings, WaitFinding

LISTED = 10
"""Sentences shown at once; the others are a click away."""
OPEN = 30
"""Rows of a table that stands open."""

ICONS = {DISPARITY: "!", NO_EVIDENCE: "–", INSUFFICIENT: "?"}


@dataclass(frozen=True)
class Listing:
    """A table as text.

    Attributes:
        heads: of the columns; the first two are the group and what is said of it.
        bodies: rows of one group: its name, then the cells of each row.
        open: whether it is shown at once.
    """

    heads: tuple[str, ...]
    bodies: list[tuple[str, list[list[str]]]]
    open: bool


@dataclass(frozen=True)
class Plate:
    """A figure with its words and its table."""

    name: str
    title: str
    alt: str
    caption: str
    wide: Markup
    narrow: Markup
    listing: Listing


def render(findings: Findings, about: About) -> str:
    """The card as HTML."""
    verdict = findings.settings.verdict
    return page.fill(
        "card.html.j2",
        Path(__file__).parent / "templates",
        title=shown(about.title),
        about=about,
        doubts=[shown(sentence) for sentence in about.doubts],
        left_out=[shown(sentence) for sentence in about.left_out],
        command="\n".join(shown(line) for line in about.command.splitlines()),
        within=shown(about.within),
        findings=findings,
        icons=ICONS,
        counts=_counts(findings),
        headline=headline(findings),
        told=sentences.summary(findings, about),
        listed=LISTED,
        plates=[plate(findings, name, i) for i, name in enumerate(figures.identities(findings))],
        waiting=waiting_plate(findings, about) if findings.waits else None,
        measures=measures(findings) if findings.measures else None,
        resemblance=resemblance(findings),
        log=_pairs(about.log),
        mapping=Listing(
            ("Read as", "Column", "Unit"),
            [(shown(role), [[shown(column), shown(unit)]]) for role, column, unit in about.mapping],
            True,
        ),
        meanings=_pairs(about.meanings),
        versions=_pairs(forms.versions()),
        settings=_pairs(dataclasses.asdict(findings.settings)),
        level=level(findings),
        alpha=f"{100 * verdict.alpha:g}",
        delta=delta(findings),
        power=f"{100 * verdict.power:g}",
        facts=[
            ("Services", f"{findings.services:,}"),
            ("Identities", str(len(figures.identities(findings)))),
            ("Comparisons", f"{len(findings.findings):,}"),
            ("Permutations", f"{verdict.permutations:,}"),
            ("Seed", str(findings.settings.seed)),
        ],
    )


def headline(findings: Findings) -> str:
    """The verdict of the log; where it is not of all comparisons, of how many."""
    counts = dict(_counts(findings))
    if findings.verdict != NO_EVIDENCE or not counts[INSUFFICIENT]:
        return findings.verdict
    return (
        f"{NO_EVIDENCE} in {counts[NO_EVIDENCE]:,} of {len(findings.findings):,} comparisons, too "
        "few services in the others"
    )


def plate(findings: Findings, identity: str, place: int) -> Plate:
    """Figure and complete table of one identity."""
    these = [one for one in findings.findings if one.identity == identity]
    groups = list(dict.fromkeys(one.group for one in these))
    drawn = figures.drawn_groups(findings, identity)
    unequal = [one for one in these if one.verdict == DISPARITY]
    some = "; ".join(
        f"{shown(one.group)}, {shown(one.issue)}: {points(one.difference)} points"
        for one in unequal[:LISTED]
    )
    left = "" if len(drawn) == len(groups) else f" Drawn: {len(drawn)} of {len(groups)} groups."
    name = f"identity-{place}"
    return Plate(
        name=name,
        title=shown(identity),
        alt=(
            f"Dot chart of {shown(identity)}, a panel an issue: difference of each group against "
            f"the others in percentage points with its interval. "
            f"{f'Disparities: {some}.' if some else 'No disparity.'} "
            "All numbers are in the table under the figure."
        ),
        caption=(
            f"Right of 0: the issue is more frequent in the group than among the others. Lines: "
            f"{level(findings)} intervals that hold together. Shaded: differences below "
            f"{delta(findings)}.{left}"
        ),
        wide=_svg(lambda: figures.differences(findings, identity), name),
        narrow=_svg(lambda: figures.differences(findings, identity, False), f"{name}-narrow"),
        listing=_complete(these),
    )


def _complete(these: list[Finding]) -> Listing:
    """Every group and issue of one identity; shrunk rates and needs where there are any."""
    combined = any(not math.isnan(one.shrunk) for one in these)
    few = any(not math.isnan(one.needed) for one in these)
    bodies: dict[str, list[list[str]]] = {}
    for one in these:
        shrunk = [share(one.shrunk)] if combined else []
        needed = ["" if math.isnan(one.needed) else f"{one.needed:,.0f}"] if few else []
        cells = [*_finding(one), *shrunk, *needed]
        bodies.setdefault(one.group, []).append(cells)
    return Listing(
        (
            *("Group", "Issue", "Verdict", "Rate", "Others", "Difference", "Corrected"),
            *("Adjusted p", *["Shrunk rate"] * combined, *["Needed"] * few),
        ),
        [(shown(group), rows) for group, rows in bodies.items()],
        len(these) <= OPEN,
    )


def waiting_plate(findings: Findings, about: About) -> Plate:
    """Figure and table of waiting, services without a response included."""
    limit = "the limit" if math.isnan(about.late) else seconds(about.late)
    like = (
        f" Differences and p-values are {same(about.within)}; shares and medians are of the whole "
        "log."
        if about.within
        else ""
    )
    bodies = [
        (
            f"{shown(one.group)} ({shown(one.identity)})",
            [
                [
                    f"{one.n:,}",
                    f"{one.responses:,}",
                    "not reached" if math.isnan(one.median) and one.n else seconds(one.median),
                    f"{share(one.unserved)} {_share_interval(one)}",
                    share(one.rest_unserved),
                    f"{points(one.difference)} {_interval(one.low, one.high)}",
                    p_value(one.p),
                ]
            ],
        )
        for one in findings.waits
    ]
    return Plate(
        name="waiting",
        title="Waiting for a response",
        alt=(
            f"Dot chart, a panel an identity: share of each group still waiting after {limit} "
            "with its interval, beside the others. All numbers are in the table under the figure."
        ),
        caption=(
            f"Share still waiting after {limit} (Kaplan and Meier): a service that ended without "
            f"a response counts as waiting until it ended. Lines: {level(findings)} intervals."
            f"{like}"
        ),
        wide=_svg(lambda: figures.waiting(findings), "waiting"),
        narrow=_svg(lambda: figures.waiting(findings, False), "waiting-narrow"),
        listing=Listing(
            (
                "Group", "Services", "Responses", "Median wait", f"Waiting after {limit}",
                "Others", "Difference", "Adjusted p",
            ),
            bodies,
            len(bodies) <= OPEN,
        ),
    )  # fmt: skip


def measures(findings: Findings) -> Listing:
    """Table of further measures."""
    bodies = [
        (
            f"{shown(one.group)} ({shown(one.identity)})",
            [
                [
                    shown(one.measure),
                    f"{one.n:,}",
                    number(one.mean),
                    number(one.rest_mean),
                    p_value(one.mean_p),
                    number(one.median),
                    number(one.rest_median),
                    p_value(one.median_p),
                ]
            ],
        )
        for one in findings.measures
    ]
    heads = ("Group", "Measure", "Services", "Mean", "Others", "Adjusted p", "Median", "Others",
             "Adjusted p")  # fmt: skip
    return Listing(heads, bodies, len(bodies) <= OPEN)


def resemblance(findings: Findings) -> Listing:
    """Table of what the detector sees."""
    issues = list(dict.fromkeys(one.issue for one in findings.findings))
    bodies = [
        (
            shown(one.identity),
            [
                [
                    *(number(score) for score in one.scores),
                    share(one.biased),
                    share(one.biased_even),
                    shown(one.looks_like or "none named"),
                ]
            ],
        )
        for one in findings.resemblance
    ]
    # The detector has its own issues: the log's names are used where there are as many.
    width = max((len(one.scores) for one in findings.resemblance), default=0)
    names = issues if len(issues) == width else list(ISSUES) if width == len(ISSUES) else []
    scores = [f"I: {shown(names[i]) if names else i + 1}" for i in range(width)]
    heads = ("Identity", *scores, "Windows called biased", "By chance", "Looks like")
    return Listing(heads, bodies, True)


def _counts(findings: Findings) -> list[tuple[str, int]]:
    verdicts = [one.verdict for one in findings.findings]
    return [(verdict, verdicts.count(verdict)) for verdict in ICONS]


def _finding(one: Finding) -> list[str]:
    return [
        shown(one.issue),
        one.verdict,
        f"{share(one.rate)} ({one.cases:,} of {one.n:,})",
        f"{share(one.rest_rate)} of {one.rest_n:,}",
        f"{points(one.difference)} {_interval(one.low, one.high)}",
        number(100 * one.corrected, 1),
        p_value(one.p_adjusted),
    ]


def _interval(low: float, high: float) -> str:
    return "" if math.isnan(low) else f"[{points(low)}, {points(high)}]"


def _share_interval(one: WaitFinding) -> str:
    low, high = 100 * one.unserved_low, 100 * one.unserved_high
    return "" if math.isnan(low) else f"[{number(low, 1)}, {number(high, 1)}]"


def _pairs(described: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (shown(name), NOT_KNOWN if said == "not defined" else shown(said))
        for name, said in flat(forms.as_plain(described))
    ]


def _svg(draw: Callable[[], Figure], name: str) -> Markup:
    """A figure for the page; letters that its font lacks are left to the reader's browser."""
    with style.drawing(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        return Markup(style.inline_svg(style.svg_text(draw(), name), name))
