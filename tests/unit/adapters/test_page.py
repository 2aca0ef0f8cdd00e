"""The report of judged environments: its tables, its words, and one page that needs nothing."""

import math
import re

import numpy as np
import pytest

from evenhand.adapters import JudgeSettings, Ledger, page
from evenhand.adapters.page import Examined, findings_of
from evenhand.audits.judge.results import AuditSettings
from evenhand.core.errors import InputError
from evenhand.methods.beyond.reflection import Reflection, ReflectionSettings
from evenhand.methods.services import Services
from evenhand.statistics.verdicts import VerdictSettings
from support.ledgers import FIRST, LEFT, RIGHT, SCHEME, add
from support.refusals import refused


def ledger(windows=3, services=4, **options):
    made = Ledger(SCHEME, JudgeSettings(services), **options)
    for _ in range(windows):
        add(made, *FIRST)
    return made


QUICK = AuditSettings(VerdictSettings(permutations=99))


def test_windows_by_hand():
    data = page.windows_table({"one": ledger(2), "two": ledger(1)})
    assert data["run"].tolist() == ["one", "one", "two"]
    assert data["window"].tolist() == [0, 1, 0]
    # gaps 1 and 1/2; two of four have no issue
    assert data["total"].tolist() == pytest.approx([1.5] * 3)
    # squares without chance: 1, and 1/4 - (1/4) / 1 = 0; of two windows as one 1/4 - (1/4) / 3
    assert data["corrected"].tolist() == pytest.approx([1.0, 1.0 + (1 / 6) ** 0.5, 1.0])
    assert data["without_issue"].tolist() == [0.5] * 3
    assert data["paid"].tolist() == [0.0] * 3
    assert all(math.isnan(one) for one in data["biased"])


def test_findings_by_hand():
    found = findings_of(ledger(10), QUICK)
    left = found.findings[0]
    assert (left.identity, left.group, left.issue) == ("side", "left", "late")
    assert (left.n, left.cases, left.rest_n, left.rest_rate) == (20, 20, 20, 0.0)
    assert left.difference == 1.0
    assert left.verdict == found.verdict == "disparity"
    assert found.total == pytest.approx(1.5)
    assert found.services == 40


def test_the_page_holds_everything_and_needs_nothing(tmp_path):
    runs = {"<plain> & simple": ledger(30), "guided": ledger(20)}
    where = page.write(
        tmp_path / "r", runs, title="Sides <b>", note="Groups are made up.", settings=QUICK,
        command="python x.py",
    )  # fmt: skip
    text = where.read_text()
    assert "Sides &lt;b&gt;" in text
    assert "<plain>" not in text
    assert "Groups are made up." in text
    assert "“left” (side) met late in 100.0" in text
    assert not re.search(r"(?:src|href)=\"https?:|<script|@import", text)
    linked = set(re.findall(r'href="([^"#]+)"', text))
    assert linked
    assert all((where.parent / name).is_file() for name in linked)
    kept = Services.read_parquet(tmp_path / "r" / "services" / "plain_simple.parquet")
    assert kept == runs["<plain> & simple"].services()


def test_the_same_services_give_the_same_bytes(tmp_path):
    pages = [
        page.write(tmp_path / name, {"one": ledger(20)}, title="t", note="n", settings=QUICK)
        for name in "ab"
    ]
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_tests_are_judged_apart(tmp_path):
    even = Ledger(SCHEME, JudgeSettings(4))
    add(even, [LEFT, RIGHT] * 40, [0, 0, 1, 1] * 20, [0] * 80)
    where = page.write(
        tmp_path, {"run": ledger(20)}, tests={"run": even}, title="t", note="n", settings=QUICK
    )
    text = where.read_text()
    assert "run, tested" in text
    assert "met late" not in text
    assert (tmp_path / "services" / "run_tested.parquet").exists()


def test_services_of_every_run_have_a_file(tmp_path):
    runs = {"run 1": ledger(20), "Run-1": ledger(21), "run 1 2": ledger(22), "+": ledger(23)}
    runs["a, tested"] = ledger(24)
    page.write(
        tmp_path, runs, tests={"a": ledger(25), "-": ledger(26)}, title="t", note="n",
        settings=QUICK,
    )  # fmt: skip
    found = {
        path.stem: len(Services.read_parquet(path)) // 4
        for path in (tmp_path / "services").iterdir()
    }
    assert found == {
        "run_1": 20, "run_1_2": 21, "run_1_2_2": 22, "run": 23, "a_tested": 24,
        "a_tested_2": 25, "tested": 26,
    }  # fmt: skip


def test_an_abnormal_update_stands_among_few_others(tmp_path):
    table = np.full((2, 3), 0.125)
    parts = ("side",), ("late", "loud"), table, table, table, 0.25
    updates = [
        Reflection(*parts, False, None, None, ()),
        Reflection(*parts, True, "side", "late", ("left",)),
        Reflection(*parts, False, None, None, ()),
    ]
    examined = {"run": Examined(updates, ReflectionSettings(rate=0.5, history=3))}
    where = page.write(
        tmp_path, {"run": ledger(20)}, updates=examined, title="t", note="n", settings=QUICK
    )
    rows = re.findall(r"<tr>(.*?)</tr>", where.read_text(), re.DOTALL)
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows]
    named = [row[7:10] for row in cells if len(row) == 11]  # the row of an update
    assert named == [["not defined"] * 3, ["side", "late", "left"], ["not defined"] * 3]


@pytest.mark.parametrize(
    ("runs", "said"),
    [
        ({}, "there is no run to report"),
        ({"one": Ledger(SCHEME)}, "run 'one' has 0 services and no window of 30 is over"),
        ({"one": ledger(3, services=20)}, "run 'one' has 12 services and no window of 20"),
    ],
)
def test_nothing_to_report(runs, said, tmp_path):
    with pytest.raises(InputError, match=said):
        page.write(tmp_path, runs, title="t", note="n")


def test_runs_of_other_schemes_are_not_mixed(tmp_path):
    from support.toys import SCHEME as OTHER

    with refused("conflict run", "'two'"):
        page.write(tmp_path, {"one": ledger(), "two": Ledger(OTHER)}, title="t", note="n")


def test_no_service_no_finding():
    with refused("empty services"):
        findings_of(Ledger(SCHEME))
