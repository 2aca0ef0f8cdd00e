"""Databases that cannot be used, that are busy, full or old; copies of running ones."""

import os
import pwd
import sqlite3
import tempfile
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import text

from evenhand.core.errors import InputError
from evenhand.study.design.protocol import Protocol
from evenhand.study.server import backup, engines, migrate, participants, progress, rows, schema
from evenhand.study.server.open_store import open_store
from evenhand.study.server.participants import Sent, hashed
from evenhand.study.server.refusal import StorageError
from support.refusals import refused as input_refused
from support.studies import ANSWERS, STUDY, Clock, pragma

SECRET = "a sentence that must not survive"


@pytest.fixture
def db(tmp_path) -> Path:
    return tmp_path / "study.db"


@pytest.fixture
def kept(db):
    one = open_store(str(db), STUDY, clock=Clock(), wait=0.1)
    yield one
    one.dispose()


def begin(kept, **more):
    return participants.begin(kept, STUDY, "1", **more)[0]


def put(kept, token, why="x" * 40):
    page = participants.state(kept, STUDY, token).next
    values = {**ANSWERS, "end": {"why": why}}[page.partition(":")[0]]
    participants.save(kept, STUDY, token, page, Sent(page, 1, values, 5))


def go(kept, token, why=""):
    while participants.state(kept, STUDY, token).next != "finished":
        put(kept, token, why)


def refused(db, study: Protocol | None = STUDY, **more) -> str:
    with pytest.raises(InputError) as error:
        open_store(str(db), study, wait=0.1, **more)
    return str(error.value)


def test_answers_are_on_the_disk_when_they_are_acknowledged(kept):
    names = ("journal_mode", "synchronous", "foreign_keys", "secure_delete")
    asked = [pragma(kept, name) for name in names]
    assert asked == ["wal", 2, 1, 1]  # 2 is FULL


def test_a_study_goes_on_in_the_same_database(kept, db):
    token = begin(kept)
    put(kept, token)
    again = open_store(str(db), STUDY)
    assert participants.state(again, STUDY, token).answered == {"consent": 0, "about": 1}
    again.dispose()


def test_tokens_are_stored_as_hashes_only(kept, db):
    token = begin(kept)
    kept.dispose()
    content = db.read_bytes()
    assert token.encode() not in content
    assert hashed(token).encode() in content


def test_what_was_withdrawn_is_not_left_in_the_file(kept, db):
    token = begin(kept, ids={"PROLIFIC_PID": "person-0815"})
    go(kept, token, SECRET)

    def left() -> bytes:
        return b"".join(path.read_bytes() for path in db.parent.glob("study.db*"))

    assert SECRET.encode() in left()
    participants.withdraw(kept, token)
    assert SECRET.encode() not in left()
    assert b"person-0815" not in left()


# --- databases that cannot be used ---


def test_databases_that_are_none(db, tmp_path):
    (tmp_path / "x.db").write_text("a,b\n1,2\n" * 10)
    assert "is no SQLite database" in refused(tmp_path / "x.db")
    assert "does not exist: give the database of a study" in refused(tmp_path / "no" / "x.db")
    assert "does not exist" in refused(db, None, make=False)
    assert not db.exists()
    assert "cannot be written (Is a directory)" in refused(tmp_path)
    (tmp_path / "empty.db").touch()
    assert "holds no study" in refused(tmp_path / "empty.db", None, make=False)


@pytest.mark.parametrize(
    ("db", "said"),
    [
        ("mysql://u:pw@h/x", "a database of kind 'mysql': give the name of an SQLite file"),
        ("://", "--db is no address of a database"),
    ],
)
def test_addresses_that_are_none(db, said):
    assert said in refused(db)


@pytest.mark.parametrize("address", ["postgres://u:pw@h/x", "postgresql://u:pw@h/x"])
def test_a_shown_address_has_no_password(address):
    assert engines.shown(engines.address(address)) == "postgresql://u:***@h/x"


def test_a_database_that_is_read_only():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        open_store(str(folder / "s.db"), STUDY).dispose()
        (folder / "s.db").chmod(0o444)
        root = os.geteuid() == 0
        if root:
            os.seteuid(pwd.getpwnam("nobody").pw_uid)  # root may write to everything
        try:
            assert "cannot be written (Permission denied)" in refused(folder / "s.db")
        finally:
            if root:
                os.seteuid(0)


def test_a_database_that_becomes_read_only_while_it_runs(kept):
    token = begin(kept)
    pragma(kept, "query_only=ON")
    with pytest.raises(StorageError, match="attempt to write a readonly database"):
        put(kept, token)
    pragma(kept, "query_only=OFF")
    put(kept, token)


def test_a_full_database_loses_nothing(kept):
    token = begin(kept)
    put(kept, token)
    pragma(kept, f"max_page_count={pragma(kept, 'page_count')}")

    def fill() -> None:
        for _ in range(1000):
            begin(kept)

    with pytest.raises(StorageError, match=r"study\.db cannot store or read: database or disk is"):
        fill()
    state = participants.state(kept, STUDY, token)
    assert state.answered == {"consent": 0, "about": 1}
    pragma(kept, "max_page_count=100000")
    go(kept, token)


def test_a_locked_database_is_waited_for_and_told(kept, db):
    token = begin(kept)
    with closing(sqlite3.connect(db, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StorageError, match="database is locked"):
            put(kept, token)
        # reading goes on
        assert participants.state(kept, STUDY, token).next == "about"
        assert "locked" in refused(db)
        other.execute("ROLLBACK")
    put(kept, token)


def test_another_study_and_a_changed_one_need_another_database(kept, db):
    assert "belongs to the study 'tiny', not to 'other'" in refused(
        db, replace(STUDY, name="other")
    )
    changed = replace(STUDY, consent="You agree to more.")
    begin(kept, preview=True)
    open_store(str(db), changed).dispose()  # nobody real has begun
    open_store(str(db), STUDY).dispose()
    begin(kept)
    assert "holds 1 participants of 'tiny' as it was before" in refused(db, changed)
    open_store(str(db), replace(STUDY, thanks="Thank you very much.")).dispose()


def test_previews_go_when_the_study_is_changed(kept, db):
    """Their answers may be none that the changed questions have."""
    go(kept, begin(kept, preview=True))
    assert progress.read(kept, STUDY)["preview"]["counts"]["began"] == 1
    fair, *others = STUDY.questions
    shorter = replace(STUDY, questions=(replace(fair, points=2), *others))
    again = open_store(str(db), shorter)
    assert progress.read(again, shorter)["preview"]["counts"]["began"] == 0
    assert not list(rows.read(again, previews=True))
    again.dispose()


def test_a_value_that_a_question_does_not_have_is_in_no_number(kept):
    go(kept, begin(kept, preview=True))
    with kept.write() as connection:
        connection.execute(text("UPDATE study_answers SET value = '9' WHERE question = 'fair'"))
    told = progress.read(kept, STUDY)["preview"]["agreement"]
    assert next(one for one in told if one["question"] == "fair") == {
        "question": "fair", "alpha": None, "answers": 0
    }  # fmt: skip


# --- other versions ---


def test_a_newer_database_is_left_alone(kept, db):
    with kept.write() as connection:
        connection.execute(text("UPDATE study_about SET value = '2' WHERE key = 'version'"))
    before = db.read_bytes()
    assert "written by a newer Evenhand (tables of version 2, this one knows 1)" in refused(db)
    assert db.read_bytes() == before


def test_a_damaged_version_is_told(kept, db):
    with kept.write() as connection:
        connection.execute(text("UPDATE study_about SET value = 'x' WHERE key = 'version'"))
    assert "without a version: it is damaged" in refused(db)


@pytest.fixture
def later(monkeypatch):
    """An Evenhand that is two versions further."""

    def one(connection):
        connection.execute(text("ALTER TABLE study_participants ADD COLUMN mood TEXT"))

    def two(connection):
        connection.execute(text("UPDATE study_participants SET mood = 'well'"))

    monkeypatch.setattr(schema, "VERSION", 3)
    monkeypatch.setattr(migrate, "STEPS", {1: one, 2: two})


def test_an_older_database_is_brought_up_to_date_after_a_backup(db, request):
    first = open_store(str(db), STUDY)
    token = begin(first)
    put(first, token)
    first.dispose()
    request.getfixturevalue("later")
    second = open_store(str(db), STUDY)
    with second.read() as connection:
        assert connection.scalar(text("SELECT mood FROM study_participants")) == "well"
        assert migrate.version(connection) == 3
    go(second, token)
    second.dispose()
    old = db.with_name("study.db.version1.backup")
    with closing(sqlite3.connect(old)) as copy:
        columns = [row[1] for row in copy.execute("PRAGMA table_info(study_participants)")]
        assert "mood" not in columns
        assert copy.execute("SELECT count(*) FROM study_answers").fetchone() == (1,)


def test_a_failed_step_changes_nothing(db, request, monkeypatch):
    open_store(str(db), STUDY).dispose()
    request.getfixturevalue("later")

    def broken(connection):
        connection.execute(text("UPDATE study_participants SET no_such_column = 1"))

    monkeypatch.setattr(migrate, "STEPS", {**migrate.STEPS, 2: broken})
    with input_refused("unavailable database"):
        open_store(str(db), STUDY)
    with closing(sqlite3.connect(db)) as one:
        assert one.execute("SELECT value FROM study_about WHERE key='version'").fetchone() == ("1",)
        columns = [row[1] for row in one.execute("PRAGMA table_info(study_participants)")]
        assert "mood" not in columns


def test_a_version_that_nobody_knows_any_more(db, request, monkeypatch):
    open_store(str(db), STUDY).dispose()
    request.getfixturevalue("later")
    monkeypatch.setattr(migrate, "STEPS", {2: migrate.STEPS[2]})
    assert "has tables of version 1, which this Evenhand can no longer bring" in refused(db)


# --- backups ---


def test_a_backup_of_a_running_study_can_go_on_itself(kept, tmp_path):
    token = begin(kept)
    put(kept, token)
    copy = backup.write(kept, tmp_path / "copy.db")
    go(kept, token)
    assert sorted(path.name for path in tmp_path.glob("copy*")) == ["copy.db"]
    again = open_store(str(copy), STUDY)
    assert len(list(rows.read(again))) == 1
    go(again, token)
    told = [[(r["page"], r["value"]) for r in rows.read(one)] for one in (kept, again)]
    assert told[0] == told[1]
    again.dispose()


def test_a_backup_overwrites_nothing_and_is_whole_or_absent(kept, tmp_path):
    (tmp_path / "there.db").write_text("thesis")
    with input_refused("duplicate file"):
        backup.write(kept, tmp_path / "there.db")
    with input_refused("unavailable file"):
        backup.write(kept, tmp_path / "no" / "copy.db")
    assert not list(tmp_path.glob(".*"))
