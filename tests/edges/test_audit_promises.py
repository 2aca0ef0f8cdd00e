"""What an audit promises whatever happens: it can be repeated, and the log stays as it is."""

import csv
import json
import os
import shlex
import sys
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from evenhand.audits import api
from evenhand.audits.example import synthetic_log
from evenhand.cli import parse
from evenhand.cli.audit import Audit

QUICK = ("--permutations", 200)
GOOD = b"gender,age,responded,wait,distance\n" + b"f,30,yes,1.5,1.2\nm,40,no,,\n" * 10


# --- to repeat it ---


def test_the_command_on_the_card_can_be_given_to_a_shell(cli, tmp_path):
    """Names with spaces, quotes, signs of the shell and a line break; every kind of option."""
    who, when = 'who\'s "it"; rm -rf $HOME', "a\nday"
    with (tmp_path / "my log's.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([who, "ok?", "a day", "mood & more"])
        writer.writerows([(n % 3, ("ja", "nein")[n % 2], n % 2, n / 7) for n in range(40)])
    words = ("audit", "my log's.csv", "--identities", who, "--bins", f"{who}=1,2", *QUICK,
             "--responded", "ok?", "--within", "a day", "--measures", "mood & more", "--late", 2.5,
             "--fail-on", "nothing", "--out", f"{when} *.json")  # fmt: skip
    ended = cli(*words)
    assert ended.code == 0, ended.err
    (told,) = (json.loads(path.read_text()) for path in tmp_path.glob("*.json"))
    program, name, *again = shlex.split(told["command"])
    assert (program, name) == ("evenhand", "audit")
    assert parse(Audit, "evenhand audit", again) == parse(
        Audit, "evenhand audit", [str(word) for word in words[1:]]
    )
    assert cli(name, *again).out == ended.out


@pytest.mark.parametrize("log", ["logs/a.csv", "logs", "logs/*.csv"])
def test_no_audit_is_written_over_its_log(cli, tmp_path, log):
    (tmp_path / "logs").mkdir()
    for name in "ab":
        (tmp_path / f"logs/{name}.csv").write_bytes(GOOD)
    (tmp_path / "link.csv").symlink_to(tmp_path / "logs/a.csv")
    for target in ("logs/a.csv", "link.csv"):
        said = cli("audit", log, *QUICK, "--out", "a.html", target).complaint
        assert said == f"{target} is the log itself, which is never changed: choose another name"
    assert (tmp_path / "logs/a.csv").read_bytes() == GOOD
    assert not (tmp_path / "a.html").exists()
    assert cli("audit", log, *QUICK, "--out", "c.csv").code == 0


# --- a log that changes ---


def as_csv(path: Path, log: pa.Table) -> None:
    pyarrow.csv.write_csv(log, path)


def as_arrow(path: Path, log: pa.Table) -> None:
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, log.schema) as writer:
        writer.write_table(log)


def as_duckdb(path: Path, log: pa.Table) -> None:
    with duckdb.connect(str(path)) as con:
        con.register("given", log)
        con.execute("create table log as select * from given")


KINDS = {"log.csv": as_csv, "log.parquet": lambda path, log: pq.write_table(log, path),
         "log.arrow": as_arrow, "log.duckdb": as_duckdb}  # fmt: skip


@pytest.mark.parametrize("share", [0.0, 0.5, 1.1])
@pytest.mark.parametrize("name", KINDS)
def test_a_log_that_grows_or_is_cut_off_while_it_is_counted_leaves_no_card(
    cli, tmp_path, monkeypatch, name, share
):
    """So large that no engine has read it all before; one that maps it would be ended for it."""
    path = tmp_path / name
    KINDS[name](path, synthetic_log(20_000, np.random.default_rng(0)))
    guess = api.guess

    def slow(*arguments):
        os.truncate(path, int(path.stat().st_size * share))
        return guess(*arguments)

    monkeypatch.setattr(api, "guess", slow)
    assert f"{name} changed while it was read" in cli("audit", name, "--out", "a.html").complaint
    assert [one.name for one in tmp_path.iterdir()] == [name]


# --- the end of a process ---


@pytest.mark.parametrize("name", KINDS)
def test_a_good_audit_says_nothing_on_standard_error(apart, tmp_path, name):
    """As a process of its own, to its very end: libraries complain when the interpreter leaves."""
    KINDS[name](tmp_path / name, synthetic_log(900, np.random.default_rng(0)))
    ended = apart("audit", name, *QUICK, "--out", "a.html", "a.json", cwd=tmp_path)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.splitlines()[-2:] == ["a.html", "a.json"]


SCRIPT = """
import evenhand
from evenhand.audits.read.sources import open_source

kept = open_source("log.csv")
found = evenhand.audit("log.csv")
try:
    evenhand.audit("log.csv", responded="gender")
except ValueError as error:
    refused = error
"""


def test_a_script_that_keeps_what_it_opened_ends_in_silence(apart, tmp_path):
    as_csv(tmp_path / "log.csv", synthetic_log(900, np.random.default_rng(0)))
    ended = apart.of(sys.executable, "-c")(SCRIPT, cwd=tmp_path)
    assert (ended.code, ended.out, ended.err) == (0, "", "")
