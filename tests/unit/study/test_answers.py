"""Answers: what is stored is what is read, in every form, and a wrong file is told by its place."""

import csv
import json
import math

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenhand.core.errors import InputError
from evenhand.study.analysis import answers as rooms
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.analysis.answers import Answers, read, write
from evenhand.study.analysis.codebook import codebook
from support.answered import judged, protocol, row
from support.refusals import refused

FORMULAS = ["=1+1", "+1", "-1", "@SUM(A1)", " =1", "\t=1", "\n-2", "\r", "'quoted", "''", "\uff1d1",
            "=cmd|' /C calc'!A0", "a=1", "5 - 3", "''=1"]  # fmt: skip


def some() -> Answers:
    rows = judged("abcdefgh", "late", 2, "priority", "age", position=2)
    rows += judged("abcdefgh", "even-one", None, position=3)
    rows.append(row("zyxwvuts", "end", "say", value='He said: "no",\nthen left', simulated=True))
    rows.append(row("zyxwvuts", "check:look", "look", value="red", right=False, simulated=True))
    return Answers.of_rows(rows)


@pytest.mark.parametrize("ending", rooms.ENDINGS)
def test_every_form_gives_the_same_answers_again(tmp_path, ending):
    path = tmp_path / f"answers{ending}"
    write(some(), path)
    assert read(path).table.equals(some().table)


texts = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=12)


@pytest.mark.parametrize("ending", rooms.ENDINGS)
@settings(max_examples=30)
@given(values=st.lists(st.one_of(st.none(), texts, st.sampled_from(FORMULAS)), max_size=8))
def test_any_text_survives_every_form(tmp_path_factory, ending, values):
    given_rows = [row(f"p{i}", "end", "say", value=value) for i, value in enumerate(values)]
    path = tmp_path_factory.mktemp("forms") / f"answers{ending}"
    write(Answers.of_rows(given_rows), path)
    assert read(path).table["value"].to_pylist() == [value or None for value in values]


@pytest.mark.parametrize("text", FORMULAS)
def test_no_cell_of_the_csv_file_runs_as_a_formula(tmp_path, text):
    path = tmp_path / "answers.csv"
    write(Answers.of_rows([row("abc", "end", "say", value=text)]), path)
    with path.open(newline="", encoding="utf-8") as file:
        (found,) = csv.DictReader(file)
    assert found["value"][:1] not in {"=", "+", "-", "@", "\t", "\r", "\n", "\uff1d"}
    assert found["value"].lstrip()[:1] not in {"=", "+", "-", "@"}
    assert found["value"] in {text, f"'{text}"}


def test_negative_numbers_are_numbers_and_no_formulas(tmp_path):
    path = tmp_path / "answers.csv"
    write(Answers.of_rows([row("abc", "set:late", "fair", value="-1", number=-1.0)]), path)
    assert '"\'-1",-1,' in path.read_text()
    assert read(path).table["number"].to_pylist() == [-1.0]


def test_empty_text_and_infinity_are_missing_not_answers():
    found = Answers.of_rows([row("abc", "end", "say", value="", number=math.inf)])
    assert found.table["value"].to_pylist() == [None]
    assert found.table["number"].to_pylist() == [None]


def test_roles_and_participants_can_be_asked_for():
    assert some().participants == ("abcdefgh", "zyxwvuts")
    assert some().simulated
    fair = some().where(pc.equal(some().table["role"], "fair"))
    assert fair.table["item"].to_pylist() == ["late", "even-one"]
    assert not fair.simulated


def test_ids_that_name_a_person_elsewhere_are_no_column(tmp_path):
    path = tmp_path / "answers.csv"
    write(some(), path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{lines[0]},prolific_pid", f"{lines[1]},a person"]) + "\n")
    with refused("unknown column", "'prolific_pid'"):
        read(path)


# --- files that do not fit ---


def spoilt(tmp_path, old, new):
    path = tmp_path / "answers.csv"
    write(Answers.of_rows(judged("abcdefgh", "late", 2, "priority", "age")), path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('"abcdefgh",false', '"abcdefgh",maybe', "row 1, column 'simulated': 'maybe' is not true"),
        ('"scale","2",2,', '"scale","2",two,', "row 1, column 'number': 'two' is not a number"),
        ("20,1,", "20,1.5,", "row 1, column 'views': '1.5' is not a whole number"),
        ('"abcdefgh",false,false,"1",0,1,', ",false,false,,0,1,", "row 1, column 'participant'"),
        ('"finished"', '"finisht"', "row 1, column 'status': unknown status 'finisht': did you me"),
        ('"seconds"', '"secs"', "column 'seconds' is missing"),
        ('"seconds"', '"page"', "column 'page' is there twice"),
        ('"status"', '"status","mood"', "unknown column 'mood'|Expected 20 columns"),
        ('"abcdefgh",false', '"abcdefgh"', "row #?2|Expected 19 columns, got 18"),
    ],
)
def test_a_mistake_in_a_csv_file_is_told_by_its_place(tmp_path, old, new, complaint):
    with pytest.raises(InputError, match=complaint) as error:
        read(spoilt(tmp_path, old, new))
    assert "answers.csv" in str(error.value)
    assert "\n" not in str(error.value)


def test_what_cannot_be_is_refused(tmp_path):
    rows = judged("abcdefgh", "late", 2)
    with refused("duplicate participant", "'fair'"):
        Answers.of_rows([*rows, rows[0]])
    with refused("conflict participant"):
        Answers.of_rows([*rows, row("abcdefgh", "end", "say", simulated=True)])
    with refused("type position", "2", "'position'", "'first'"):
        Answers.of_rows([rows[0], row("b", "end", "say", position="first")])
    table = some().table
    views = table["views"].cast(pa.float64())
    wrong = table.set_column(table.column_names.index("views"), "views", views)
    with refused("type views", "'views'"):
        Answers(wrong)


def test_files_of_other_kinds_are_refused(tmp_path):
    def complaint(name, content):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(InputError) as error:
            read(path)
        return str(error.value)

    assert "has to end in .csv, .json or .parquet" in complaint("answers.xlsx", b"")
    assert "it is no CSV file" in complaint("empty.csv", b"")
    assert "it is no CSV file" in complaint("latin.csv", "participant\nJosé\n".encode("latin-1"))
    assert "it is no Parquet file" in complaint("a.parquet", b"PAR1")
    assert "no JSON or was cut off" in complaint("a.json", b'{"format": "evenhand-an')
    assert "field 'format'" in complaint("b.json", b"[]")
    assert "version 9" in complaint("c.json", b'{"format": "evenhand-answers", "version": 9}')
    head = b'{"format": "evenhand-answers", "version": 1, "answers": '
    assert "a list of rows" in complaint("d.json", head + b"[1]}")
    assert "row 1: unknown column 'pages'" in complaint("e.json", head + b'[{"pages": 1}]}')
    assert "row 1, column 'participant'" in complaint("f.json", head + b"[{}]}")
    with refused("missing file"):
        read(tmp_path / "none.csv")
    pq.write_table(pa.table({"participant": [1]}), tmp_path / "b.parquet")
    with refused("missing simulated", "'simulated'"):
        read(tmp_path / "b.parquet")


# --- the codebook ---


def test_the_codebook_has_every_column_and_question_with_counts():
    found = codebook(some(), protocol())
    json.dumps(found, allow_nan=False)
    assert [column["name"] for column in found["columns"]] == list(rooms.COLUMNS)
    assert found["participants"]["people"] == {"finished": 1, "begun": 0}
    assert found["participants"]["simulated"]["finished"] == 1
    by_id = {one["id"]: one for one in found["questions"]}
    assert list(by_id) == ["age-group", "fair", "issue", "towards", "even", "say", "look"]
    fair = by_id["fair"]
    assert (fair["answered"], fair["missing"], fair["points"]) == (1, 1, 5)
    assert [(o["value"], o["count"]) for o in fair["options"]] == [
        ("1", 0), ("2", 1), ("3", 0), ("4", 0), ("5", 0)]  # fmt: skip
    assert "options" not in by_id["say"]
    assert "He said" not in json.dumps(found)


def test_without_a_protocol_the_codebook_tells_what_was_answered():
    rows = [row("a", "set:late", "why", type="choices", value="x|y"),
            row("b", "set:late", "why", type="choices", value="y")]  # fmt: skip
    (found,) = codebook(Answers.of_rows(rows))["questions"]
    assert found["type"] == "choices"
    assert [(o["value"], o["count"]) for o in found["options"]] == [("x", 1), ("y", 2)]


def test_a_file_that_another_program_wrote(tmp_path):
    """Whole numbers are written as 1.0 where any is missing; some spreadsheets part by ';'."""
    path = tmp_path / "answers.csv"
    said = row("ann", "set:late", "fair", value="2", number=2.0, views=1)
    other = row("ann", "set:late", "issue", value="risk", views=None)
    written = Answers.of_rows([said, other])
    frame = pd.DataFrame(written.rows())
    frame.to_csv(path, index=False)
    assert "1.0" in path.read_text().splitlines()[1]
    assert read(path).table["views"].to_pylist() == [1, None]
    frame["views"] = 1.5
    frame.to_csv(path, index=False)
    with refused("type views", "'views'", "'1.5'"):
        read(path)
    frame.to_csv(path, index=False, sep=";")
    with refused("format file", "';'"):
        read(path)
