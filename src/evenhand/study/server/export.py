"""Stored answers as files, with a codebook, and ids of a platform apart."""

from collections.abc import Sequence
from pathlib import Path

from sqlalchemy import select

from evenhand.core import csv_file, files
from evenhand.core.errors import InputError
from evenhand.study.analysis import answers, codebook
from evenhand.study.design.protocol import Protocol
from evenhand.study.server import rows
from evenhand.study.server.refusal import StorageError
from evenhand.study.server.schema import external, participants
from evenhand.study.server.store import Store, read_note


def check_ending(path: Path) -> None:
    """Check that answers can be written in this format."""
    if path.suffix not in answers.ENDINGS:
        raise InputError(
            "format file", f"{path} does not end in {', '.join(answers.ENDINGS)}: give such a file"
        )


def write(
    store: Store,
    study: Protocol,
    paths: Sequence[Path],
    *,
    previews: bool = False,
    external_ids: bool = False,
    exact_times: bool = False,
) -> list[Path]:
    """Write the answers, and a codebook beside the first file.

    Args:
        store: where from.
        study: whose answers they are.
        paths: by ``check_ending``.
        previews: also those of previews.
        external_ids: also a table of participants and their ids on a platform.
        exact_times: milliseconds instead of minutes.

    Returns:
        All files written.

    Raises:
        InputError: when the database is of another study, of this one as it was before a change,
            or cannot be read, or a file cannot be written.
    """
    try:
        with store.read() as connection:
            there = read_note(connection, "study")
            print_ = read_note(connection, "fingerprint")
        if there != study.name:
            raise InputError(
                "conflict study", f"{store.name} holds the study {there!r}, not {study.name!r}"
            )
        if print_ != study.fingerprint():
            raise InputError(
                "changed study",
                f"{store.name} holds answers to {study.name!r} as it was before its questions, "
                "sets or consent were changed: give the file that was served",
            )
        found = rows.read(store, previews=previews, exact_times=exact_times)
        table = answers.Answers.of_rows(found)
        ids = _external(store, previews) if external_ids else ""
    except StorageError as error:
        raise InputError("unavailable database", f"{error}: try again") from error
    for path in paths:
        answers.write(table, path)
    about = paths[0].with_suffix(".codebook.json")
    files.write_json(about, codebook.codebook(table, study))
    written = [*paths, about]
    if external_ids:
        apart = paths[0].with_suffix(".external-ids.csv")
        files.write_text(apart, ids)
        written.append(apart)
    return written


def _external(store: Store, previews: bool) -> str:
    asked = select(external, participants.c.preview).join(participants).order_by(external.c[0])
    with store.read() as connection:
        found = connection.execute(asked).mappings().all()
    names = ("participant", *rows.EXTERNAL.values())
    shown = ([row[name] for name in names] for row in found if previews or not row["preview"])
    return csv_file.text_of(["participant", *rows.EXTERNAL], shown)
