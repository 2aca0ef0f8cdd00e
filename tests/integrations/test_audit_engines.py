"""The same log in DuckDB, in a PostgreSQL server and on a Spark cluster: the same findings.

The server and the cluster are real: one is started in a folder of its own, the other runs its
workers in processes of their own.
"""

import gc
import json
import shutil
from collections import Counter
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import psycopg
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evenhand.audits import api
from evenhand.audits.api import Audit, audit
from evenhand.audits.example import synthetic_log
from evenhand.audits.judge.results import AuditSettings
from evenhand.audits.show import rows as forms
from evenhand.audits.watch import alarm, tail
from evenhand.core.errors import InputError
from evenhand.statistics.verdicts import VerdictSettings
from support.postgres import PASSWORD, free_port, programs, server

pytestmark = [
    pytest.mark.slow,
    # py4j leaves its sockets to the garbage collector
    pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning"),
]

QUICK = AuditSettings(VerdictSettings(permutations=200))
ROLES: dict[str, Any] = {
    "identities": ("age_group", "gender", "mobility"),
    "measures": ("smiles_per_minute",),
    "within": ("site",),
    "depth": 2,
}
LOG = synthetic_log(3000, np.random.default_rng(5))
YES = ("yes", "Y", " true ", "1", "1.0", "JA", "SÍ", "on\t")
NO = ("no", "N", "False", "0", " 0.0", "nein", "OFF", "non")
UNKNOWN = ("", "NA", " n/a ", "null", None)


def moment(when: datetime | None, n: int) -> str | None:
    """The same moment, written now in this zone, now in that."""
    if when is None:
        return UNKNOWN[n % len(UNKNOWN)]
    minutes, zone = ((0, ""), (120, "+02:00"), (-330, "-0530"), (0, "Z"))[n % 4]
    text = (when + timedelta(minutes=minutes)).isoformat(" T"[n % 2], "milliseconds")
    return f" {text}{zone}"


def number(value: float | None, n: int) -> str | None:
    """The same number, written in one way or another."""
    if value is None:
        return UNKNOWN[n % len(UNKNOWN)]
    return (f"{value}", f" +{value} ", f"{value}e0", f"{value}00\t", f"{value:e}")[n % 5]


def as_text(log: pa.Table) -> pa.Table:
    """Every cell as people and programs write it."""
    told: dict[str, list[str | None]] = {}
    for name in log.column_names:
        cells = log[name].to_pylist()
        if name == "responded":
            words = {"yes": YES, "no": NO}
            told[name] = [words[cell][n % len(YES)] for n, cell in enumerate(cells)]
        elif name.endswith("_at"):
            told[name] = [moment(cell, n) for n, cell in enumerate(cells)]
        elif pa.types.is_floating(log[name].type):
            told[name] = [number(cell, n) for n, cell in enumerate(cells)]
        else:
            told[name] = [None if cell is None else str(cell) for cell in cells]
    return pa.table({name: pa.array(cells, pa.string()) for name, cells in told.items()})


TABLES = {"typed": LOG, "texts": as_text(LOG)}


def numbers(found: Audit) -> dict[str, Any]:
    """Everything that was found, to the last digit."""
    plain = forms.plain(found.findings, found.about)
    told = ("findings", "waits", "measures", "resemblance", "total", "even_total", "p_total")
    return {name: plain[name] for name in (*told, "verdict", "services", "mapping", "left_out")}


@pytest.fixture(scope="module")
def here() -> dict[str, dict[str, Any]]:
    """What DuckDB finds."""
    return {name: numbers(audit(table, settings=QUICK, **ROLES)) for name, table in TABLES.items()}


# --- the engines ---

TYPES = {
    pa.string(): "text",
    pa.float64(): "double precision",
    pa.int64(): "bigint",
    pa.timestamp("us"): "timestamp",
    pa.timestamp("ms"): "timestamp",
}


def store(url: str, name: str, table: pa.Table, more: bool = False) -> None:
    """A table of PostgreSQL, or more rows of it."""
    columns = ", ".join(f'"{field.name}" {TYPES[field.type]}' for field in table.schema)
    connection: Any = psycopg.connect(url)
    with connection as con:
        if not more:
            con.execute(f"drop table if exists {name}")
            con.execute(f"create table {name} ({columns})")
        with con.cursor().copy(f"copy {name} from stdin") as copy:
            for row in zip(*table.to_pydict().values(), strict=True):
                copy.write_row(row)


@pytest.fixture(scope="module")
def postgres(require) -> Iterator[str]:
    """URL of a server that holds the logs."""
    binaries = programs()
    require(binaries is not None, "a PostgreSQL server (initdb and postgres)")
    assert binaries is not None
    with server(binaries) as url:
        for name, table in TABLES.items():
            store(url, name, table)
        yield url


@pytest.fixture(scope="module")
def spark(require, tmp_path_factory) -> Iterator[Any]:
    """A cluster of two workers, each a process of its own; the logs lie in eight files."""
    require(shutil.which("java") is not None, "Java, which Spark runs on")
    import pyspark
    from pyspark.sql import SparkSession

    folder = tmp_path_factory.mktemp("spark")
    words = {
        "spark.driver.host": "127.0.0.1",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.ui.enabled": "false",
        "spark.ui.showConsoleProgress": "false",
        "spark.sql.shuffle.partitions": "4",
        "spark.sql.files.openCostInBytes": "134217728",  # a task for each file
        "spark.sql.warehouse.dir": str(folder / "warehouse"),
        # both workers are there before anything is counted
        "spark.scheduler.minRegisteredResourcesRatio": "1.0",
        "spark.scheduler.maxRegisteredResourcesWaitingTime": "600s",
    }
    builder = SparkSession.builder.master("local-cluster[2,1,1024]")
    for name, value in words.items():
        builder = builder.config(name, value)
    session: Any = builder.getOrCreate()
    session.sparkContext.setLogLevel("OFF")
    try:
        for name, table in TABLES.items():
            (folder / name).mkdir()
            for n in range(8):
                pq.write_table(table.slice(n * 375, 375), folder / name / f"{n}.parquet")
            session.read.parquet(str(folder / name)).createOrReplaceTempView(name)
        yield session
    finally:
        session.stop()
        gc.collect()  # its sockets, while their warnings are ignored
        # what the workers noted in Spark's own folder
        shutil.rmtree(Path(pyspark.__file__).parent / "work", ignore_errors=True)


# --- the same, row for row ---


@pytest.mark.parametrize("name", TABLES)
def test_duckdb_counts_what_stands_there(here, name):
    """An oracle in plain Python: who was ignored, and who was approached too closely."""
    rows = LOG.to_pylist()
    ages = [row["age_group"] or "unknown" for row in rows]
    n = Counter(ages)
    ignored = Counter(a for a, row in zip(ages, rows, strict=True) if row["responded"] == "no")
    close = Counter(a for a, row in zip(ages, rows, strict=True) if row["min_distance_m"] < 0.5)
    for issue, cases in (("willingness", ignored), ("risk", close)):
        found = {
            one["group"]: (one["n"], one["cases"])
            for one in here[name]["findings"]
            if (one["identity"], one["issue"]) == ("age_group", issue)
        }
        assert found == {group: (n[group], cases[group]) for group in n}
    assert len(here[name]["findings"]) > 4 * (5 + 3 + 2)  # intersections as well
    assert here[name]["measures"]
    assert here[name]["waits"]


@pytest.mark.parametrize("name", TABLES)
def test_postgresql_finds_the_same(here, postgres, name):
    assert numbers(audit(postgres, settings=QUICK, table=name, **ROLES)) == here[name]


@pytest.mark.parametrize("name", TABLES)
def test_spark_finds_the_same(here, spark, name):
    """By URL, which takes the session that runs, and with two workers besides the driver."""
    assert numbers(audit("pyspark://", settings=QUICK, table=name, **ROLES)) == here[name]
    assert spark.sparkContext._jsc.sc().getExecutorMemoryStatus().size() == 3


def test_bins_and_units_are_cut_alike(postgres, spark):
    roles = {
        "identities": ("smiles_per_minute", "gender"),
        "bins": {"smiles_per_minute": (0.5, 1.2, 2.0)},
        "response_time": "waited_s",
        "time_unit": "min",
    }
    found = [
        numbers(audit(source, settings=QUICK, table=table, **roles))
        for source, table in ((LOG, None), (postgres, "texts"), ("pyspark://", "texts"))
    ]
    assert found[0] == found[1] == found[2]


# --- what an engine cannot read ---

BROKEN = [
    ("waited_s", "abc", "column 'waited_s': 'abc' is no number"),
    ("waited_s", "1d", "column 'waited_s': '1d' is no number"),  # one for Java
    ("waited_s", "0x10", "column 'waited_s': '0x10' is no number"),
    ("waited_s", "NaN", "column 'waited_s': it is NaN"),
    ("waited_s", "-0.5", "column 'waited_s': '-0.5' is negative"),
    ("min_distance_m", "-Infinity", "column 'min_distance_m': '-Infinity' is infinite"),
    ("responded", "perhaps", "column 'responded': 'perhaps' is neither yes nor no"),
    ("asked_at", "2026-02-29 12:00:00", "'2026-02-29 12:00:00' is no timestamp"),
    ("asked_at", "0000-01-01 12:00:00", "'0000-01-01 12:00:00' is no timestamp"),
    ("asked_at", "2026-03-14", "'2026-03-14' is no timestamp"),
]


def with_cell(column: str, cell: str) -> pa.Table:
    few = TABLES["texts"].slice(0, 40)
    cells = few[column].to_pylist()
    cells[17] = cell
    at = few.column_names.index(column)
    return few.set_column(at, column, pa.array(cells, pa.string()))


@pytest.mark.parametrize(("column", "cell", "said"), BROKEN)
def test_postgresql_says_which_cell_is_wrong(postgres, column, cell, said):
    store(postgres, "broken", with_cell(column, cell))
    with pytest.raises(InputError) as caught:
        audit(postgres, table="broken")
    assert said in str(caught.value)


@pytest.mark.parametrize(("column", "cell", "said"), BROKEN[1::3])
def test_spark_says_which_cell_is_wrong(spark, column, cell, said):
    spark.createDataFrame(with_cell(column, cell).to_pylist()).createOrReplaceTempView("broken")
    with pytest.raises(InputError) as caught:
        audit("pyspark://", table="broken")
    assert said in str(caught.value)


def test_a_number_beyond_what_postgresql_knows_is_one_sentence(postgres):
    """Other engines read it as infinite; this one ends its query."""
    store(postgres, "broken", with_cell("waited_s", "1e400"))
    said = 'broken cannot be read: "1e400" is out of range for type double precision'
    with pytest.raises(InputError, match=said):
        audit(postgres, table="broken")


# --- by command ---


def test_a_password_is_in_nothing_that_is_written(cli, postgres, tmp_path):
    targets = [tmp_path / f"card.{ending}" for ending in ("html", "json", "csv")]
    words = ("--permutations", 200, "--out", *targets)
    ended = cli("audit", postgres, "--table", "typed", *words)
    assert ended.code == 0, ended.err
    written = [ended.out, ended.err, *(path.read_text() for path in targets)]
    for secret in ("s3cr", PASSWORD):
        assert not [text for text in written if secret in text]
    told = json.loads(targets[1].read_text())
    assert told["log"]["url"] == postgres.replace(":s3cr%40t%2F4", "")
    assert told["command"].startswith(f"evenhand audit {told['log']['url']} --table typed")


def test_a_wrong_password_and_a_silent_port_are_one_sentence(cli, postgres):
    wrong = cli("audit", postgres.replace("s3cr%40t%2F4", "geheim")).complaint
    assert "cannot be reached" in wrong
    assert "password authentication failed" in wrong
    nobody = f"postgres://auditor:geheim@127.0.0.1:{free_port()}/postgres"
    silent = cli("audit", nobody).complaint
    assert "cannot be reached" in silent
    assert "geheim" not in wrong + silent


def test_a_table_that_grows_is_watched_like_the_same_rows_at_once(postgres):
    few = LOG.slice(0, 900)
    store(postgres, "growing", few.slice(0, 400))
    settings = alarm.WatchSettings(batch=30)

    def chosen(source):
        return api.mapping_for(source, None, {"identities": ("age_group", "gender")})

    live = tail.follower(postgres, "growing", "service", 30, chosen)
    state = None
    for rows in (None, few.slice(400, 11), few.slice(411, 489)):
        if rows is not None:
            store(postgres, "growing", rows, more=True)
        while (new := live.next()) is not None:
            state = alarm.take(state or alarm.begin(settings, new.issues), new)
    assert state is not None
    store(postgres, "at_once", few)
    caught_up = tail.follower(postgres, "at_once", "service", 30, chosen)
    new = caught_up.next()
    assert new is not None
    at_once = alarm.take(alarm.begin(settings, new.issues), new)
    np.testing.assert_array_equal(state.wealth.log_wealth, at_once.wealth.log_wealth)
    assert (state.services, state.raised) == (900, at_once.raised)
    with psycopg.connect(postgres) as con:
        con.execute("delete from growing")
    with pytest.raises(InputError, match="lost rows while it was watched"):
        live.next()
    for one in (live.source, caught_up.source):
        one.close()
