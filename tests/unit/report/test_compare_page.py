"""The page of a comparison, from small made-up tables: verdicts, missing numbers, hostile text."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from evenhand.core.errors import InputError
from evenhand.experiments.comparison import figures_fronts, judged_aims, read, tables, words
from evenhand.experiments.comparison import page as compare_page
from evenhand.experiments.comparison.read import Comparison
from support.compared import write_comparison, write_csv
from support.pages import Page
from support.refusals import refused


def change(path: Path, edit: Callable[[dict[str, str]], Any]) -> None:
    """Change every row of a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        edit(row)
    write_csv(path, tuple(rows[0]), rows)


def drawn_without_figures(folder: Path) -> Page:
    """The page, where the figures show nothing more."""
    return Page(compare_page.render(read.read(folder), []))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_comparison(tmp_path_factory.mktemp("compared") / "out")
    assert compare_page.build(folder) == folder / "report.html"
    return folder


@pytest.fixture(scope="module")
def page(built: Path) -> Page:
    return Page((built / "report.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def comparison(built: Path) -> Comparison:
    return read.read(built)


def test_the_tables_are_those_that_the_comparison_writes() -> None:
    assert {name: tuple(schema) for name, schema in read.SCHEMAS.items()} == {
        "results": tables.RESULTS,
        "summary": tables.SUMMARY,
        "fronts": tables.FRONTS,
    }


def test_the_page_stands_alone_and_is_well_formed(built: Path, page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    links = [a["href"] for _, a in page.tags if "href" in a]
    assert {link[1:] for link in links if link.startswith("#")} <= set(ids)
    assert all((built / link).is_file() for link in links if not link.startswith("#"))
    assert not {"script", "img", "link", "iframe"} & {tag for tag, _ in page.tags}
    assert not re.search(r"url\((?!#)|@import", (built / "report.html").read_text())
    shown = [int(tag[1]) for tag, _ in page.tags if tag in ("h1", "h2", "h3")]
    assert shown[0] == 1
    assert shown.count(1) == 1
    assert {path.name for path in (built / "figures").iterdir()} == {
        f"{name}{end}" for name in ("compare_ppo", "hypervolume")
        for end in (".svg", "-narrow.svg", ".pdf", ".csv")
    }  # fmt: skip


def test_the_same_tables_give_the_same_bytes(built: Path) -> None:
    again = [compare_page.render(read.read(built), []) for _ in range(2)]
    assert again[0] == again[1]


def test_head_says_what_was_compared(page: Page) -> None:
    text = text_of(page)
    assert "6 arms in 3 scenarios (even, prejudiced, tips) with PPO" in text
    assert "synthetic people" in text
    for fact in ("Runs 180", "Seeds an arm 10 (from 0 to 9)", "300 epochs × 30 services",
                 "5,000 services a run", "Computing 2.0 h", "Commit not known"):  # fmt: skip
        assert fact in text


def cells(judged: judged_aims.Judged, scenario: str) -> Mapping[str, Any]:
    [line] = [line for line in judged.lines if line.scenario == scenario]
    return dict(zip(judged_aims.AIMS, line.cells, strict=True))


def test_verdicts_by_hand(comparison: Comparison) -> None:
    levelup, surgery = judged_aims.judge(comparison)
    assert (levelup.arm, surgery.arm) == ("level-up", "surgery")
    good = cells(levelup, "tips")
    # 0.45 of 0.50 attained; +1 point; +30 points; 0.8 against ELBERT's 0.7
    assert [cell.state for cell in good.values()] == ["reached"] * 5
    assert good["Corrected total"].value == "90.0\xa0% attained"
    assert good["Corrected total"].interval == "[89.9\xa0%, 90.1\xa0%]"
    assert good["Perfect services"].value == "+1.0 points"
    assert good["Worst-served group"].interval == "[+29.9, +30.1]"
    assert good["Hypervolume"].why == "best rival ELBERT-PO 0.700"
    bad = cells(surgery, "prejudiced")
    assert [cell.state for cell in bad.values()] == ["not reached"] * 5
    assert bad["Perfect services"].value == "\N{MINUS SIGN}5.0 points"
    # of 0.3, 60 % is willingness
    assert bad["Corrected total"].why.endswith(
        "most of what is left is willingness, 0.180 of 0.300"
    )
    even = cells(levelup, "even")
    assert [cell is None for cell in even.values()] == [True, True, True, False, False]


def test_a_part_above_the_total_is_not_called_most_of_it(tmp_path: Path) -> None:
    folder = write_comparison(tmp_path / "out")

    def raise_willingness(row: dict[str, str]) -> None:
        if row["metric"] == "corrected_willingness":  # another part is below 0, then
            row["iqm"] = row["low"] = row["high"] = "0.35"

    change(folder / "summary.csv", raise_willingness)
    _, surgery = judged_aims.judge(read.read(folder))
    why = cells(surgery, "prejudiced")["Corrected total"].why
    assert why.endswith("; its largest part is willingness, 0.350; parts can be below 0")


def test_aims_over_scenarios_by_hand(comparison: Comparison) -> None:
    levelup, surgery = judged_aims.judge(comparison)
    whole = [(aim, cell.state, cell.value) for aim, _, cell in levelup.whole]
    assert whole == [
        ("Biased epochs in training", "reached", "92.0\xa0% fewer"),  # 4 of 50
        ("Hypervolume in 6 of 8 scenarios", "cannot be told", "in 3 of 8"),  # five were not run
    ]
    # surgery: 20 of 50; hypervolume missed in three scenarios, so six cannot be reached
    assert [cell.state for _, _, cell in surgery.whole] == ["not reached"] * 2
    # two scenarios by three aims, three by two, biased epochs, hypervolume over scenarios
    assert [(state, n) for state, _, n in levelup.counts] == [
        ("reached", 13), ("not reached", 0), ("cannot be told", 1),
    ]  # fmt: skip
    assert "Hypervolume: reached in all 3 cases." in levelup.words
    assert "Corrected total: not reached in both cases." in surgery.words


def test_what_guidance_adds_comes_first(comparison: Comparison, page: Page, tmp_path: Path) -> None:
    assert judged_aims.added(comparison) == [
        "The control blind (a cost of issues without groups) was not run. So nothing here tells "
        "better service from fairness."
    ]
    folder = write_comparison(tmp_path / "out")

    def rename(row: dict[str, str]) -> None:
        row["arm"] = {"elbert": "blind"}.get(row["arm"], row["arm"])
        if (row["scenario"], row["metric"]) == ("tips", "corrected_total") and "iqm" in row:
            row["to_blind"], row["to_blind_low"], row["to_blind_high"] = "0.01", "-0.01", "0.03"

    for name in ("results", "summary"):
        change(folder / f"{name}.csv", rename)
    [sentence] = judged_aims.added(read.read(folder))
    # 0.05 less 0.15, ± 0.001, but in tips
    assert sentence == (
        "PPO: In tips (0.010) level-up adds nothing to a cost without groups that these seeds "
        "show. In even (\N{MINUS SIGN}0.100), prejudiced (\N{MINUS SIGN}0.100) level-up is more "
        "even than a cost without groups."
    )
    text = text_of(page)
    assert text.index("What does guidance add to better service?") < text.index("Were the aims")


def test_verdicts_have_icon_and_words(page: Page) -> None:
    text = text_of(page)
    assert "✓ reached 90.0 % attained 95 % [89.9 %, 90.1 %]" in text
    assert "✗ not reached" in text
    assert "? cannot be told in 3 of 8" in text
    assert "How to read this." in text
    assert "no aim here" in text


def test_other_strengths_are_judged_only_without_the_standard_one(tmp_path: Path) -> None:
    folder = write_comparison(tmp_path / "out")

    def rename(row: dict[str, str]) -> None:
        row["arm"] = {"levelup": "levelup@2"}.get(row["arm"], row["arm"])

    for name in ("results", "summary"):
        change(folder / f"{name}.csv", rename)
    assert judged_aims.judged_arms(read.read(folder)) == ["levelup@2", "surgery"]
    assert read.arm_label("levelup@2") == "level-up, strength 2"


def test_scenarios_are_shown_by_four_robots(comparison: Comparison) -> None:
    table = words.scenario_table(comparison)
    assert table[0][:2] == ("even", "nothing is uneven")
    lines = dict(table[2][2])
    assert list(lines) == ["untrained", "service alone, PPO", "reference robot"]
    assert [cell.value for cell in lines["service alone, PPO"]] == [
        "0.500", "0.800", "90.0\xa0%", "50.0\xa0%", "1.000",
    ]  # fmt: skip
    assert lines["reference robot"][0].interval == "[\N{MINUS SIGN}0.001, 0.001]"


def test_every_row_of_the_summary_is_in_the_page(comparison: Comparison) -> None:
    full = dict(words.full_table(comparison))
    assert sum(map(len, full.values())) == len(comparison.summary)
    assert full["tips"][0][:5] == [
        "", "reference robot", "corrected total", "10",
        "0.000 [\N{MINUS SIGN}0.001, 0.001]",
    ]  # fmt: skip
    [row] = [row for row in full["tips"] if row[1:3] == ["surgery", "perfect rate"]]
    assert row[5].startswith("\N{MINUS SIGN}0.050 [")
    assert row[8] == ""  # a share is of the corrected total alone


def test_limits_are_composed(comparison: Comparison) -> None:
    said = dict(words.limits(comparison))
    assert set(said) == {"Scenarios not run.", "Arms not run.", "Code."}
    assert said["Scenarios not run."].startswith("perception, minority, everyday, hidden, hurry:")


def test_one_seed_is_said_and_decides_nothing(tmp_path: Path) -> None:
    folder = write_comparison(tmp_path / "out", seeds=1)
    text = text_of(drawn_without_figures(folder))
    assert "1 seed an arm, where the aims ask for 10." in text
    assert "With one seed there is no interval, and no aim can be told." in text
    assert "0 reached ✗ 0 not reached" in text
    assert "95 % [" not in text
    assert not re.search(r"\b(nan|NaN|None)\b", text)


def test_few_and_unequal_seeds_are_said(tmp_path: Path) -> None:
    folder = write_comparison(
        tmp_path / "out", seeds=3, settings={"epochs": 9, "services": 600},
        commit={"hash": "ab" * 20, "changed": True}, earlier={"created": "then", "version": "0"},
    )  # fmt: skip

    def fewer(row: dict[str, str]) -> None:
        row["seeds"] = "2" if row["arm"] == "elbert" else row["seeds"]

    change(folder / "summary.csv", fewer)
    said = dict(words.limits(read.read(folder)))
    assert said["Few seeds."].startswith("2 to 3 seeds an arm, where the aims ask for 10. An inter")
    assert said["Unequal seeds."].startswith("Arms have 2 to 3 seeds.")
    assert "Rows of all scenarios use the seeds that an arm has in each" in said["Unequal seeds."]
    assert said["Short tests."].startswith("600 services a run")
    assert "changed since the commit" in said["Code."]
    assert said["Earlier runs."].startswith("Some runs were taken from a comparison of then, ")
    assert said["Several commits."] == (
        "Runs were made by the code of ababababab. Of some runs it is not known."
    )
    assert "Other versions." not in said


def test_where_all_runs_are_earlier_ones_their_code_and_time_are_told(tmp_path: Path) -> None:
    earlier = {"created": "then", "version": "0", "commit": {"hash": "ab" * 20, "changed": False}}
    folder = write_comparison(
        tmp_path / "out", runs=0, run_seconds=0, earlier=earlier | {"run_seconds": 36_000},
        commit={"hash": "cd" * 20, "changed": True},
    )  # fmt: skip
    said = dict(words.limits(read.read(folder)))
    assert said["Earlier runs."] == (
        "All runs were taken from a comparison of then, version 0, commit ababababab."
    )
    assert "Code." not in said  # what was changed since wrote the page alone
    text = text_of(drawn_without_figures(folder))
    assert "Computing 10.0 h" in text
    assert "Commit ababababab" in text
    assert "all from an earlier comparison" in text


def test_missing_numbers_stay_missing(tmp_path: Path) -> None:
    folder = write_comparison(tmp_path / "out")
    numbers = ("iqm", "low", "high", "share", "difference", "improvement")

    def forget(row: dict[str, str]) -> None:
        if row["scenario"] == "tips" and row["metric"] != "raw_total":
            row.update((name, "") for name in row if name.startswith(numbers))

    change(folder / "summary.csv", forget)
    change(folder / "results.csv", lambda row: row.update(value="") if row["seed"] == "0" else None)
    change(folder / "fronts.csv", lambda row: row.update(hypervolume="", low="", high=""))
    text = text_of(drawn_without_figures(folder))
    assert text.count("? cannot be told not defined a number is missing") > 3
    # one seed's numbers of 18 arms and 10 metrics; biased epochs of 6 that learn nothing are none
    assert "174 of 1,800 numbers of runs are not defined" in text
    assert not re.search(r"\b(nan|NaN|None)\b", text)
    assert figures_fronts.draw_all(read.read(folder).fronts) == []


def test_hostile_text_is_shown_and_never_run(tmp_path: Path) -> None:
    evil = '<script>alert(1)</script>"><img src=x onerror=alert(1)> $x_1$'
    folder = write_comparison(
        tmp_path / "out", scenarios=("tips",), command=evil, created=evil,
        version=evil, versions={evil: evil},
        settings={"epochs": 3, "services": 300, evil: evil},
        commit={"hash": evil, "changed": False},
    )  # fmt: skip
    for name in ("results", "summary", "fronts"):
        change(
            folder / f"{name}.csv",
            lambda row: row.update(scenario=evil) if row["scenario"] == "tips" else None,
        )
    page = Page(compare_page.build(folder).read_text(encoding="utf-8"))
    assert not {"script", "img"} & {tag for tag, _ in page.tags}
    assert not any("onerror" in attributes for _, attributes in page.tags)
    assert "".join(page.text).count("<script>alert(1)</script>") >= 8


@pytest.mark.parametrize(
    ("name", "edit", "said"),
    [
        ("summary", {"iqm": "high"}, r"summary\.csv: row 2, column 'iqm' is 'high'"),
        ("fronts", {"method": "service"}, r"fronts\.csv: row 3 repeats row 2"),
    ],
)
def test_a_malformed_table_stops_the_page_before_anything_is_written(
    tmp_path: Path, name: str, edit: dict[str, str], said: str
) -> None:
    folder = write_comparison(tmp_path / "out")
    change(folder / f"{name}.csv", lambda row: row.update(edit))
    with pytest.raises(InputError, match=said):
        compare_page.build(folder)
    assert not (folder / "figures").exists()
    assert not (folder / "report.html").exists()


def test_an_unknown_arm_is_named_with_the_nearest_that_there_is(tmp_path: Path) -> None:
    folder = write_comparison(tmp_path / "out")
    spelling = {"levelup": "levlup"}
    change(
        folder / "summary.csv",
        lambda row: row.update(arm=spelling.get(row["arm"], row["arm"])),
    )
    with refused(
        "unknown arm",
        "'levelup'",
    ):
        compare_page.build(folder)


@pytest.mark.parametrize(
    ("manifest", "said"),
    [
        ({"command": 3}, "field 'command' is 3, of a wrong type"),
        ({"settings": {"epochs": 3}}, "settings need a whole number of services"),
    ],
)
def test_a_malformed_manifest_is_named(tmp_path: Path, manifest: Any, said: str) -> None:
    folder = write_comparison(tmp_path / "out", **manifest)
    with pytest.raises(InputError, match=said):
        compare_page.build(folder)
