"""Every way a log can come in gives the same table."""

import hashlib
import subprocess
import sys

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evenhand.audits.count.count import tally
from evenhand.audits.read import databases
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.readers import embedded
from evenhand.audits.read.sources import open_source
from evenhand.methods.services import Services
from support.refusals import refused

LOG = pa.table({"race": ["a", "b", None], "ok": [True, False, True]})
MAPPING = Mapping(identities=("race",), responded="ok")
COUNTS = {("a", 0.0): 1, ("b", 1.0): 1, ("unknown", 0.0): 1}
TEXT = {
    "csv": "race,ok\na,true\nb,false\n,true\n",
    "tsv": "race\tok\na\ttrue\nb\tfalse\n\ttrue\n",
    "jsonl": '{"race": "a", "ok": true}\n{"ok": false, "race": "b"}\n\n{"ok": true}\n',
}


def write(path, log=LOG) -> None:
    kind = path.suffix[1:]
    if kind in TEXT:
        path.write_text(TEXT[kind])
    elif kind == "ndjson":
        path.write_text(TEXT["jsonl"])
    elif kind == "parquet":
        pq.write_table(log, path)
    elif kind == "duckdb":
        with duckdb.connect(str(path)) as con:
            con.register("given", log)
            con.execute("create table services as select * from given")
    else:
        stream = pa.ipc.new_stream if kind == "ipc" else pa.ipc.new_file
        with pa.OSFile(str(path), "wb") as file, stream(file, log.schema) as writer:
            writer.write_table(log)


def counts(source) -> dict:
    found, _ = tally(source, MAPPING)
    groups = found.identities[0].groups
    return {
        (groups[code], x): int(n)
        for code, x, n in zip(found.codes[:, 0], found.x[:, 0], found.n, strict=True)
    }


@pytest.mark.parametrize(
    "kind", ["csv", "tsv", "jsonl", "ndjson", "parquet", "arrow", "feather", "ipc", "duckdb"]
)
def test_a_file_of_every_kind(tmp_path, kind):
    path = tmp_path / f"log.{kind}"
    write(path)
    source = open_source(path)
    assert counts(source) == COUNTS
    assert source.name == str(path)
    assert source.description["bytes"] == path.stat().st_size
    if kind != "duckdb":
        assert source.description["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
        assert (source.description["rows"], source.rows) == (3, 3)


@pytest.mark.parametrize("kind", ["csv", "jsonl", "parquet", "arrow"])
def test_a_folder_and_a_pattern(tmp_path, kind):
    (tmp_path / "more").mkdir()
    write(tmp_path / f"1.{kind}")
    write(tmp_path / "more" / f"2.{kind}")
    (tmp_path / "more" / "_SUCCESS").touch()
    (tmp_path / ".hidden.txt").touch()
    twice = {key: 2 * n for key, n in COUNTS.items()}
    source = open_source(str(tmp_path))
    assert counts(source) == twice
    assert (source.description["files"], source.description["rows"]) == (2, 6)
    assert counts(open_source(f"{tmp_path}/**/*.{kind}")) == twice
    assert counts(open_source(f"{tmp_path}/*.{kind}")) == COUNTS


@pytest.mark.parametrize("name", ["a*[1]?.csv", 'it\'s "so"; DROP TABLE x;--.csv', "ü ñ.csv"])
def test_a_path_is_no_pattern_and_no_query(tmp_path, name):
    path = tmp_path / name
    write(path)
    (tmp_path / "a1.csv").write_text("race,ok\nz,true\n")
    assert counts(open_source(path)) == COUNTS


@pytest.mark.parametrize(
    "frame",
    [LOG, LOG.to_pandas(), pl.from_arrow(LOG), LOG.to_reader(), duckdb.from_arrow(LOG)],
    ids=["pyarrow", "pandas", "polars", "reader", "relation"],
)
def test_a_data_frame(frame):
    assert counts(open_source(frame)) == COUNTS


def test_interactions():
    log = Services.build(
        {"race": (np.array([0, 1, -1]), ["a", "b"])}, {"responded": [True, False, True]}
    )
    source = open_source(log)
    assert source.table.columns == ("race", "responded")
    assert source.description == {"kind": "Services", "rows": 3}


def test_names_of_columns_are_harmless(tmp_path):
    names = ['"; DROP TABLE log; --', "it's", "a\\b", "select *", "{0}", "%s", "ü"]
    path = tmp_path / "log.csv"
    quoted = ",".join('"' + name.replace('"', '""') + '"' for name in names)
    path.write_text(f"{quoted},ok\n{'a,' * 7}yes\n{'b,' * 7}no\n")
    source = open_source(path)
    assert source.table.columns == (*names, "ok")
    found, _ = tally(source, Mapping(identities=tuple(names), responded="ok"))
    assert [one.name for one in found.identities] == names
    assert found.n.tolist() == [1, 1]


def test_cells_with_line_breaks_quotes_and_formulas_are_read_as_they_stand(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text('who,ok\n"a\n""1""",yes\n=1+1,no\n"x,y",no\n')
    source = open_source(path)
    assert source.fetch(f"select * from {source.table.source}").to_pydict() == {
        "who": ['a\n"1"', "=1+1", "x,y"],
        "ok": ["yes", "no", "no"],
    }


@pytest.mark.parametrize("mark", [";", "|", "\t"])
def test_other_marks_between_cells(tmp_path, mark):
    path = tmp_path / "log.csv"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT["csv"].replace(",", mark).encode())
    assert counts(open_source(path)) == COUNTS


def test_a_table_of_a_database_file(tmp_path):
    path = tmp_path / "log.duckdb"
    write(path)
    with duckdb.connect(str(path)) as con:
        con.execute("create table other as select 1 as x")
    assert counts(open_source(path, table="services")) == COUNTS
    with refused("missing table"):
        open_source(path)
    with refused(
        "unknown table",
        "'services'",
    ):
        open_source(path, table="service")


def test_a_database_by_url(tmp_path):
    path = tmp_path / "log.duckdb"
    write(path)
    source = open_source(f"duckdb://{path}", table="services")
    assert counts(source) == COUNTS
    assert source.description["kind"] == "duckdb"


def test_a_file_that_changes_while_it_is_counted_is_told(tmp_path):
    path = tmp_path / "log.csv"
    write(path)
    source = open_source(path)
    with path.open("a") as file:
        file.write("b,false\n")
    with refused("changed log"):
        tally(source, MAPPING)
    source = open_source(path)
    path.unlink()
    with refused("changed file"):
        tally(source, MAPPING)


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("postgres://me:s3cret@host:5432/db", "postgres://me@host:5432/db"),
        ("postgres://me:p%40ss@host/db?sslpassword=geheim#x", "postgres://me@host/db"),
        ("postgres://host/db?password=geheim", "postgres://host/db"),
        ("postgres://me:a@b@host/db", "postgres://me@host/db"),
    ],
)
def test_a_url_is_shown_without_its_secrets(url, shown):
    assert databases.shown(url) == shown


@pytest.mark.parametrize("word", ["s3cr@t", "s3cr%40t", "geheim"])
def test_a_message_with_a_secret_is_not_shown(word):
    url = "postgres://me:s3cr%40t@host/db?sslpassword=geheim"
    assert word not in databases.hide(f"login failed with {word}", url)
    assert databases.hide("login failed", url) == "login failed"


def test_no_password_in_any_complaint_of_a_database(monkeypatch):
    def refuse(url):
        raise OSError(f"could not connect with {url}\nand more")

    monkeypatch.setitem(databases.ENGINES, "postgres", refuse)
    with refused("unavailable database") as caught:
        open_source("postgres://me:s3cret@nowhere.invalid/db")
    assert "postgres://me@nowhere.invalid/db cannot be reached" in str(caught.value)
    assert "s3cret" not in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.__suppress_context__


def test_a_frame_of_mixed_types_is_refused():
    with refused("format log"):
        open_source(pd.DataFrame({"a": [1, "x", 2.5]}))
    with refused("type log"):
        open_source(3)


def test_a_long_query_draws_no_progress_into_what_a_command_says(capfd):
    engine = embedded()
    engine.con.execute("set progress_bar_time = 0")
    assert engine.fetch("select count(*) from range(20_000_000)").num_rows == 1
    assert capfd.readouterr() == ("", "")


KERNEL = """
import sys, types

shell = types.SimpleNamespace(config={"IPKernelApp": {}})
python = types.ModuleType("IPython")
python.get_ipython = lambda: shell
sys.modules["IPython"] = python
sys.modules["ipywidgets"] = None

import duckdb
import pyarrow as pa
import evenhand

try:
    duckdb.connect().execute("set enable_progress_bar_print = false")
except duckdb.InvalidInputException as error:
    print("ipywidgets" in str(error))
frame = pa.table({"gender": ["f", "m"] * 40, "responded": [True, False] * 40})
print(evenhand.audit(frame).services)
"""


def test_a_frame_is_audited_in_a_notebook_without_ipywidgets():
    """DuckDB knows a notebook by IPython's shell, and refuses there to set its progress bar."""
    words = [sys.executable, "-c", KERNEL]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.stdout.split(), done.stderr) == (["True", "80"], "")
