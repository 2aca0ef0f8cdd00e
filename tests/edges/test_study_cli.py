"""`evenhand study`: files that cannot be right, and the way from a template to tables."""

import json
import re
import sys

import pyarrow.parquet as pq
import pytest

from evenhand.core.extras import install
from evenhand.study.design import protocol_file
from evenhand.study.server import participants
from evenhand.study.server.open_store import open_store
from support.studies import FILM, Browser, served

FILLED = re.compile(r"\[\[(?!(?:sets|demographics|questions|checks|pairs)\]\])[^\[\]]+\]\]")


@pytest.fixture
def file(tmp_path):
    """The paper's study, completed, with clips that nobody plays."""
    path = tmp_path / "my.toml"
    path.write_text(FILLED.sub("Dr Who", protocol_file.PAPER.read_text()))
    study, wrong = protocol_file.examine(path, look=False)
    assert study is not None, wrong
    study.clips.mkdir()
    for name in study.clip_names:
        (study.clips / name).write_bytes(FILM)
    return path


@pytest.fixture
def answered(file, tmp_path):
    """Its database, with one participant who finished and one preview."""
    study = protocol_file.read(file)
    app, kept = served(tmp_path / "paper.db", study)
    for more in ({"external": {"PROLIFIC_PID": "pid0815", "STUDY_ID": "s"}}, {"preview": True}):
        browser = Browser(app)
        told = browser("POST", "/api/begin", json={"consent_version": "template-1", **more})
        browser.headers["authorization"] = f"Bearer {told.json()['token']}"
        for page in told.json()["state"]["pages"][1:-1]:
            values = {}
            for one in page["questions"]:
                given = {"scale": 3, "text": "=1+1"}
                values[one["id"]] = given.get(one["type"]) or one["options"][1]["value"]
            assert browser.put(page["id"], values).status_code == 200
        browser("POST", "/api/finish", json={})
    kept.dispose()
    return tmp_path / "paper.db"


# --- check and new ---


def test_from_a_template_to_a_study(cli, tmp_path, file):
    assert cli("study", "new", "new/a.toml").out == "new/a.toml\n"
    assert (tmp_path / "new" / "a.toml").read_text() == protocol_file.PAPER.read_text()
    assert "is there already: give another name" in cli("study", "new", "new/a.toml").complaint
    # the template has no clips beside it, and everything is still to be written
    shown = cli("study", "check", "new/a.toml")
    assert (shown.code, shown.out) == (2, "")
    lines = shown.err.splitlines()
    assert len(lines) == 8
    assert all(
        re.match(r"evenhand: new/a\.toml, line \d+, sets \d\.clips: clip-", x) for x in lines
    )
    shown = cli("study", "check", "new/a.toml", "--clips", "clips")
    # it is what `study serve` refuses, and the pages say "Page 1 of 14"
    assert (shown.code, shown.err) == (1, "")
    first, *todo = shown.out.splitlines()
    assert len(todo) > 3
    assert first.startswith(f"new/a.toml is complete but for {len(todo)} texts, and the server")
    assert "8 sets, 8 for each participant, 14 pages, 8 orders of the sets" in first
    assert todo[0] == "to be written before anybody is asked: [[name of the lead]]"
    assert (
        "has to be completed" in cli("study", "serve", "new/a.toml", "--clips", "clips").complaint
    )
    shown = cli("study", "check", file)
    assert (shown.code, shown.err, shown.out.count("\n")) == (0, "", 1)
    assert "my.toml can be served: " in shown.out


def test_the_papers_study_has_no_place_for_clips(cli):
    shown = cli("study", "check")
    assert shown.code == 2
    package = str(protocol_file.PAPER.parent)
    for line in shown.err.splitlines():
        assert line.endswith("--clips FOLDER, after `evenhand film study --out FOLDER`")
        assert line.count(package) == 1  # the file's own name, before the sentence


def test_all_mistakes_are_printed_at_once(cli, file):
    text = file.read_text().replace('order = "latin"', 'order = "latn"')
    file.write_text(text.replace("points = 7", "points = 70").replace("after = 6", "after = 16"))
    shown = cli("study", "check", "my.toml")
    assert (shown.code, shown.out) == (2, "")
    rows = file.read_text().splitlines()
    found = [re.match(r"evenhand: my\.toml, line (\d+), ", line) for line in shown.err.splitlines()]
    assert [rows[int(one.group(1)) - 1] for one in found if one] == [
        'order = "latn"', "points = 70", "after = 16",
    ]  # fmt: skip
    assert "did you mean 'latin'?" in shown.err


# --- serve and preview ---


def test_nobody_is_asked_to_agree_to_a_template(cli, tmp_path, file):
    cli("study", "new", "t.toml")
    complaint = cli("study", "serve", "t.toml").complaint
    assert "t.toml still has to be completed ([[name of the lead]])" in complaint
    assert not list(tmp_path.glob("*.db"))


@pytest.mark.parametrize("command", ["serve", "preview"])
def test_what_cannot_be_served(cli, tmp_path, file, command, monkeypatch):
    said = cli("study", command, "none.toml").complaint
    assert said == "none.toml cannot be read: No such file or directory"
    assert (
        "port is 70000: give a whole number from 0 to 65535"
        in cli("study", command, "my.toml", "--port", "70000").err
    )
    said = cli("study", command, "my.toml", "--host", "203.0.113.1").err
    assert "203.0.113.1, port 8000 cannot be listened to" in said
    monkeypatch.setenv("EVENHAND_STUDY_TOKEN", "short")
    assert "the admin token has 5 characters" in cli("study", command, "my.toml").complaint
    (tmp_path / "clips" / "clip-01.mp4").unlink()
    assert "clip-01.mp4 is not in the folder clips" in cli("study", command, "my.toml").complaint


# --- export and backup ---


def test_answers_become_tables_without_anybody(cli, tmp_path, answered):
    out = ("a.csv", "a.json", "b/a.parquet")
    shown = cli("study", "export", "my.toml", "--db", "paper.db", "--out", *out)
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.split() == [*out, "a.codebook.json"]
    rows = pq.read_table(tmp_path / "b" / "a.parquet").to_pylist()
    # 5 about oneself, 8 sets x 4, 2 checks, 1 pair, 1 at the end
    assert len(rows) == 41
    assert len({row["participant"] for row in rows}) == 1
    assert {row["preview"] for row in rows} == {False}
    assert all(re.fullmatch(r"[\d-]{10}T\d\d:\d\dZ", row["received"]) for row in rows)
    text = (tmp_path / "a.csv").read_text()
    assert len(text.splitlines()) == 42
    assert "pid0815" not in text + (tmp_path / "a.codebook.json").read_text()
    assert "'=1+1" in text  # no spreadsheet runs it
    codebook = json.loads((tmp_path / "a.codebook.json").read_text())
    assert codebook["study"]["name"] == "paper"


def test_what_identifies_people_is_asked_for_by_name(cli, tmp_path, answered):
    shown = cli("study", "export", "my.toml", "--with-external-ids", "--with-previews",
                "--exact-times")  # fmt: skip
    assert shown.out.split() == ["answers.csv", "answers.codebook.json", "answers.external-ids.csv"]
    text = (tmp_path / "answers.csv").read_text()
    assert len(text.splitlines()) == 1 + 2 * 41
    assert "pid0815" not in text
    assert re.search(r"T\d\d:\d\d:\d\d\.\d{3}Z", text)
    head, row = (tmp_path / "answers.external-ids.csv").read_text().splitlines()
    assert head == "participant,PROLIFIC_PID,STUDY_ID,SESSION_ID"
    assert re.fullmatch(r"[a-z]{8},pid0815,s,", row)
    assert row[:8] in text


def test_exports_that_cannot_be(cli, tmp_path, answered):
    assert (
        "none.db does not exist" in cli("study", "export", "my.toml", "--db", "none.db").complaint
    )
    assert (
        "a.txt does not end in .csv"
        in cli("study", "export", "my.toml", "--out", "a.txt").complaint
    )
    other = (tmp_path / "my.toml").read_text().replace('name = "paper"', 'name = "other"')
    (tmp_path / "other.toml").write_text(other)
    said = cli("study", "export", "other.toml", "--db", "paper.db").complaint
    assert said == "paper.db holds the study 'paper', not 'other'"
    fair = (tmp_path / "my.toml").read_text()
    turned = fair.replace("points = ", "lowest_is_unfair = false\npoints = ", 1)
    (tmp_path / "turned.toml").write_text(turned)
    said = cli("study", "export", "turned.toml", "--db", "paper.db").complaint
    assert said == (
        "paper.db holds answers to 'paper' as it was before its questions, sets or consent were "
        "changed: give the file that was served"
    )
    assert not list(tmp_path.glob("*.csv"))


def test_a_backup_is_a_study_of_its_own(cli, tmp_path, answered):
    shown = cli("study", "backup", "--db", "paper.db", "--out", "copies/1.db")
    assert (shown.code, shown.out) == (0, "copies/1.db\n")
    words = ("--db", "paper.db", "--out", "copies/1.db")
    assert "is there already: move it away" in cli("study", "backup", *words).complaint
    tables = []
    for db in ("paper.db", "copies/1.db"):
        cli("study", "export", "my.toml", "--db", db, "--out", f"{db}.csv")
        tables.append((tmp_path / f"{db}.csv").read_text())
    assert tables[0] == tables[1]


def test_an_export_while_the_study_runs(cli, tmp_path, answered):
    study = protocol_file.read(tmp_path / "my.toml")
    running = open_store(str(answered), study)
    participants.begin(running, study, "template-1")
    assert cli("study", "export", "my.toml").code == 0
    running.dispose()


# --- what is not installed ---


@pytest.mark.parametrize("package", ["fastapi", "sqlalchemy", "uvicorn"])
@pytest.mark.parametrize(
    "words",
    [("serve",), ("preview",), ("export",), ("backup", "--db", "a", "--out", "b")],
    ids=lambda words: words[0],
)
def test_what_is_missing_is_told_with_the_way_to_get_it(cli, monkeypatch, words, package):
    monkeypatch.setitem(sys.modules, package, None)
    said = cli("study", *words).complaint
    assert said == f"this command needs the package {package}: {install('study')}"


def test_checking_needs_none_of_them(apart, tmp_path, file):
    script = (
        "import sys; from evenhand.cli import main; main(['study', 'check', 'my.toml']);"
        "print({'fastapi', 'sqlalchemy', 'uvicorn', 'jax', 'sklearn'} & set(sys.modules))"
    )
    shown = apart.of(sys.executable, "-c", script)(cwd=tmp_path)
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.endswith("\nset()\n")
