"""``evenhand audit``."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from evenhand.core import files
from evenhand.core.errors import InputError

if TYPE_CHECKING:
    from evenhand.audits.read.mapping import Mapping

_COLUMN = arg(metavar="COLUMN", help_behavior_hint="(found by name)")
_GIVEN = "(required)"
_COLUMNS = arg(metavar="COLUMN ...", help_behavior_hint="(optional)")
FOUND = 3
"""Exit code when what ``--fail-on`` names was found."""


def _limit(paper: str) -> Any:
    """A limit of the issues; the file of --map may say another one."""
    return arg(metavar="FLOAT", help_behavior_hint=f"(default: {paper}, as in the paper)")


@dataclass(frozen=True)
class Columns:
    """Which columns of a log play which role; what is not named is found by its usual name."""

    table: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(optional)")] = None
    """In a database or a DuckDB file: which table."""

    map: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """TOML file with the roles below as keys, [bins] and [thresholds]; options go before it."""

    identities: Annotated[
        tuple[str, ...], arg(metavar="COLUMN ...", help_behavior_hint="(found by name)")
    ] = ()
    """Who was served: any columns; a missing value is the group unknown."""

    bins: Annotated[
        tuple[str, ...], arg(metavar="COLUMN=A,B ...", help_behavior_hint="(optional)")
    ] = ()
    """Cut an identity of numbers into groups: age=18,65."""

    responded: Annotated[str | None, _COLUMN] = None
    """Whether the robot responded: yes or no, in the usual spellings."""

    response_time: Annotated[str | None, _COLUMN] = None
    """Time from the request to the response, a number."""

    asked_at: Annotated[str | None, _COLUMN] = None
    """When it was requested; with --answered-at instead of --response-time."""

    answered_at: Annotated[str | None, _COLUMN] = None
    """When it was responded."""

    waited: Annotated[str | None, _COLUMN] = None
    """How long people waited who got no response."""

    response_distance: Annotated[str | None, _COLUMN] = None
    """Distance of the response."""

    min_distance: Annotated[str | None, _COLUMN] = None
    """Least distance of the whole service."""

    time_unit: Annotated[
        Literal["s", "ms", "min", "steps"] | None,
        arg(metavar="s|ms|min|steps", help_behavior_hint="(by name, else s)"),
    ] = None
    """Of times that are numbers; steps are 0.02 s."""

    distance_unit: Annotated[
        Literal["m", "cm", "mm", "ft", "in"] | None,
        arg(metavar="m|cm|mm|ft|in", help_behavior_hint="(by name, else m)"),
    ] = None
    """Of distances."""

    measures: Annotated[tuple[str, ...], _COLUMNS] = ()
    """Further numbers to compare by mean and median."""

    within: Annotated[tuple[str, ...], _COLUMNS] = ()
    """Compare only within these, a site or a day, so that unlike ones are not mixed."""

    nearest: Annotated[float | None, _limit("1.0")] = None
    """Least proper distance of a response, metres."""

    farthest: Annotated[float | None, _limit("1.5")] = None
    """Greatest proper distance of a response, metres."""

    late: Annotated[float | None, _limit("4.0")] = None
    """Seconds after which a response is late."""

    risk: Annotated[float | None, _limit("0.5")] = None
    """Distance below which any moment is too close, metres."""

    def mapping(self) -> Mapping:
        """As far as it was said, in a file or by options."""
        from evenhand.audits.read.mapping import STEP, Mapping, limits
        from evenhand.audits.read.mapping_file import from_toml

        base = from_toml(self.map) if self.map is not None else Mapping()
        names = ("identities", "responded", "response_time", "asked_at", "answered_at", "waited",
                 "response_distance", "min_distance", "time_unit", "distance_unit", "measures",
                 "within")  # fmt: skip
        given = {name: getattr(self, name) for name in names if getattr(self, name)}
        noted = {
            "nearest": base.thresholds.nearest,
            "farthest": base.thresholds.farthest,
            "late": float(base.thresholds.late * STEP),
            "risk": base.thresholds.risk,
        }
        said = {name: getattr(self, name) for name in noted if getattr(self, name) is not None}
        if said:
            given["thresholds"] = limits(**noted | said)
        bins = {**base.bins, **dict(_bin(text) for text in self.bins)}
        return replace(base, bins=bins, **given)


@dataclass(frozen=True)
class Audit(Columns):
    """Audit the log of any service robot: are groups of people served unevenly?

    A row of the log is a service. Its columns are found by their usual names, and shown; name them
    where that fails. Every group and issue gets its rate, its difference against everybody else
    with an interval, an adjusted p-value and a verdict: disparity, no evidence, or insufficient
    data. The log itself is never changed, and nothing of it leaves this machine.

    To try it: evenhand example fleet.csv, then evenhand audit fleet.csv --out card.html
    """

    log: Positional[Annotated[str, arg(metavar="LOG", help_behavior_hint=_GIVEN)]] = ""
    """File, folder or glob of CSV, TSV, JSON Lines, Parquet, Arrow or DuckDB; or the URL of a
    database, as postgres://reader@host/fleet."""

    depth: Annotated[int | None, arg(metavar="INT", help_behavior_hint="(default: 1)")] = None
    """Combine so many identities too: 2 adds groups such as "child × female". At most 3."""

    out: Annotated[tuple[Path, ...], arg(metavar="FILE ...", help_behavior_hint="(optional)")] = ()
    """Write a card (.html), everything (.json), or groups and issues (.csv); several at once."""

    alpha: float = 0.05
    """Greatest chance of any false disparity in a log that is even."""

    delta: float = 0.1
    """Relevant difference of rates: "no evidence" means that so much would have been found."""

    power: float = 0.8
    """The chance with which it would."""

    permutations: int = 2000
    """Random exchanges of outcomes among people that the p-values are taken from."""

    seed: int = 0
    """Of these."""

    detector: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """JSON of a detector, as of `evenhand study fit`, that is asked which discrimination the log
    resembles; else the one that comes with Evenhand, of simulated respondents."""

    fail_on: Literal["nothing", "disparity", "insufficient"] = "nothing"
    """For pipelines: end with exit code 3 on a disparity; or on that, and where no comparison has
    enough services."""

    def run(self, command: str) -> int:
        """Audit, write, print."""
        if not self.log:
            raise InputError(
                "missing log", "no log is given: name a file, a folder or the URL of a database"
            )
        from evenhand.audits import api
        from evenhand.audits.judge.results import AuditSettings
        from evenhand.audits.read import sources
        from evenhand.audits.show import rows as forms
        from evenhand.audits.show import sentences
        from evenhand.core import terminal
        from evenhand.statistics.verdicts import VerdictSettings

        for path in self.out:
            api.check_ending(path)
            sources.check_target(self.log, path)
            files.make_folder(path.parent)
        settings = AuditSettings(
            VerdictSettings(self.alpha, self.delta, self.power, self.permutations),
            seed=self.seed,
        )
        mapping = self.mapping()
        if self.depth is not None:
            mapping = replace(mapping, depth=self.depth)
        found = api.audit(
            self.log,
            mapping,
            settings,
            table=self.table,
            detector=self.detector,
            command=self.words(),
        )
        for sentence in (*found.about.left_out, *found.warnings):
            print(f"note: {sentence}", file=sys.stderr)
        terminal.table(
            f"{found.services:,} services of {found.about.title}, read as",
            ("role", "column", "unit"),
            found.about.mapping,
        )
        heads, rows = forms.terminal(found.findings)
        terminal.table("Groups and issues, disparities first", heads, rows)
        print(sentences.text(sentences.summary(found.findings, found.about)))
        for path in self.out:
            print(found.save(path))
        return FOUND if self._fails(found.verdict) else 0

    def words(self) -> str:
        """The command for a shell, with every option that is not the default."""
        said = ["evenhand", "audit", self.log]
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "log" and value != field.default:
                several = value if isinstance(value, tuple) else (value,)
                said += [f"--{field.name.replace('_', '-')}", *map(str, several)]
        return shlex.join(said)

    def _fails(self, verdict: str) -> bool:
        if self.fail_on == "nothing":
            return False
        return verdict == "disparity" or (
            self.fail_on == "insufficient" and verdict == "insufficient data"
        )


def _bin(text: str) -> tuple[str, tuple[float, ...]]:
    """``age=18,65`` as a column and its edges."""
    name, mark, edges = text.rpartition("=")
    try:
        if not mark or not name:
            raise ValueError
        return name, tuple(float(edge) for edge in edges.split(","))
    except ValueError:
        raise InputError(
            "format bins", f"bins {text!r}: give a column and rising numbers, as age=18,65"
        ) from None
