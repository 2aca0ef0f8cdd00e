"""What is missing or malformed is refused in one sentence that says where."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from evenhand.core.errors import InputError
from evenhand.experiments.paper.report.results import SCHEMAS, read
from evenhand.report.read_tables import read_table
from support.refusals import refused


def edit(path: Path, old: str, new: str) -> None:
    """Replace the first occurrence in a file."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def test_reads_every_table_of_an_experiment(experiment: Callable[..., Path]) -> None:
    results = read(experiment(seeds=(4, 9), epochs=3, windows=10))
    assert set(results.tables) == set(SCHEMAS)
    assert len(results["epochs"]) == 2 * 4 * 2 * 3  # presets, arms, seeds, epochs
    assert results["epochs"]["guided"].tolist()[:1] == [0.0]
    assert results.manifest["seeds"] == [4, 9]
    assert results.claims[0]["id"] == "detector_agreement"


def test_kinds_of_cells(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("more,n,flag,x,name\n?, 3,True,,A b\n?,4,,2.5,C\n", encoding="utf-8")
    schema = {"name": "text", "n": "int", "flag": "flag?", "x": "number?"}
    data = read_table(path, schema)
    assert list(data.columns) == ["name", "n", "flag", "x"]
    assert data["name"].tolist() == ["A b", "C"]
    assert data["n"].tolist() == [3, 4]
    assert str(data["flag"].tolist()) == "[1.0, nan]"
    assert str(data["x"].tolist()) == "[nan, 2.5]"


@pytest.mark.parametrize("name", [*(f"data/{name}.csv" for name in SCHEMAS), "results.csv"])
def test_a_missing_table_is_named(experiment: Callable[..., Path], name: str) -> None:
    folder = experiment(epochs=2, windows=10)
    (folder / name).unlink()
    with pytest.raises(InputError, match=re.escape(f"{folder / name} is missing")):
        read(folder)


@pytest.mark.parametrize(("name", "column"), [(n, c) for n, s in SCHEMAS.items() for c in s])
def test_a_missing_column_is_named(tmp_path: Path, name: str, column: str) -> None:
    path = tmp_path / f"{name}.csv"
    others = [other for other in SCHEMAS[name] if other != column]
    path.write_text(",".join(others) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(f"{path}: column '{column}' is missing")):
        read_table(path, SCHEMAS[name])


@pytest.mark.parametrize(
    ("kind", "cell", "said"),
    [
        ("number", "lots", "is 'lots'; write a number"),
        ("number", "inf", "is 'inf'; write a finite number"),
        ("number", "", "is ''; write a number"),
        ("int", "1.5", "is '1.5'; write a whole number"),
        ("share", "35.7", "is '35.7'; write a share between 0 and 1"),
        ("share?", "-0.1", "is '-0.1'; write a share between 0 and 1"),
        ("flag", "perhaps", "is 'perhaps'; write true or false"),
        ("text", "", "is empty; write a name"),
        ("text", "a\x00b", "holds a control character"),
    ],
)
def test_a_wrong_cell_is_named(tmp_path: Path, kind: str, cell: str, said: str) -> None:
    path = tmp_path / "t.csv"
    good = {"number": "1", "int": "1", "share": "1", "flag": "true", "text": "a"}[kind.strip("?")]
    path.write_text(f"id,x\na,{good}\nb,{cell}\n", encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(f"{path}: row 3, column 'x' {said}")):
        read_table(path, {"id": "text", "x": kind})


def test_rows_of_unequal_length_no_rows_and_repeated_rows(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    schema = {"a": "text", "b": "int"}
    path.write_text("a,b\nx,1\ny\n", encoding="utf-8")
    with refused("shape row", "3", "1", "2"):
        read_table(path, schema)
    path.write_text("a,b\n", encoding="utf-8")
    with refused("empty file"):
        read_table(path, schema)
    path.write_text("", encoding="utf-8")
    with refused("empty file"):
        read_table(path, schema)
    path.write_text("a,b\nx,1\ny,2\nx,3\n", encoding="utf-8")
    with refused("duplicate row", "4", "2"):
        read_table(path, schema, ("a",))


def test_a_file_that_is_not_text(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(b"a,b\n\xff\xfe,1\n")
    with refused("format file"):
        read_table(path, {"a": "text"})


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    with refused("missing folder"):
        read(tmp_path / "nothing")


def test_broken_json_is_located(experiment: Callable[..., Path]) -> None:
    folder = experiment(epochs=2, windows=10)
    (folder / "claims.json").write_text('[\n{"id": }]', encoding="utf-8")
    with refused("format file", "claims.json", "2", "8"):
        read(folder)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("status", "maybe", "claim 1: status is 'maybe'; choose one of reproduced"),
        ("evidence", 3, "claim 1: field 'evidence' is 3; write a text"),
        ("ci95", [1], r"claim 1: ci95 is \[1\]; write \[low, high\] or null"),
        ("seeds", "five", "claim 1: seeds is 'five'; write a count, a list or null"),
    ],
)
def test_a_wrong_claim_is_named(
    experiment: Callable[..., Path], field: str, value: object, said: str
) -> None:
    folder = experiment(epochs=2, windows=10)
    claims = json.loads((folder / "claims.json").read_text())
    claims[0][field] = value
    (folder / "claims.json").write_text(json.dumps(claims), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read(folder)


def test_a_claim_without_a_field_and_a_list_without_claims(
    experiment: Callable[..., Path],
) -> None:
    folder = experiment(epochs=2, windows=10)
    (folder / "claims.json").write_text('[{"id": "a"}]', encoding="utf-8")
    with refused("missing claim", "1", "'claim'"):
        read(folder)
    (folder / "claims.json").write_text("[7]", encoding="utf-8")
    with refused("type file", "1"):
        read(folder)
    (folder / "claims.json").write_text("[]", encoding="utf-8")
    with refused("type file"):
        read(folder)


def test_a_manifest_without_a_field_or_of_a_wrong_type(experiment: Callable[..., Path]) -> None:
    folder = experiment(epochs=2, windows=10)
    edit(folder / "manifest.json", '"people": 30', '"people": "30"')
    with refused("type people", "'people'", "'30'"):
        read(folder)
    edit(folder / "manifest.json", '"people"', '"guests"')
    with refused("missing people", "'people'"):
        read(folder)
    (folder / "manifest.json").write_text("[]", encoding="utf-8")
    with refused("type file"):
        read(folder)
