"""The report of a study: one HTML file that needs nothing else, its figures and its tables.

Everything that came from answers is escaped by the template engine; only the SVG drawn here is put
in as it is, and its text was escaped when it was drawn. People and simulated participants have
sections of their own, and simulated ones are called so in every heading, figure and file name.
"""

import dataclasses
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from evenhand.core import files
from evenhand.core.wording import NOT_DEFINED, percent
from evenhand.report import figure
from evenhand.report import page as html
from evenhand.report.table import Table, say
from evenhand.study.analysis import check_answers
from evenhand.study.analysis import figures as analysis_figures
from evenhand.study.analysis.analyse import Analysis, Part
from evenhand.study.analysis.answers import Answers, neutralised
from evenhand.study.analysis.codebook import codebook
from evenhand.study.analysis.listing import listing

TEXTS = 1000
"""Free answers in the page; all are in the file of answers."""
TABLES = {
    "ratings": "Ratings, both ways",
    "controls": "Scenarios against controls",
    "agreement": "Agreement",
    "pairs": "Pairs",
    "early": "Seen early, seen late",
    "places": "Order",
    "flags": "Flags",
    "others": "Answers about oneself, and to other questions",
}
"""Tables of a part in the page, in order; the figures have theirs under them."""


@dataclass(frozen=True)
class Source:
    """Where an analysis comes from."""

    answers: str
    command: str
    created: str


def write(found: Analysis, answers: Answers, source: Source, folder: Path) -> Path:
    """Write report, figures, tables and codebook; each file whole or not at all.

    Args:
        found: the analysis.
        answers: that were analysed.
        source: where they come from.
        folder: is made where it does not exist.

    Returns:
        The path of ``report.html``.
    """
    drawn = [(part, analysis_figures.draw_all(part, found)) for part in found.parts]
    page = render(found, source, drawn)
    data = files.make_folder(files.make_folder(folder) / "data")
    pictures = files.make_folder(folder / "figures")
    for part, some in drawn:
        safe = [dataclasses.replace(one, csv=csv_text(one.data)) for one in some]
        figure.write(pictures, safe)
        for name, table in part.tables.items():
            files.write_text(data / f"{part.kind}_{name}.csv", csv_text(table))
    files.write_json(
        folder / "codebook.json", codebook(answers, found.study if found.known else None)
    )
    files.write_json(folder / "manifest.json", manifest(found, source))
    target = folder / "report.html"
    files.write_text(target, page)
    return target


def manifest(found: Analysis, source: Source) -> dict[str, Any]:
    """What the analysis was made with, and whether any answer is simulated."""
    from evenhand import __version__

    return {
        "version": __version__,
        **dataclasses.asdict(source),
        "study": found.study.name if found.known else None,
        "fingerprint": found.study.fingerprint() if found.known else None,
        "simulated": any(part.kind == "simulated" for part in found.parts),
        "previews_left_out": found.previews,
        "answers_left_out": found.strange,
        "participants": {
            part.kind: part.statuses | {"flagged": part.flagged, "used": part.used}
            for part in found.parts
        },
        "settings": dataclasses.asdict(found.settings),
    }


def csv_text(table: Table) -> str:
    """A table as CSV with cells that no spreadsheet runs; an empty cell for what is not known."""
    columns = {
        name: pa.array(list(cells), from_pandas=True) for name, cells in table.columns.items()
    }
    out = io.BytesIO()
    pyarrow.csv.write_csv(neutralised(pa.table(columns)), out)
    return out.getvalue().decode()


def render(
    found: Analysis, source: Source, drawn: Sequence[tuple[Part, list[figure.Drawn]]]
) -> str:
    """The page as HTML.

    Args:
        found: the analysis.
        source: where it comes from.
        drawn: figures of each part.
    """
    return html.fill(
        "analysis.html.j2",
        Path(__file__).parent / "templates",
        manifest=manifest(found, source),
        title=found.study.title,
        known=found.known,
        facts=_facts(found, source),
        parts=[_part(part, some, found) for part, some in drawn],
        only_simulated=all(part.kind == "simulated" for part in found.parts),
        excluded=found.settings.exclude_flagged,
        strange=check_answers.told(found.strange),
        settings=html.flat(dataclasses.asdict(found.settings)),
        questions=[(one.id, one.ask, one.type, one.about) for one in found.study.questions],
        sets=[(one.id, one.kind, one.note or "no note") for one in found.study.sets],
    )


def _facts(found: Analysis, source: Source) -> list[tuple[str, str]]:
    counts = {part.kind: sum(part.statuses.values()) for part in found.parts}
    return [
        ("Written", source.created),
        ("Participants", f"{counts.get('people', 0):,}"),
        ("Simulated", f"{counts.get('simulated', 0):,}"),
        ("Previews, left out", f"{found.previews:,}"),
        ("Sets", f"{len(found.study.sets)}"),
        ("Seed", f"{found.settings.seed}"),
    ]


def _part(part: Part, drawn: list[figure.Drawn], found: Analysis) -> dict[str, Any]:
    flagged = [
        (part.quality.participants[who], "; ".join(part.quality.reasons(who)))
        for who in np.flatnonzero(part.quality.flagged).tolist()
    ]
    return {
        "kind": part.kind,
        "label": part.label,
        "facts": [
            ("Finished", f"{part.statuses['finished']:,}"),
            ("Begun, not finished", f"{part.statuses['begun']:,}"),
            ("Flagged", f"{part.flagged:,}"),
            ("In the results", f"{part.used:,}"),
            ("Median time", NOT_DEFINED if math.isnan(part.minutes) else f"{part.minutes:.1f} min"),
        ],
        "told": list(sentences(part, found)),
        "figures": [_figure(one, part, found) for one in drawn],
        "tables": [
            (name, f"{title}{' (simulated)' if part.kind == 'simulated' else ''}", table)
            for name, title in TABLES.items()
            if len(part.tables[name])
            for table in [listing(name, part.tables[name], found.settings.exclude_flagged)]
        ],
        "flagged": flagged[:TEXTS],
        "flagged_more": max(0, len(flagged) - TEXTS),
        "texts": part.texts[:TEXTS],
        "texts_all": len(part.texts),
    }


def _figure(one: figure.Drawn, part: Part, found: Analysis) -> dict[str, Any]:
    name = one.plate.name.removeprefix(f"{part.kind}_")
    shown = listing(name, one.data, found.settings.exclude_flagged)
    return html.figure_context(one) | {"listing": shown}


def sentences(part: Part, found: Analysis) -> list[str]:
    """What the part says, in a few sentences with their intervals."""
    who = "Simulated participants" if part.kind == "simulated" else "Participants"
    said = []
    for row in (
        part.tables["controls"].where(set="all").rows() if len(part.tables["controls"]) else ()
    ):
        if row["n"]:
            less = "less" if row["difference"] < 0 else "more"
            said.append(
                f"{who} rated scenarios {say(abs(row['difference']), 2)} points {less} fair than "
                f"even controls (difference {_interval(row, 'difference')}, p = "
                f"{_p(row['p'], row['permutations'])}, n = {row['n']:,})."
            )
    for row in part.tables["agreement"].rows():
        said.append(
            f"Agreement on the {row['answer']}: Krippendorff’s α = {_interval(row, 'alpha')}, "
            f"{row['sets']} sets, {row['answers']:,} answers."
        )
    for row in part.tables["places"].rows():
        if not row["place"].isdigit():
            said.append(
                f"From one set to the next ratings change by {_interval(row, 'mean')} points "
                f"(n = {row['n']:,})."
            )
    people = sum(part.statuses.values())
    way = "left out of the results" if found.settings.exclude_flagged else "in the results"
    said.append(
        f"{part.flagged:,} of {people:,} are flagged ({percent(part.flagged / people)}) and "
        f"{way}; ratings and agreement are shown both ways."
    )
    return said


def _interval(row: dict[str, Any], name: str) -> str:
    if math.isnan(row[name]):
        return NOT_DEFINED
    if math.isnan(row["low"]):
        return f"{say(row[name], 2)} (no interval)"
    return f"{say(row[name], 2)} [{say(row['low'], 2)}, {say(row['high'], 2)}]"


def _p(p: float, permutations: int) -> str:
    least = 1 / (permutations + 1)
    return f"{p:.2g}" if p > least else f"{least:.2g} or less"
