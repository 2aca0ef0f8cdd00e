"""audit, watch and example at the command line: exit codes, files, and one sentence for a fault."""

import csv
import json
import sys
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest

from evenhand.audits.example import synthetic_log
from support.pages import Page

QUICK = ("--permutations", 200)
HEAD = b"gender,age,responded,wait,distance\n"
GOOD = HEAD + b"f,30,yes,1.5,1.2\nm,40,no,,\n" * 10
ALL = ("a.html", "a.json", "a.csv")


@pytest.fixture
def fleet(tmp_path) -> Path:
    pyarrow.csv.write_csv(synthetic_log(1500, np.random.default_rng(0)), tmp_path / "fleet.csv")
    return tmp_path / "fleet.csv"


# --- codes and files ---


def test_an_audit_writes_all_forms_and_ends_well(cli, fleet, tmp_path):
    ended = cli("audit", fleet, *QUICK, "--out", "new/a.html", "new/a.json", "new/a.csv")
    assert (ended.code, ended.err) == (0, "")
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [
        "a.csv",
        "a.html",
        "a.json",
    ]
    assert ended.out.splitlines()[-3:] == ["new/a.html", "new/a.json", "new/a.csv"]
    assert "1,500 services" in ended.out
    for word in ("age_group", "gender", "mobility", "wheelchair", "insufficient data"):
        assert word in ended.out
    told = json.loads((tmp_path / "new/a.json").read_text())
    assert told["command"] == (
        f"evenhand audit {fleet} --out new/a.html new/a.json new/a.csv --permutations 200"
    )
    assert told["command"] in (tmp_path / "new/a.html").read_text()


@pytest.mark.parametrize(
    ("rates", "fail_on", "code"),
    [
        ((0.9, 0.1), "nothing", 0),
        ((0.9, 0.1), "disparity", 3),
        ((0.9, 0.1), "insufficient", 3),
        ((0.5, 0.5), "disparity", 0),
        ((0.5, 0.5), "insufficient", 0),
        (None, "disparity", 0),
        (None, "insufficient", 3),
    ],
)
def test_the_exit_code_tells_a_pipeline(cli, tmp_path, rates, fail_on, code):
    """2,000 services of two groups, exactly at their rates; or four services."""
    rows = [("f", "yes"), ("f", "no"), ("m", "yes"), ("m", "no")]
    if rates is not None:
        rows = [
            (group, "yes" if n < 1000 * rate else "no")
            for group, rate in zip("fm", rates, strict=True)
            for n in range(1000)
        ]
    (tmp_path / "log.csv").write_text("\n".join(["gender,responded", *map(",".join, rows)]) + "\n")
    ended = cli("audit", "log.csv", *QUICK, "--fail-on", fail_on, "--out", "a.json")
    assert ended.code == code, ended
    assert (tmp_path / "a.json").exists()  # also where it fails


def test_the_same_seed_gives_the_same_files(cli, fleet, tmp_path):
    for seed, name in ((1, "a"), (1, "b"), (2, "c")):
        assert cli("audit", fleet, *QUICK, "--seed", seed, "--out", f"{name}.csv").code == 0
    read = [(tmp_path / f"{name}.csv").read_bytes() for name in "abc"]
    assert read[0] == read[1] != read[2]


def test_the_example_is_written_as_csv_and_parquet(cli, tmp_path):
    for name in ("a.csv", "b.csv", "c.parquet"):
        ended = cli("example", f"new/{name}", "--services", 300, "--seed", 7)
        assert (ended.code, ended.out, ended.err) == (0, f"new/{name}\n", "")
    assert (tmp_path / "new/a.csv").read_bytes() == (tmp_path / "new/b.csv").read_bytes()
    found = [cli("audit", f"new/{name}", *QUICK, "--out", f"{name}.json").code
             for name in ("a.csv", "c.parquet")]  # fmt: skip
    assert found == [0, 0]
    one, other = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("a.csv", "c.parquet"))
    assert one["findings"] == other["findings"]
    assert one["synthetic"] is True


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("example",), "no file is given: name one, as evenhand example fleet.csv"),
        (("example", "a.txt"), "a.txt ends neither in .csv nor in .parquet"),
        (("example", "a.csv", "--services", "0"), "services is 0: give a whole number from 1"),
        (("example", "a.csv", "--seed", "-1"), "seed is -1: give a whole number from 0"),
    ],
)
def test_an_example_that_cannot_be_meant(cli, tmp_path, words, said):
    assert said in cli(*words).complaint
    assert list(tmp_path.iterdir()) == []


# --- roles ---


def test_roles_come_from_a_file_and_options_go_before(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(GOOD)
    (tmp_path / "map.toml").write_text(
        'identities = ["age"]\nresponded = "responded"\nresponse_time = "wait"\n'
        'time_unit = "min"\n[bins]\nage = [18, 35]\n[thresholds]\nlate = 60.0\n'
    )
    cli("audit", "log.csv", *QUICK, "--map", "map.toml", "--out", "a.json")
    told = json.loads((tmp_path / "a.json").read_text())
    assert {row["group"] for row in told["findings"]} == {"18 to below 35", "35 and above"}
    late = [row["rate"] for row in told["findings"] if row["issue"] == "priority"]
    assert 1.0 in late  # 1.5 min are more than 60 s
    cli("audit", "log.csv", *QUICK, "--map", "map.toml", "--time-unit", "s", "--out", "b.json")
    told = json.loads((tmp_path / "b.json").read_text())
    assert {row["rate"] for row in told["findings"] if row["issue"] == "priority"} <= {0.0, None}


def test_bins_by_option(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(GOOD)
    words = ("--identities", "age", "--bins", "age=35")
    assert cli("audit", "log.csv", *QUICK, *words, "--out", "a.csv").code == 0
    with (tmp_path / "a.csv").open() as file:
        assert {row["group"] for row in csv.DictReader(file)} == {"below 35", "35 and above"}


def test_warnings_and_what_is_left_out_are_notes(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(HEAD + b"f,30,yes,1.5,120\nm,40,yes,2,130\n" * 10)
    ended = cli("audit", "log.csv", *QUICK, "--identities", "gender", "--out", *ALL)
    assert ended.code == 0
    doubt = "half of column 'distance' is more than 20 m: is its unit 'm'?"
    assert doubt in json.loads((tmp_path / "a.json").read_text())["warnings"]
    card = Page((tmp_path / "a.html").read_text()).text
    assert "".join(card).index(doubt) < "".join(card).index("Every group and issue")
    notes = ended.err.splitlines()
    assert all(line.startswith("note: ") for line in notes)
    assert any("more than 20 m: is its unit 'm'?" in line for line in notes)
    assert any("risk: no column tells" in line for line in notes)


# --- every bad input ---

ROW = b"f,30,yes,1.5,1.2\n"
CONTENTS = [
    (b"", "log.csv is empty"),
    (HEAD, "log.csv has a header and no rows"),
    (GOOD + "ü,30,yes,1,1\n".encode("latin-1"), "row 22: byte 0xfc is no UTF-8"),
    (GOOD.decode().encode("utf-16"), "log.csv is UTF-16 or no text"),
    (GOOD + b"f,30,yes\n" + ROW, "row 22: it has 3 cells and the header 5"),
    (GOOD + b"f,30,y", "the last row has 3 cells and the header 5: was the file cut off?"),
    (GOOD + HEAD + ROW, "row 22: the header stands there again"),
    (b"gender,gender,responded\nf,m,yes\n", "column 'gender' stands there 2 times"),
    (GOOD + b"f,30,yes,soon,1\n", "row 22, column 'wait': 'soon' is no number"),
    (GOOD + b'f,30,yes,"1,5",1\n', "row 22, column 'wait': '1,5' is no number: write a decimal"),
    (GOOD + b"f,30,yes,-1,1\n", "row 22, column 'wait': '-1' is negative"),
    (GOOD + b"f,30,yes,inf,1\n", "row 22, column 'wait': 'inf' is infinite"),
    (GOOD + b"f,30,yes,1e999,1\n", "row 22, column 'wait': '1e999' is infinite or too great"),
    (GOOD + b"f,30,maybe,1,1\n", "row 22, column 'responded': 'maybe' is neither yes nor no"),
    (HEAD + ROW * 5, "every identity has one group only"),
    (b"where,responded\nx,yes\n", "no column that looks like an identity"),
    (b"gender,place\nf,x\nm,y\n", "tells no issue"),
    (
        HEAD + b"".join(b"%d,1,yes,1,1\n" % n for n in range(3000)),
        "identity 'gender' has more than 1000 groups and looks like an identifier",
    ),
]


@pytest.mark.parametrize(("content", "said"), CONTENTS)
def test_a_bad_log_is_one_sentence_and_nothing_is_written(cli, tmp_path, content, said):
    (tmp_path / "log.csv").write_bytes(content)
    complaint = cli("audit", "log.csv", *QUICK, "--out", *ALL).complaint
    assert said in complaint
    assert "log" in complaint
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


WORDS = [
    (("audit",), "no log is given: name a file"),
    (("audit", "none.csv"), "none.csv does not exist"),
    (("audit", "log.csv", "--out", "a.pdf"), "a.pdf ends in none of .html, .json, .csv"),
    (("audit", "log.csv", "--out", "log.csv/a.json"), "log.csv is a file, not a folder"),
    (("audit", "log.csv", "--identities", "gendr"), "unknown column 'gendr': did you mean"),
    (("audit", "log.csv", "--bins", "age"), "bins 'age': give a column and rising numbers"),
    (("audit", "log.csv", "--bins", "age=5,x"), "bins 'age=5,x': give a column and rising"),
    (("audit", "log.csv", "--bins", "age=5,1"), "bins of 'age' must be rising numbers"),
    (("audit", "log.csv", "--map", "none.toml"), "none.toml cannot be read"),
    (("audit", "log.csv", "--map", "log.csv"), "log.csv is no TOML"),
    (("audit", "log.csv", "--time-unit", "h"), "unknown time-unit 'h': choose one of s, ms"),
    (("audit", "log.csv", "--late", "-1"), "late is -1.0: give the seconds after which"),
    (("audit", "log.csv", "--depth", "4"), "depth is 4: give a whole number from 1 to 3"),
    (("audit", "log.csv", "--permutations", "0"), "permutations"),
    (("audit", "log.csv", "--alpha", "2"), "alpha is 2.0"),
    (("audit", "log.csv", "--fail-on", "all"), "unknown fail-on 'all'"),
    (("audit", "log.csv", "--table", "x"), "log.csv holds one table: leave out the name 'x'"),
    (("watch",), "no log is given"),
    (("watch", "none.csv"), "none.csv does not exist"),
    (("watch", "log.csv", "--every", "0"), "every is 0.0: give 0.05 to 86,400 seconds"),
    (("watch", "log.csv", "--batch", "1"), "batch is 1: give a whole number from 2"),
    (("watch", "log.csv", "--within", "age"), "leave out --within"),
]


@pytest.mark.parametrize(("words", "said"), WORDS)
def test_words_that_cannot_be_meant(cli, tmp_path, words, said):
    (tmp_path / "log.csv").write_bytes(GOOD)
    assert said in cli(*words).complaint
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_formulas_and_queries_in_a_log_do_nothing(cli, tmp_path):
    evil = '"; DROP TABLE log; --'
    with (tmp_path / "log.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([evil, "responded"])
        writer.writerows([("=HYPERLINK(1)", "yes"), ("<script>alert(1)</script>", "no")] * 10)
    ended = cli("audit", "log.csv", *QUICK, "--identities", evil, "--out", *ALL)
    assert ended.code == 0, ended.err
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["identity"] for row in rows} == {evil}
    assert {row["group"] for row in rows} == {"'=HYPERLINK(1)", "<script>alert(1)</script>"}
    assert "<script>alert" not in (tmp_path / "a.html").read_text()


# --- databases ---


def test_a_password_is_never_echoed(cli, tmp_path):
    with duckdb.connect(str(tmp_path / "log.duckdb")) as con:
        con.register("given", pa.table({"gender": ["f", "m"] * 9, "responded": [True, False] * 9}))
        con.execute("create table log as select * from given")
    url = f"duckdb://{tmp_path}/log.duckdb?threads=1"
    ended = cli("audit", url, *QUICK, "--out", *ALL)
    assert ended.code == 0, ended.err
    told = json.loads((tmp_path / "a.json").read_text())
    for text in (ended.out, ended.err, *((tmp_path / name).read_text() for name in ALL)):
        assert "threads=1" not in text  # an option may be a secret as well
    assert told["command"].startswith(f"evenhand audit duckdb://{tmp_path}/log.duckdb --out ")


SECRET = "postgres://me:s3cret@127.0.0.1:1/db"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("audit", SECRET), "postgres://me@127.0.0.1:1/db cannot be reached"),
        (("watch", SECRET, "--order-by", "t"), "postgres://me@127.0.0.1:1/db cannot be reached"),
        (("audit", "log.csv", SECRET), "unexpected word"),
        (("audit", SECRET, "--sede", "1"), "unknown option '--sede'"),
        (("audit", SECRET, "--table", "a", SECRET), "too many words after --table"),
        (("audit", SECRET, "--seed", SECRET), "--seed is"),
        (("audit", SECRET.replace("postgres", "gibtsnicht")), "unknown kind of database"),
        (("audit", SECRET.replace("//me", "///me")), "postgres://...@127.0.0.1:1/db cannot be"),
    ],
)
def test_no_complaint_holds_a_password(cli, words, said):
    complaint = cli(*words).complaint
    assert said in complaint
    assert "s3cret" not in complaint


@pytest.mark.parametrize(
    ("scheme", "package", "extra"),
    [("postgres", "psycopg", "postgres"), ("pyspark", "pyspark", "spark")],
)
def test_a_missing_extra_is_named(cli, monkeypatch, scheme, package, extra):
    monkeypatch.setitem(sys.modules, package, None)
    said = cli("audit", f"{scheme}://host/db").complaint
    assert said.startswith(f"{scheme}://host/db needs the package {package}: ")
    assert f"pip install '.[{extra}]'" in said
