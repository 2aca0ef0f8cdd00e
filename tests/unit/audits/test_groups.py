"""Names of groups and what frames hold, however they are written."""

import math
from decimal import Decimal

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import pytest

from evenhand.audits.api import audit
from evenhand.audits.count.groups import text_of
from evenhand.audits.judge.results import AuditSettings
from evenhand.audits.read.mapping import Mapping
from evenhand.statistics.verdicts import VerdictSettings
from support.refusals import refused

QUICK = AuditSettings(VerdictSettings(permutations=99))
LOG = {"gender": ["f", "m"] * 30, "responded": [True, False, True] * 20}


@pytest.mark.parametrize(
    ("cell", "name"),
    [
        *((1, "1"), (1.0, "1"), ("1", "1"), ("1.0", "1"), (" 1.00 ", "1"), (Decimal("1.00"), "1")),
        *(("-7.0", "-7"), (-0.0, "0"), (Decimal("-0.0"), "0"), ("0.0", "0")),
        *(("1.05", "1.05"), (1.5, "1.5"), (Decimal("1.50"), "1.5"), (0.1, "0.1")),
        # a code is no number: a nought before it means something
        *(("01.0", "01.0"), ("1.", "1."), ("1.0.0", "1.0.0"), ("v1.0", "v1.0")),
        *((Decimal("12345678901234567891"), "12345678901234567891"),
          (Decimal("12345678901234567890"), "12345678901234567890")),
        *((Decimal("NaN"), "unknown"), (math.nan, "unknown"), ("  ", "unknown"), (True, "true")),
    ],
)  # fmt: skip
def test_names_by_hand(cell, name):
    assert text_of(cell) == name


def test_files_that_write_the_same_numbers_otherwise_have_the_same_groups(tmp_path):
    for name, cells in (("a", ("1", "2")), ("b", ("1.0", "2.0"))):
        rows = "".join(f"{cells[n % 2]},yes\n" for n in range(40))
        (tmp_path / f"{name}.csv").write_text("gender,responded\n" + rows)
    found = audit(tmp_path, settings=QUICK)
    assert [(one.group, one.n) for one in found.findings.findings] == [("1", 40), ("2", 40)]


def test_one_name_in_place_of_several():
    log = pd.DataFrame(LOG | {"site": ["x", "y", "y"] * 20})
    found = audit(log, settings=QUICK, identities="gender", within="site")
    assert (found.mapping.identities, found.mapping.within) == (("gender",), ("site",))


@pytest.mark.parametrize("edges", ["18,40", 18, ("a", "b"), [[1], [2]], None])
def test_bins_are_rising_numbers(edges):
    with refused("format bins", "'age'"):
        Mapping(bins={"age": edges})


def test_a_column_in_which_nothing_is_known_tells_nothing(tmp_path):
    columns = LOG | {"response_time": [None] * 60, "min_distance": [None] * 60}
    table = pa.table(columns)
    pyarrow.feather.write_feather(table, tmp_path / "log.arrow", compression="uncompressed")
    pyarrow.parquet.write_table(table, tmp_path / "log.parquet")
    expected = audit(pa.table(LOG), settings=QUICK).findings.findings
    for log in (table, pd.DataFrame(columns), pl.DataFrame(columns), tmp_path / "log.arrow",
                tmp_path / "log.parquet"):  # fmt: skip
        found = audit(log, settings=QUICK).findings.findings
        told = [one for one in found if one.issue == "willingness"]
        assert [(one.n, one.cases) for one in told] == [(one.n, one.cases) for one in expected]
        assert {one.n for one in found if one.issue == "risk"} == {0}


def test_a_single_column_and_columns_of_one_name_are_no_log():
    for series in (pd.Series(["f", "m"]), pl.Series(["f", "m"]), pa.chunked_array([["f", "m"]])):
        with refused("type log"):
            audit(series)
    frame = pd.DataFrame(np.array([["f", "f", 1]]), columns=["gender", "gender", "responded"])
    with refused("duplicate gender", "'gender'", "2"):
        audit(frame)
