"""The report of judged environments: windows as they went by, and verdicts on all services.

Takes ledgers, gives ``services/*.parquet``, ``figures/*`` and ``report.html`` in one folder. Files
of services have the names of runs in small letters, numbered where two would have the same. The
page needs no network, no script and no other file.
"""

from __future__ import annotations

import dataclasses
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evenhand.adapters.ledger import Ledger
from evenhand.audits.judge.results import AuditSettings, Findings, listed, overall
from evenhand.audits.show import figures as audit_figures
from evenhand.audits.show import sentences
from evenhand.audits.show.wording import level
from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.core.wording import percent
from evenhand.methods import registry
from evenhand.methods.beyond.reflection import Reflection, ReflectionSettings
from evenhand.methods.paper.scores import Counts
from evenhand.report import figure as figures
from evenhand.report import page as html
from evenhand.report import reflection_figure, style
from evenhand.report.figure import Drawn, Plate
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, say, table, trailing_mean
from evenhand.statistics import chance
from evenhand.statistics.verdicts import judge_table

AVERAGE = 20
"""Windows in a running mean."""

_LOOKS = ((style.BLUE, "o"), (style.VERMILLION, "s"), (style.GREEN, "^"), (style.ORANGE, "D"))


def write(
    folder: Path | str,
    runs: Mapping[str, Ledger],
    *,
    title: str,
    note: str,
    tests: Mapping[str, Ledger] | None = None,
    updates: Mapping[str, Examined] | None = None,
    settings: AuditSettings | None = None,
    command: str = "",
    created: str = "",
) -> Path:
    """Write the report of one run or of several beside each other.

    Args:
        folder: is made where it does not exist.
        runs: by name, all of one scheme; their windows are drawn.
        title: of the page.
        note: what a reader has to know first, for instance that groups are made up.
        tests: by name, whose services are judged; by default those of ``runs``.
        updates: by name, what self-reflection found in learning.
        settings: of the verdicts.
        command: that repeats it.
        created: when, as text.

    Returns:
        The path of ``report.html``.

    Raises:
        InputError: for no run, runs of other schemes, runs without services, or a folder that
            cannot be written.
    """
    judged = {f"{name}, tested": ledger for name, ledger in tests.items()} if tests else runs
    everything = [*runs.items(), *(judged.items() if tests else ())]
    if not runs:
        raise InputError("empty runs", "there is no run to report: give at least one")
    for name, ledger in everything:
        first = next(iter(runs.values())).scheme
        if (ledger.scheme.groups, ledger.scheme.issue_names) != (first.groups, first.issue_names):
            raise InputError(
                "conflict run", f"run {name!r} is of another scheme than the first: report it apart"
            )
        if not len(ledger.windows()):
            raise InputError(
                "empty run",
                f"run {name!r} has {len(ledger)} services and no window of "
                f"{ledger.settings.services} is over: let more episodes end first",
            )
    found = {name: findings_of(ledger, settings) for name, ledger in judged.items()}
    drawn = [windows_figure(runs)]
    if updates:
        drawn.append(updates_figure(updates))
    course = len(drawn)
    parts = []
    for place, (name, findings) in enumerate(found.items()):
        pictures = [
            differences_figure(findings, identity, name, f"run{place}-{i}")
            for i, identity in enumerate(audit_figures.identities(findings))
        ]
        drawn += pictures
        parts.append((f"run{place}", name, _told(findings), pictures))
    page = _render(runs, parts, drawn[:course], title, note, command, created, found)
    root = files.make_folder(folder)
    figures.write(files.make_folder(root / "figures"), drawn)
    services = files.make_folder(root / "services")
    for file, (_, ledger) in zip(_files([name for name, _ in everything]), everything, strict=True):
        ledger.services().write_parquet(services / f"{file}.parquet")
    target = root / "report.html"
    files.write_text(target, page)
    return target


def windows_table(runs: Mapping[str, Ledger]) -> Table:
    """A row for each window that is over.

    Columns: run, window, total (printed score), corrected (the same without what chance gives, of
    the last ``AVERAGE`` windows as one), without_issue (share of services), biased (1, 0, or NaN
    without a detector), paid.
    """
    rows: list[tuple[object, ...]] = []
    for name, ledger in runs.items():
        found = ledger.windows()
        x, _ = ledger.rows()
        size = found.services
        clean = ~(x[: len(found) * size] == 1.0).any(axis=1)
        share = clean.reshape(len(found), size).mean(axis=1)
        biased = np.full(len(found), np.nan) if found.biased is None else found.biased.astype(float)
        corrected = chance.corrected_scores(
            trailing(found.counts, AVERAGE), ledger.scheme.groups, ledger.scheme.issue_names
        )
        columns = (found.scores.total, corrected.total, share, biased, found.paid)
        rows += [
            (name, window, *(float(column[window]) for column in columns))
            for window in range(len(found))
        ]
    return table(("run", "window", "total", "corrected", "without_issue", "biased", "paid"), rows)


def windows_figure(runs: Mapping[str, Ledger]) -> Drawn:
    """Evenness and quality of service, window by window."""
    data = windows_table(runs)
    sizes = sorted({ledger.settings.services for ledger in runs.values()})
    judge = ""
    if any(ledger.detector is not None for ledger in runs.values()):
        shares = [
            f"{name} {np.nansum(part):.0f} of {len(part):,}"
            for name in runs
            if not np.isnan(part := data.where(run=name)["biased"]).all()
        ]
        judge = f" Windows that the detector calls biased: {', '.join(shares)}."
    return _drawn(
        "windows",
        "Evenness and service, window by window",
        "Line charts, a line a run: score without chance, and share of services without an issue.",
        data,
        _windows,
        f"First: total issue score of the last {AVERAGE} windows of {' or '.join(map(str, sizes))} "
        "services, less what chance gives an even robot (root of the unbiased squared gaps); 0 is "
        "even. Second: services without any issue; a score means little without it. Line: mean of "
        f"the last {AVERAGE} windows; faint: each one."
        f"{judge}",
    )


def trailing(counts: Counts, width: int) -> Counts:
    """Counts of each window and of up to ``width`` - 1 before it, added up, [W, G, K]."""

    def added(each: np.ndarray) -> np.ndarray:
        so_far = np.cumsum(each, axis=0)
        return (
            so_far - np.concatenate([np.zeros_like(so_far[:width]), so_far[:-width]])[: len(each)]
        )

    return Counts(*(added(getattr(counts, one.name)) for one in fields(Counts)))


def updates_figure(updates: Mapping[str, Examined]) -> Drawn:
    """What each update was along the bias gradient."""
    data = updates_table(updates)
    return _drawn(
        "updates",
        "Self-reflection: updates along the bias gradient",
        "Dot charts by run: change of the score and rarity of each update; abnormal ones marked.",
        data,
        lambda drawn, wide: reflection_figure.reflection_draw(drawn, wide, "update"),
        caption(data, updates),
    )


def differences_figure(findings: Findings, identity: str, run: str, name: str) -> Drawn:
    """Groups of one identity against the other side, with intervals and verdicts."""
    rows = [
        (f.group, f.issue, f.n, f.rate, f.rest_n, f.rest_rate, f.difference, f.low, f.high,
         f.p_adjusted, f.verdict)
        for f in findings.findings if f.identity == identity
    ]  # fmt: skip
    heads = ("group", "issue", "n", "rate", "others_n", "others_rate", "difference", "low", "high",
             "p_adjusted", "verdict")  # fmt: skip
    return _drawn(
        name,
        f"{identity}: differences, {run}",
        "Dot chart, a panel an issue: difference of each group against the others, in points.",
        table(heads, rows),
        lambda _, wide: audit_figures.differences(findings, identity, wide),
        f"{findings.services:,} services. Right of 0: the issue is more frequent in the group. "
        f"Lines: {level(findings)} intervals that hold together.",
    )


def _drawn(name: str, title: str, alt: str, data: Table, draw: Any, caption: str) -> Drawn:
    plate = Plate(name, title, "", "learning", alt, lambda _: data, draw, lambda *_: caption)
    with warnings.catch_warnings():
        # letters that the figure's font lacks are left to the reader's browser
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        return figures.draw(plate, Results({}, {}, []))


def _windows(data: Table, wide: bool) -> Figure:
    shape = (1, 2) if wide else (2, 1)
    figure, axes = style.panels(wide, *shape, 2.7 if wide else 4.6)
    names = data.distinct("run")
    known = {name: style.Look(name, *_LOOKS[i]) for i, name in enumerate(names[: len(_LOOKS)])}
    looks = style.looks(names, known)
    for ax, column, scale in zip(axes, ("corrected", "without_issue"), (1.0, 100.0), strict=True):
        for name, look in looks.items():
            part = data.where(run=name)
            at, values = part["window"], scale * part[column]
            every = max(1, len(at) // 6)
            smooth = values
            if column != "corrected":  # which is of many windows already
                ax.plot(at, values, color=look.colour, alpha=0.22, linewidth=0.5)
                smooth = trailing_mean(values, AVERAGE)
            ax.plot(
                at, smooth, **look.marks(), markevery=every, markersize=3.8, linestyle=look.line
            )
        ax.set_xlabel("window")
    axes[0].axhline(0.0, color=style.INK, linewidth=0.8)
    axes[0].set_ylabel("total issue score, less chance")
    axes[1].set_ylabel("services without an issue, %")
    axes[1].set_ylim(0, 102)
    style.legend(
        figure, [Line2D([], [], label=look.label, **look.marks()) for look in looks.values()], wide
    )
    return figure


def _told(findings: Findings) -> list[str]:
    return [
        sentences.verdict_sentence(findings),
        *sentences.disparity_sentences(findings),
        *sentences.unknown_sentences(findings.findings),
        sentences.total_sentence(findings),
    ]


def _render(
    runs: Mapping[str, Ledger],
    parts: Sequence[tuple[str, str, list[str], list[Drawn]]],
    course: Sequence[Drawn],
    title: str,
    note: str,
    command: str,
    created: str,
    found: Mapping[str, Findings],
) -> str:
    from evenhand import __version__

    ledger = next(iter(runs.values()))
    scheme = ledger.scheme
    known = next(iter(found.values())).settings
    return html.fill(
        "judged.html.j2",
        Path(__file__).parent / "templates",
        manifest={"version": __version__, "created": created or title, "command": command},
        title=title,
        note=note,
        facts=[
            *((name, f"{len(one):,} services") for name, one in runs.items()),
            ("Services a window", f"{ledger.settings.services:,}"),
            ("Groups", f"{len(scheme.groups)} of {len(scheme.identities)} identities"),
            ("Issues", ", ".join(scheme.issue_names)),
        ],
        course=[html.figure_context(one) for one in course],
        parts=[
            (anchor, name, told, [html.figure_context(one) for one in pictures])
            for anchor, name, told, pictures in parts
        ],
        references=[(one.name, one.reference) for one in scheme.identities if one.reference],
        summary=[
            (name, say(one.total), say(one.even_total), one.verdict) for name, one in found.items()
        ],
        settings=html.flat(
            {
                **{name: _settings(one) for name, one in runs.items()},
                "verdicts": dataclasses.asdict(known),
            }
        ),
        identities=[(one.name, ", ".join(one.groups)) for one in scheme.identities],
        rules=[(issue.name, f"told by {', '.join(issue.needs)}") for issue in scheme.issues],
    )


def _settings(ledger: Ledger) -> dict[str, Any]:
    chosen = ledger.settings
    weights = chosen.weights(ledger.scheme).tolist()
    method = {"name": registry.name_of(chosen.method)} | dataclasses.asdict(chosen.method)
    tau = dict(zip(ledger.scheme.issue_names, weights, strict=True))
    return {"services": chosen.services, "method": method, "tau": tau}


def _files(names: Sequence[str]) -> list[str]:
    """A name of a file for each, no two the same."""
    found: list[str] = []
    for name in names:
        plain = re.sub(r"\W+", "_", name).strip("_").lower() or "run"
        numbered = (f"{plain}_{number}" for number in count(2))
        found.append(next(one for one in chain([plain], numbered) if one not in found))
    return found


def findings_of(ledger: Ledger, settings: AuditSettings | None = None) -> Findings:
    """All that the statistics say of the services of a ledger."""
    if not len(ledger):
        raise InputError("empty services", "no service has ended yet: there is nothing to judge")
    chosen = settings or AuditSettings()
    x, inside = ledger.rows()
    x = np.where(np.isnan(x), np.nan, x >= 0.5)  # graded issues as yes or no
    rng = np.random.default_rng(chosen.seed)
    found, test = judge_table(x, inside, np.ones(len(x), np.int64), rng, chosen.verdict)
    scheme = ledger.scheme
    findings = listed(found, scheme.groups, scheme.issue_names, chance.even_gaps(found.counts))
    return Findings(
        findings=findings,
        waits=(),
        measures=(),
        resemblance=(),
        verdict=overall(findings),
        total=test.total,
        even_total=test.even_total,
        p_total=test.p_total,
        services=len(ledger),
        settings=chosen,
    )


HEADS = (
    "preset", "arm", "epoch", "projection", "p_value", "earlier", "rate", "alarm", "identity",
    "issue", "favoured", "able",
)  # fmt: skip


@dataclass(frozen=True)
class Examined:
    """Updates of a run, examined one after the other."""

    updates: Sequence[Reflection]
    settings: ReflectionSettings


def updates_table(runs: Mapping[str, Examined]) -> Table:
    """A row for each update: change of the total score, how rare it is, what it favoured."""
    rows = [
        (
            "", name, number, float(one.projection[-1, -1]), one.p_value,
            min(number, run.settings.history), run.settings.rate, float(one.alarm),
            one.identity if one.alarm else None, one.issue if one.alarm else None,
            ", ".join(one.favoured) if one.alarm else None,
        )
        for name, run in runs.items()
        for number, one in enumerate(run.updates)
    ]  # fmt: skip
    if not rows:
        raise InputError("empty update", "no update was examined: leave these runs out")
    return reflection_figure.able_or_not(table(HEADS[:-1], rows))


def caption(data: Table, runs: Mapping[str, Examined]) -> str:
    """What the figure shows, and alarms beside what is to be expected by chance."""
    counts = []
    for name in runs:
        part = data.where(arm=name)
        able = part["able"] == 1
        if not able.any():
            counts.append(f"{name}, none could be raised")
            continue
        expected = float(part["rate"][able].sum())
        alarms = int(part["alarm"].sum())
        counts.append(f"{name}, {alarms} of {int(able.sum()):,} ({expected:.1f})")
    return (
        "Above: change of the total issue score that an update makes, to first order. Below: share "
        "of the latest updates, itself included, that raise bias at least as abnormally in some "
        f"identity and issue; an alarm is raised from {percent(float(data['rate'].max()))} down; "
        "its mark is the identity, its letter the first of the issue. Alarms, of the updates with "
        "enough earlier ones to raise one, beside the most that the rate lets expect where nothing "
        f"is wrong: {'; '.join(counts)}."
    )
