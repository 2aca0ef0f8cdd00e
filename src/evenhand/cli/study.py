"""``evenhand study check``, ``new``, ``preview``, ``serve``, ``backup`` and ``export``."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evenhand.cli.inputs import OPTIONAL
from evenhand.core import extras, files
from evenhand.core.errors import InputError, whole
from evenhand.study.design import protocol_file

if TYPE_CHECKING:
    from evenhand.study.design.protocol import Protocol
    from evenhand.study.server.store import Store
    from evenhand.study.server.web.desk import Settings

TOKEN = "EVENHAND_STUDY_TOKEN"
"""Environment variable with the lead's token."""
_FILE = arg(metavar="FILE", help_behavior_hint="(the paper's study)")
_DB = arg(metavar="DB", help_behavior_hint="(default: NAME.db, by the study's name)")
_FOLDER = arg(metavar="FOLDER", help_behavior_hint="(as the file says)")


@dataclass(frozen=True)
class StudyCheck:
    """Check a study's file: every mistake with its line, all of them at once.

    Ends with code 0 where the study can be served, 1 where only texts are still to be written, and
    2 where there are mistakes.

    For instance: evenhand study new my.toml, then: evenhand study check my.toml
    """

    file: Annotated[Positional[Path | None], _FILE] = None
    """TOML file of the study; the paper's if none."""

    clips: Annotated[Path | None, _FOLDER] = None
    """Folder of the clips, instead of the one that the file names."""

    def run(self, command: str) -> int:
        """Check and print."""
        from evenhand.study.design import orders

        path = self.file or protocol_file.PAPER
        study, wrong = protocol_file.examine(path, self.clips)
        if study is None:
            for mistake in wrong:
                print(f"evenhand: {path}, {mistake}", file=sys.stderr)
            return 2
        n = orders.count(study)
        todo = protocol_file.unfinished(study)
        texts = "1 text" if len(todo) == 1 else f"{len(todo)} texts"
        print(
            f"{path} "
            + (
                f"is complete but for {texts}, and the server does not start before"
                if todo
                else "can be served"
            )
            + f": {len(study.sets)} sets, {study.judged} for each participant, "
            f"{orders.length(study)} pages, {n or 'any number of'} "
            f"order{'' if n == 1 else 's'} of the sets, about {study.minutes} minutes"
        )
        for part in todo:
            print(f"to be written before anybody is asked: {' '.join(part.split())}")
        return 1 if todo else 0


@dataclass(frozen=True)
class StudyNew:
    """Write the paper's study as a file to start from.

    For instance: evenhand study new my.toml
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """TOML file to write; it must not be there yet."""

    def run(self, command: str) -> int:
        """Write."""
        if self.file.exists():
            raise InputError("duplicate file", f"{self.file} is there already: give another name")
        files.make_folder(self.file.parent)
        files.write_text(self.file, protocol_file.PAPER.read_text(encoding="utf-8"))
        print(self.file)
        return 0


@dataclass(frozen=True)
class StudyPreview:
    """Walk through a study in the browser; nothing is kept.

    For instance: evenhand study preview my.toml
    """

    file: Annotated[Positional[Path | None], _FILE] = None
    """TOML file of the study; the paper's if none."""

    clips: Annotated[Path | None, _FOLDER] = None
    """Folder of the clips, instead of the one that the file names."""

    port: int = 8000
    """To listen on; 0 is any free one."""

    host: str = "127.0.0.1"
    """Address to listen on; the default lets in this machine only."""

    def run(self, command: str) -> int:
        """Serve from memory."""
        extras.require("study", "this command")
        from evenhand.study.server import engines
        from evenhand.study.server.open_store import open_store

        study = protocol_file.read(self.file or protocol_file.PAPER, self.clips)
        settings, made = _settings(None, preview=True)
        kept = open_store(engines.MEMORY, study)
        return _serve(study, kept, settings, made, self.host, self.port)


@dataclass(frozen=True)
class StudyServe:
    """Run a study: participants answer in the browser, the lead has a dashboard.

    Answers go to a database, each at once. The same command goes on after a stop. No addresses and
    no browsers are stored or logged. Beyond this machine, put a server with HTTPS before it.

    For instance: evenhand study serve my.toml --db my.db
    """

    file: Annotated[Positional[Path | None], _FILE] = None
    """TOML file of the study; the paper's if none."""

    db: Annotated[str | None, _DB] = None
    """SQLite file, or postgresql://user:password@host/name; made if it is not there."""

    clips: Annotated[Path | None, _FOLDER] = None
    """Folder of the clips, instead of the one that the file names."""

    port: int = 8000
    """To listen on; 0 is any free one."""

    host: str = "127.0.0.1"
    """Address to listen on; the default lets in this machine only."""

    token_file: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """File with the admin token; else it is taken from EVENHAND_STUDY_TOKEN, or made and shown."""

    allow_simulated: bool = False
    """Let simulated participants in, for trial runs; their answers are marked for ever."""

    def run(self, command: str) -> int:
        """Serve."""
        extras.require("study", "this command")
        from evenhand.study.server.open_store import open_store

        path = self.file or protocol_file.PAPER
        study = protocol_file.read(path, self.clips)
        todo = protocol_file.unfinished(study)
        if todo and not self.allow_simulated:
            raise InputError(
                "missing file",
                f"{path} still has to be completed ({todo[0]}): nobody can agree to it yet; for a "
                "trial run with simulated participants add --allow-simulated",
            )
        settings, made = _settings(self.token_file, simulated=self.allow_simulated)
        kept = open_store(self.db or f"{study.name}.db", study)
        print(f"database: {kept.name}")
        return _serve(study, kept, settings, made, self.host, self.port)


@dataclass(frozen=True)
class StudyBackup:
    """Copy a study's database while it runs.

    The copy is one SQLite file, of PostgreSQL too, and can be served and exported itself.

    For instance: evenhand study backup --db my.db --out my-2026-05-01.db
    """

    db: Annotated[str, arg(metavar="DB")]
    """SQLite file, or postgresql://user:password@host/name."""

    out: Annotated[Path, arg(metavar="FILE")]
    """Where the copy goes; it must not be there yet."""

    def run(self, command: str) -> int:
        """Copy."""
        extras.require("study", "this command")
        from evenhand.study.server import backup
        from evenhand.study.server.open_store import open_store
        from evenhand.study.server.refusal import StorageError

        files.make_folder(self.out.parent)
        kept = open_store(self.db, None, make=False)
        try:
            print(backup.write(kept, self.out))
        except StorageError as error:
            raise InputError("unavailable database", f"{error}: try again") from error
        finally:
            kept.dispose()
        return 0


@dataclass(frozen=True)
class StudyExport:
    """Write the answers as tables, with a codebook beside them.

    Nothing in them identifies anybody, unless it is asked for by name. Ids of a recruiting
    platform go to a file of their own, NAME.external-ids.csv.

    For instance: evenhand study export my.toml --db my.db --out answers.csv answers.parquet
    """

    file: Annotated[Positional[Path | None], _FILE] = None
    """TOML file of the study; the paper's if none."""

    db: Annotated[str | None, _DB] = None
    """SQLite file, or postgresql://user:password@host/name."""

    out: Annotated[tuple[Path, ...], arg(metavar="FILE ...")] = (Path("answers.csv"),)
    """Files to write: .csv, .json or .parquet; the codebook is NAME.codebook.json."""

    with_external_ids: bool = False
    """Also write ids of a recruiting platform; they identify people."""

    with_previews: bool = False
    """Also the answers of previews."""

    exact_times: bool = False
    """When answers came, to the millisecond instead of the minute."""

    def run(self, command: str) -> int:
        """Write."""
        extras.require("study", "this command")
        from evenhand.study.server import export
        from evenhand.study.server.open_store import open_store

        path = self.file or protocol_file.PAPER
        study, wrong = protocol_file.examine(path, look=False)
        if study is None:
            raise InputError("format file", f"{path}, {wrong[0]}")
        for one in self.out:
            export.check_ending(one)
            files.make_folder(one.parent)
        kept = open_store(self.db or f"{study.name}.db", None, make=False)
        try:
            written = export.write(
                kept,
                study,
                self.out,
                previews=self.with_previews,
                external_ids=self.with_external_ids,
                exact_times=self.exact_times,
            )
        finally:
            kept.dispose()
        print(*written, sep="\n")
        return 0


def _settings(
    token_file: Path | None, *, simulated: bool = False, preview: bool = False
) -> tuple[Settings, str]:
    from evenhand.study.server.participants import hashed
    from evenhand.study.server.web.desk import Settings, admin_token

    token, made = admin_token(os.environ.get(TOKEN), token_file)
    return Settings(hashed(token), simulated, preview), token if made else ""


def _serve(
    study: Protocol, kept: Store, settings: Settings, made: str, host: str, port: int
) -> int:
    from evenhand.study.server.web import app, serve

    try:
        whole("port", port, 0, 65535)
        with serve.listen(host, port) as listening:
            at = serve.address(listening)
            print(f"the study, for participants: {at}/")
            print(f"the dashboard, for the lead: {at}/lead")
            if made:
                print(f"admin token, shown this once: {made}")
            if settings.preview:
                print("a preview: answers are kept in memory only, and gone when this ends")
            sys.stdout.flush()
            serve.run(app.build(study, kept, settings), listening)
    finally:
        kept.dispose()
    return 0
