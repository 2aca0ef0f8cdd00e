"""Logs that cannot be audited: each is told in one sentence, with file, row and column."""

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evenhand.audits.read.sources import open_source
from evenhand.audits.read.strict_csv import PIECE, check_delimited
from evenhand.core.errors import InputError


def complaint(path, table=None) -> str:
    with pytest.raises(InputError) as caught:
        open_source(path, table)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty"),
        (b"\n\n \n", "is empty"),
        (b"a,b\n", "has a header and no rows"),
        (b"a,b\n\n\n", "has a header and no rows"),
        (b"a\n1\n", "row 1: the header has one column only"),
        ("a,b\nü,1\n".encode("latin-1"), "row 2: byte 0xfc is no UTF-8"),
        ("a,b\nx,1\ny,2\nü".encode()[:-1], "row 4: byte 0xc3 is no UTF-8"),
        ("a,b\nx,1\n".encode("utf-16"), "is UTF-16 or no text"),
        (b"a,b\nx,1\ny\n", "row 3: it has 1 cells and the header 2"),
        (b"a,b\nx,1,2\ny,1\n", "row 2: it has 3 cells and the header 2"),
        (b"a,b,c\nx,1,2\ny,1", "the last row has 2 cells and the header 3: was the file cut off?"),
        (b"a,b\nx,1\na,b\ny,1\n", "row 3: the header stands there again"),
        (b"a,b\r\nx,1\r\na,b\r\n", "row 3: the header stands there again"),
        (b"a,b\nx,1\na,b", "row 3: the header stands there again"),
        (b"a,b,a\n1,2,3\n", "column 'a' stands there 2 times"),
        (b"a,b,A\n1,2,3\n", "only capitals tell the columns 'a' and 'A' apart"),
        (b'a,b\n"x,1\ny,2\n', "row 2: a quote is never closed: was the file cut off?"),
        (b'a,b\nx,1\ny"z,2\n', "row 3: a quote stands within a cell"),
        (b'a,b\n"x"y,1\n', "row 2: a quote stands within a cell"),
        (b"a,b\nx,1\r\ny,2\n", "row 2: its line ends unlike those before"),
        (b"a,b\rx,1\ry,2\r", "line"),
        (b"a,b\nx,\r1\n", "row 2: a carriage return stands alone"),
        (b"a,b\nx,1\n\ny,2\n", "row 3: it is empty and rows follow"),
        (b"a,b\nx,1\n\0,2\n", "row 3: a zero byte stands there"),
        (b'"a\nb",c\n1,2\n', "the header has a line break in it"),
        (b"a,b\nx,1\n" + b"y" * 1_100_000 + b",2\n", "row 3: it is longer than 1000000 bytes"),
        (b'a,b\n"' + b"y" * 1_100_000, "row 2: it is longer than 1000000 bytes"),
    ],
)
def test_csv_that_is_no_table(tmp_path, content, sentence):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    said = complaint(path)
    assert said.startswith(str(path))
    assert sentence in said


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"\n\n", "is empty"),
        (b'{"a": 1}\n{"a": 2', "line 2: it is no JSON (character 8)"),
        (b'{"a": 1}\n[1]\n', "line 2: it is no object"),
        (b'{"a": 1, "a": 2}\n', "line 1: the key 'a' stands there twice"),
        (b'{"a": 1}\n{"A": 2}\n', "only capitals tell the columns 'a' and 'A' apart"),
        (b'{"a": NaN}\n', "line 1: NaN is no number of JSON"),
        (b'{"a": -Infinity}\n', "line 1: -Infinity is no number of JSON"),
        (b'{"a": "\xff"}\n', "line 1: byte 0xff is no UTF-8"),
        (b'{"a": "\\ud800"}\n', "line 1: half of a surrogate pair"),
        (b'{"a": ' + b"[" * 200_000 + b"\n", "line 1: objects are nested too deeply"),
    ],
)
def test_json_lines_that_are_no_table(tmp_path, content, sentence):
    path = tmp_path / "log.jsonl"
    path.write_bytes(content)
    said = complaint(path)
    assert said.startswith(str(path))
    assert sentence in said


@pytest.mark.parametrize("kind", ["parquet", "arrow", "duckdb"])
@pytest.mark.parametrize("content", [b"", b"PAR1", b"ARROW1\0\0", b"x" * 5000])
def test_damaged_binary_files(tmp_path, kind, content):
    path = tmp_path / f"log.{kind}"
    path.write_bytes(content)
    assert "damaged or was cut off" in complaint(path)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_parquet_that_was_cut_off(tmp_path, share):
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({"a": list(range(1000))}), path)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    assert "cannot be read as Parquet" in complaint(path)


def test_an_empty_database_has_no_tables(tmp_path):
    duckdb.connect(str(tmp_path / "log.duckdb")).close()
    assert "no tables" in complaint(tmp_path / "log.duckdb")


def test_no_rows_are_nothing_to_audit(tmp_path):
    pq.write_table(pa.table({"a": pa.array([], pa.string())}), tmp_path / "log.parquet")
    assert "has no rows" in complaint(tmp_path / "log.parquet")
    assert "has no rows" in complaint(pa.table({"a": []}))


def test_places_that_hold_no_log(tmp_path):
    assert "does not exist" in complaint(tmp_path / "none.csv")
    assert "no file is like" in complaint(str(tmp_path / "*.csv"))
    assert "has no files" in complaint(tmp_path)
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    (tmp_path / "b.jsonl").write_text("{}\n")
    assert "several kinds, as CSV (a.csv) and JSON Lines (b.jsonl)" in complaint(tmp_path)
    (tmp_path / "c.xlsx").touch()
    assert "c.xlsx is of no known kind: give a file that ends in .csv" in complaint(tmp_path)
    assert "leave out the name 't'" in complaint(tmp_path / "a.csv", "t")


def test_files_of_other_columns_are_told(tmp_path):
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    (tmp_path / "b.csv").write_text("a,c\n1,2\n")
    assert "b.csv has no column 'b', which" in complaint(tmp_path)


def test_files_of_other_types_are_told(tmp_path):
    pq.write_table(pa.table({"a": [1]}), tmp_path / "a.parquet")
    pq.write_table(pa.table({"a": ["x"]}), tmp_path / "b.parquet")
    assert "column 'a' holds varchar" in complaint(tmp_path)


def test_faults_are_found_where_pieces_of_a_great_file_meet(tmp_path):
    """Rows of 8 bytes fill a piece exactly; what is wrong is moved over the border."""
    path = tmp_path / "log.csv"
    body = b"abc,def\n" * (PIECE // 8 + 3)
    head = b"one,two\n"
    for shift in range(-9, 10):
        at = PIECE + shift - (PIECE + shift) % 8
        row = at // 8 + 1
        good = head + body[8:]
        for fault in (b'ab"c,de\n', b"abc,d\xff\n", b"abc,,ef\n", b"one,two\n", b'"ab"c,d\n'):
            path.write_bytes(good[:at] + fault + good[at + 8 :])
            with pytest.raises(InputError, match=rf"row {row}: "):
                check_delimited(path)
        path.write_bytes(good[:at] + b'"a\n\n",\xc3\xa9\n' + good[at + 8 :])
        assert check_delimited(path).rows == len(good) // 8 - 1
