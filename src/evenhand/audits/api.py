"""``evenhand.audit``: a log in, findings with their words, tables, figures and card out."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenhand.audits.count.count import tally
from evenhand.audits.count.tally import Tally
from evenhand.audits.judge.findings import find
from evenhand.audits.judge.results import AuditSettings, Findings
from evenhand.audits.read.guess_columns import guess
from evenhand.audits.read.mapping import Mapping, describe
from evenhand.audits.read.mapping_file import from_toml
from evenhand.audits.read.sources import Source, open_source
from evenhand.audits.show import rows as forms
from evenhand.audits.show import sentences
from evenhand.audits.show.wording import About, meanings
from evenhand.core import files
from evenhand.core.errors import InputError, unknown
from evenhand.core.frames import data_frame
from evenhand.core.wording import joined
from evenhand.methods import detector_file

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from matplotlib.figure import Figure

SYNTHETIC_COLUMN, SYNTHETIC = "source", "synthetic"
"""A log whose column says so in every row is called synthetic wherever it is shown."""


@dataclass(frozen=True, repr=False)
class Audit:
    """A finished audit.

    Attributes:
        findings: every number.
        about: the log, and how it was read.
        mapping: columns and the roles they play.
    """

    findings: Findings
    about: About
    mapping: Mapping

    @property
    def warnings(self) -> tuple[str, ...]:
        """What looks odd in the log, a sentence each."""
        return self.about.doubts

    @property
    def services(self) -> int:
        """How many were audited."""
        return self.findings.services

    @property
    def verdict(self) -> str:
        """Of the whole log: disparity, no evidence, or insufficient data."""
        return self.findings.verdict

    @property
    def disparities(self) -> tuple[Any, ...]:
        """The findings that are disparities, the largest first."""
        listed = sorted(self.findings.findings, key=forms.importance)
        return tuple(one for one in listed if one.verdict == "disparity")

    @property
    def table(self) -> pa.Table:
        """A row for each group and issue; ``.to_pandas()`` makes a data frame of it."""
        return _arrow(forms.rows(self.findings), forms.COLUMNS)

    @property
    def frame(self) -> pd.DataFrame:
        """``table`` as a data frame of pandas."""
        return data_frame(self.table.to_pylist())

    def plot(self, identity: str | None = None) -> Figure:
        """``figure`` of an identity, by default of the first one."""
        from evenhand.audits.show import figures

        return self.figure(identity or figures.identities(self.findings)[0])

    def __repr__(self) -> str:
        return f"Audit of {self.about.title}: {self.services:,} services, {self.verdict}"

    @property
    def waits(self) -> pa.Table:
        """A row for each group: how long it waits, non-response censored."""
        return _arrow(forms.wait_rows(self.findings), forms.WAIT_COLUMNS)

    @property
    def measures(self) -> pa.Table:
        """A row for each further measure and group."""
        return _arrow(forms.measure_rows(self.findings), forms.MEASURE_COLUMNS)

    @property
    def summary(self) -> str:
        """The audit in plain words."""
        return sentences.text(sentences.summary(self.findings, self.about))

    @property
    def card(self) -> str:
        """One HTML page that needs nothing else."""
        # what draws takes a second to load: an audit in the terminal does without
        from evenhand.audits.show import card

        return card.render(self.findings, self.about)

    def figure(self, identity: str) -> Figure:
        """Differences of the groups of an identity with their intervals, a panel an issue.

        Raises:
            InputError: for an identity that was not audited.
        """
        from evenhand.audits.show import figures
        from evenhand.report import style

        known = figures.identities(self.findings)
        if identity not in known:
            raise unknown("identity", identity, known)
        with style.drawing():
            return figures.differences(self.findings, identity)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the card (.html), everything (.json), or groups and issues (.csv).

        Raises:
            InputError: for another ending, or when the file cannot be written.
        """
        target = Path(path)
        check_ending(target)
        if target.suffix == ".html":
            content = self.card
        elif target.suffix == ".csv":
            content = forms.csv_text(forms.rows(self.findings))
        else:
            plain = forms.plain(self.findings, self.about)
            content = json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        files.write_text(target, content)
        return target

    def _repr_html_(self) -> str:
        """In a notebook: the card in a frame of its own, so that styles do not mix."""
        from html import escape

        return (
            f'<iframe title="Audit of {escape(self.about.title)}" srcdoc="{escape(self.card)}" '
            'style="width:100%;height:640px;border:1px solid #999"></iframe>'
        )


ENDINGS = (".html", ".json", ".csv")


def check_ending(path: Path) -> None:
    """Check that an audit can be written under this name.

    Raises:
        InputError: for another ending than those of ``ENDINGS``.
    """
    if path.suffix not in ENDINGS:
        raise InputError(
            "unknown file",
            f"{path} ends in none of {', '.join(ENDINGS)}: choose what to write by it",
        )


def audit(
    source: object,
    mapping: Mapping | str | os.PathLike[str] | None = None,
    settings: AuditSettings | None = None,
    *,
    table: str | None = None,
    detector: str | os.PathLike[str] | None = None,
    command: str = "",
    **roles: Any,
) -> Audit:
    """Audit a log of services.

    Args:
        source: path of a file, folder or glob; URL of a database; a data frame of pandas, polars
            or pyarrow, or anything else that gives an Arrow stream; or Services.
        mapping: roles of the columns, or a TOML file of them; what it leaves open is found by name.
        settings: level, relevant difference, permutations, seed.
        table: in a database, which.
        detector: file of a detector, as of `evenhand study fit`; by default the one that comes
            with Evenhand, which learned from simulated respondents.
        command: shown as what repeats the audit.
        **roles: single fields of ``Mapping`` in place of a mapping, for instance
            ``identities=("gender",)``.

    Returns:
        The audit; ``.verdict``, ``.table``, ``.figure(identity)``, ``.save("card.html")``.

    Raises:
        InputError: when the log cannot be read or is not what it should be.
    """
    judge = None if detector is None else detector_file.load(Path(detector))
    log = open_source(source, table)
    if "url" in log.description:  # without its password
        for written in (shlex.quote, str):
            command = command.replace(written(str(source)), written(log.description["url"]))
    try:
        chosen = mapping_for(log, mapping, roles)
        counts, warnings = tally(log, chosen)
        synthetic = _synthetic(log)
    finally:
        log.close()
    judged = replace(settings or AuditSettings(), depth=chosen.depth)
    found = find(counts, judged, judge)
    said = command or _call(log, chosen, judged, detector)
    about = _about(log, chosen, counts, said, synthetic, warnings)
    if judge is not None and detector is not None:
        # nobody may take programs for people
        about = replace(about, judges=f"{judge.source} ({Path(detector).name})")
    return Audit(found, about, chosen)


def mapping_for(
    log: Source, mapping: Mapping | str | os.PathLike[str] | None, roles: dict[str, Any]
) -> Mapping:
    """What was said of the columns, completed by their names.

    Raises:
        InputError: for a role that does not exist, or a column that does not.
    """
    names = [field.name for field in dataclasses.fields(Mapping)]
    for name in roles:
        if name not in names:
            raise unknown("role", name, names)
    if mapping is not None and not isinstance(mapping, Mapping):
        mapping = from_toml(mapping)
    said = replace(mapping or Mapping(), **roles)
    found = guess(log.table.columns, said)
    if not found.identities:
        raise InputError(
            "missing identities",
            f"{log.name} has no column that looks like an identity among "
            f"{joined(list(log.table.columns))}: name those that tell who was served",
        )
    return found


def _about(
    log: Source,
    mapping: Mapping,
    counts: Tally,
    command: str,
    synthetic: bool,
    doubts: Sequence[str],
) -> About:
    waits = counts.waits
    return About(
        title=log.name,
        log=log.description | {"services": counts.services},
        mapping=describe(mapping),
        command=command,
        synthetic=synthetic,
        doubts=tuple(doubts),
        left_out=tuple(_left_out(mapping, waits is not None)),
        meanings=meanings(mapping.thresholds, mapping.late),
        within=joined(list(mapping.within)) if mapping.within else "",
        late=waits.seconds * waits.late if waits is not None else math.nan,
    )


def _call(
    log: Source,
    mapping: Mapping,
    settings: AuditSettings,
    detector: str | os.PathLike[str] | None = None,
) -> str:
    told = log.description
    lasts = "files" in told or "url" in told
    source = repr(told.get("url", log.name)) if lasts else "log"
    table = f", table={told['table']!r}" if lasts and "table" in told else ""
    judge = "" if detector is None else f", detector={os.fspath(detector)!r}"
    return f"evenhand.audit({source}, {_made(mapping)}, {_made(settings)}{table}{judge})"


def _made(chosen: Mapping | AuditSettings) -> str:
    usual = type(chosen)()
    said = {field.name: getattr(chosen, field.name) for field in dataclasses.fields(chosen)}
    parts = [f"{name}={one!r}" for name, one in said.items() if one != getattr(usual, name)]
    return f"{type(chosen).__name__}({', '.join(parts)})"


_NEEDS = {
    "willingness": "whether the robot responded",
    "quality": "the distance of the response",
    "priority": "the time until the response",
    "risk": "the least distance of the whole service",
}


def _left_out(mapping: Mapping, waiting: bool) -> Sequence[str]:
    said = [f"{issue}: no column tells {_NEEDS[issue]}" for issue in mapping.missing]
    return said if waiting else [*said, "waiting: no column tells how long people waited"]


def _synthetic(log: Source) -> bool:
    if SYNTHETIC_COLUMN not in log.table.columns:
        return False
    column = log.table[SYNTHETIC_COLUMN]
    sources = log.fetch(log.table.query({"source": column}, f"group by {column} limit 2"))
    return sources["source"].to_pylist() == [SYNTHETIC]


def _arrow(rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> pa.Table:
    import pyarrow as pa

    return pa.table({name: [row[name] for row in rows] for name in columns})
