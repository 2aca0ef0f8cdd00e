"""A growing log: whole records only, each once, and the same whenever one looks."""

import csv
import io
import json
from itertools import pairwise
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.audits import api
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.readers import embedded
from evenhand.audits.read.sources import Source
from evenhand.audits.watch import alarm, tail
from evenhand.audits.watch.alarm import Watching, WatchSettings
from evenhand.audits.watch.tail import Follower, records
from evenhand.core.errors import InputError
from support.refusals import refused

ROWS = [
    (f"{n}", ("a", "b", 'x "y"\nz', "1,2")[n * 7 % 4], ("yes", "no", "no")[n * n % 3])
    for n in range(60)
]


def as_csv(ends: str = "\n", rows=ROWS, mark: str = ",") -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator=ends, delimiter=mark)
    writer.writerows([("n", "group", "responded"), *rows])
    return text.getvalue().encode()


def as_lines(rows=ROWS) -> bytes:
    made = [dict(zip(("n", "group", "responded"), row, strict=True)) for row in rows]
    return "".join(json.dumps(row) + "\n" for row in made).encode()


def begin(path: Path | str, batch: int = 6, **words) -> Follower:
    return tail.follower(
        str(path),
        words.get("table"),
        words.get("order"),
        batch,
        lambda source: api.mapping_for(source, None, {"identities": ("group",)}),
    )


def drained(log: Follower, state: Watching | None = None) -> Watching:
    """The watch after all that is there."""
    while (new := log.next()) is not None:
        batch = WatchSettings(batch=log.batch)
        state = alarm.take(state or alarm.begin(batch, new.issues), new)
    assert state is not None
    return state


def alike(a: Watching, b: Watching) -> None:
    """Bit for bit."""
    for name in ("log_wealth", "bet", "squares", "steps"):
        np.testing.assert_array_equal(getattr(a.wealth, name), getattr(b.wealth, name))
    for name in ("inside_x", "inside_n", "outside_x", "outside_n"):
        np.testing.assert_array_equal(getattr(a.counts, name), getattr(b.counts, name))
    assert (a.groups, a.services, a.raised) == (b.groups, b.services, b.raised)


# --- records ---


def test_records_by_hand():
    assert records(b'a,b\n"x\n",""""\r\n\nhal', b",") == (
        [b"a,b\n", b'"x\n",""""\r\n', b"\n"],
        b"hal",
    )
    assert records(b'{"a": "\\""}\n{') == ([b'{"a": "\\""}\n'], b"{")
    assert records(b'"open\n', b",") == ([], b'"open\n')


@given(
    st.lists(st.lists(st.text('a",\n', max_size=4), min_size=2, max_size=2), max_size=5),
    st.integers(0, 60),
)
def test_records_are_the_rows_of_the_csv_module_wherever_they_are_cut(rows, at):
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    content = text.getvalue().encode()
    first, rest = records(content[:at], b",")
    found, left = records(rest + content[at:], b",")
    assert left == b""
    read = [next(csv.reader(io.StringIO(one.decode(), newline=""))) for one in first + found]
    assert read == rows


@pytest.mark.parametrize(
    ("content", "row"),
    [
        (b'a,b\n5" m,yes\nf,no\n', 2),
        (b'a,b\nf,5"\n', 2),
        (b'a,b\n"f"x,no\n', 2),
        (b'a,"b""\n"x\n', 1),
        (b'a;"b\n', 1),
    ],
)
def test_a_quote_opens_a_cell_at_its_start_only(content, row):
    """Else it would swallow all records up to the next one, and nobody would know."""
    with pytest.raises(InputError, match=f"row {row}: a quote stands within a cell"):
        records(content, b",")


# --- the same whenever one looks ---

CONTENTS = {
    "lf.csv": as_csv(),
    "crlf.csv": as_csv("\r\n"),
    "semicolon.csv": as_csv(mark=";"),
    "tabs.tsv": as_csv(mark="\t"),
    "lines.jsonl": as_lines(),
    "lines.ndjson": as_lines(),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_live_is_the_same_as_catching_up(tmp_path, name):
    """Written in pieces of any length, records and even cells half written in between."""
    content = CONTENTS[name]
    (tmp_path / name).write_bytes(content)
    at_once = drained(begin(tmp_path / name))
    assert at_once.services == 60
    assert sorted(group for _, group in at_once.groups) == ["1,2", "a", "b", 'x "y"\nz']

    rng = np.random.default_rng(0)
    first = content.index(b"\n", 200) + 5  # within a record
    cuts = [0, first, *np.sort(rng.integers(first, len(content), 5)).tolist(), len(content)]
    live, log, state = tmp_path / f"live-{name}", None, None
    for a, b in pairwise(cuts):
        with live.open("ab") as file:
            file.write(content[a:b])
        log = log or begin(live)
        while (new := log.next()) is not None:
            state = state or alarm.begin(WatchSettings(batch=6), new.issues)
            state = alarm.take(state, new)
    assert state is not None
    alike(state, at_once)


def test_each_service_is_counted_once_in_its_own_batch(tmp_path):
    """An oracle by slices of the rows: who was ignored in which batch."""
    (tmp_path / "log.csv").write_bytes(as_csv())
    log = begin(tmp_path / "log.csv", batch=7)
    found = log.next()
    assert found is not None
    assert log.next() is None  # 4 services are left, which make no batch
    assert (found.services, log.seen, len(found.strata)) == (56, 56, 8)
    for n, name in enumerate(found.strata):
        rows = found.stratum == n
        part = ROWS[7 * int(name) : 7 * int(name) + 7]
        assert found.n[rows].sum() == 7
        assert found.n[rows] @ found.x[rows, 0] == sum(row[2] == "no" for row in part)


def test_great_logs_are_caught_up_with_in_several_rounds(tmp_path, monkeypatch):
    (tmp_path / "log.csv").write_bytes(as_csv())
    at_once = drained(begin(tmp_path / "log.csv"))
    monkeypatch.setattr(tail, "MOST", 4)
    log = begin(tmp_path / "log.csv")
    first = log.next()
    assert first is not None
    assert first.services == 24
    again = drained(begin(tmp_path / "log.csv"))
    alike(at_once, again)


def test_a_batch_with_one_group_only_is_no_mistake(tmp_path):
    rows = [("0", "a", "yes")] * 6 + [("0", "b", "no")] * 6
    (tmp_path / "log.csv").write_bytes(as_csv(rows=rows))
    state = drained(begin(tmp_path / "log.csv"))
    assert state.services == 12
    np.testing.assert_array_equal(state.wealth.log_wealth, 0.0)  # nobody to compare with


def test_a_key_that_no_service_of_a_batch_has_is_not_known(tmp_path):
    path = tmp_path / "log.jsonl"
    path.write_bytes(as_lines())
    log = begin(path)
    drained(log)
    with path.open("a") as file:
        file.write('{"responded": "no"}\n' * 6)
    found = log.next()
    assert found is not None
    assert found.identities[0].groups == ("unknown",)


# --- what cannot be followed ---


def test_a_file_that_was_cut_off_or_went_away(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(as_csv())
    log = begin(path)
    drained(log)
    path.write_bytes(as_csv()[:100])
    with refused("changed file", "log.csv"):
        log.next()
    path.unlink()
    with refused("unavailable file", "log.csv"):
        log.next()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (b"60,a,perhaps\n" * 6, "row 2, column 'responded': 'perhaps' is neither yes nor no"),
        (b"60,a\n" * 6, "row 2: it has 2 cells and the header 3"),
        (b"60,\xff,yes\n" * 6, "row 2: byte 0xff is no UTF-8"),
        (b"n,group,responded\n" * 6, "row 2: the header stands there again"),
        (b'60,"' + b"x" * 1_000_001, "a record is longer than 1000000 bytes: was a quote never"),
    ],
)
def test_what_is_wrong_in_new_records_names_the_file(tmp_path, more, said):
    path = tmp_path / "log.csv"
    path.write_bytes(as_csv())
    log = begin(path)
    drained(log)
    with path.open("ab") as file:
        file.write(more)
    with pytest.raises(InputError) as caught:
        log.next()
    assert str(caught.value).startswith(f"{path}, ")
    assert said in str(caught.value)
    if "longer" not in said:
        assert str(caught.value).endswith("(rows are counted from the 61. service on)")


def test_a_watch_needs_rows_and_takes_no_strata(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("n,group,responded\n1,a")  # no record is whole yet
    with refused("empty file", "log.csv"):
        begin(path)
    path.write_bytes(as_csv())
    with refused("unsupported within", "--within"):
        tail.follower(
            str(path), None, None, 6, lambda s: api.mapping_for(s, None, {"within": ("group",),
                                                                         "identities": ("n",)})
        )  # fmt: skip


# --- tables ---


def database(path: Path, rows) -> Path:
    columns = list(zip(*rows, strict=True))
    frame = pa.table({"n": [int(n) for n in columns[0]], "group": columns[1], "ok": columns[2]})
    with duckdb.connect(str(path)) as con:
        con.register("given", frame)
        con.execute("create or replace table log as select * from given")
    return path


def test_a_table_is_followed_in_its_order_however_it_lies(tmp_path):
    shuffled = [ROWS[n] for n in np.random.default_rng(0).permutation(60)]
    path = database(tmp_path / "log.duckdb", shuffled)
    (tmp_path / "log.csv").write_bytes(as_csv())

    def chosen(source):
        return api.mapping_for(source, None, {"identities": ("group",), "responded": "ok"})

    log = tail.follower(str(path), None, "n", 6, chosen)
    alike(drained(log), drained(begin(tmp_path / "log.csv")))


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (None, "has no order of its own: name the column of time with --order-by"),
        ("m", "unknown column of .*log.duckdb 'm': choose one of n, group, ok"),
        ("group", "column 'group' is missing or the same in several rows"),
    ],
)
def test_a_table_needs_an_order(tmp_path, order, said):
    path = database(tmp_path / "log.duckdb", ROWS)
    with pytest.raises(InputError, match=said):
        tail.follower(
            str(path), None, order, 6,
            lambda s: api.mapping_for(s, None, {"identities": ("group",), "responded": "ok"}),
        ).next()  # fmt: skip


def test_a_row_that_comes_late_is_told():
    engine = embedded()
    engine.con.execute('create table log (n integer, "group" varchar, ok varchar)')
    engine.con.execute("insert into log select 2 * i, 'a', 'no' from range(6) as r(i)")
    mapping = Mapping(identities=("group",), responded="ok")
    log = tail.Follower(Source(engine.table("log"), "log", {}), mapping, 6, order="n")
    assert log.next() is not None
    engine.con.execute("insert into log select 3 + 100 * i, 'a', 'no' from range(6) as r(i)")
    with refused("changed n", "'n'", "10"):
        log.next()
