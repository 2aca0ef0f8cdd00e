"""The report of a study: offline, escaped, simulated called so, the same bytes each time."""

import csv
import json
import re
from pathlib import Path

import pytest

from evenhand.report import style
from evenhand.study.analysis import page as analysis_page
from evenhand.study.analysis.analyse import Settings, analyse
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.page import Source
from evenhand.study.design.protocol import ClipSet
from evenhand.study.simulated import participants
from support.answered import judged, protocol, row
from support.pages import Page

QUICK = Settings(permutations=99, bootstraps=99)
ATTACK = "<script>alert(1)</script> & =1+1"
SOURCE = Source("answers.csv", "evenhand study analyse answers.csv", "2026-11-22")


def people(n: int = 4) -> list[dict]:
    rows = []
    for who in range(n):
        rows += judged(f"p{who}", "late", 1 + who % 2, "priority", "age", position=1)
        rows += judged(f"p{who}", "even-one", 5, "none", "none", position=2)
        rows.append(row(f"p{who}", "end", "say", value=ATTACK))
    return rows


def written(folder: Path, rows, study=None, settings=QUICK, *, pdf: bool = False) -> str:
    """The page; figures as PDF take half of the time, so they are empty if not asked for."""
    answers = Answers.of_rows(rows)
    found = analyse(answers, study, settings)
    with pytest.MonkeyPatch.context() as patch:
        if not pdf:
            patch.setattr(style, "pdf_bytes", lambda figure: b"")
        return analysis_page.write(found, answers, SOURCE, folder).read_text(encoding="utf-8")


def rendered(rows, study=None, settings=QUICK) -> str:
    """The page without figures."""
    found = analyse(Answers.of_rows(rows), study, settings)
    return analysis_page.render(found, SOURCE, [(part, []) for part in found.parts])


def two_sets():
    sets = tuple(one for one in protocol().sets if one.id in ("late", "even-one"))
    return protocol(sets=sets, pairs=())


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    written(folder, [*people(), *participants.answers(two_sets(), 6, 0).rows()], two_sets())
    return folder


def test_the_page_is_whole_and_needs_no_network(both):
    text = (both / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.attributes("script") == []
    assert not re.search(r"(?:src|href|url\()\s*=?\s*[\"'(]?(?:https?:)?//", text)
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    for attributes in page.attributes("a"):
        target = attributes["href"]
        assert target.removeprefix("#") in ids if target[0] == "#" else (both / target).is_file()


def test_free_answers_are_told_and_escaped(both):
    text = (both / "report.html").read_text(encoding="utf-8")
    assert "<script" not in text
    assert text.count("&lt;script&gt;alert(1)&lt;/script&gt; &amp; =1+1") == 4


def test_simulated_participants_have_a_section_and_files_of_their_own(both):
    page = Page((both / "report.html").read_text(encoding="utf-8"))
    headings = [a["id"] for tag, a in page.tags if tag == "section"]
    assert headings[:3] == ["sets", "people", "simulated"]
    assert any("they say nothing about people" in " ".join(text.split()) for text in page.text)
    for figure in [a["id"] for a in page.attributes("figure")]:
        assert figure.startswith(("people_", "simulated_"))
    for path in (both / "figures").glob("simulated_*.svg"):
        assert "simulated" in path.read_text(encoding="utf-8"), path
    for path in (both / "figures").glob("people_*.svg"):
        assert "simulated" not in path.read_text(encoding="utf-8"), path
    assert json.loads((both / "manifest.json").read_text())["simulated"] is True


def test_nothing_but_simulated_answers_says_so_at_the_top():
    text = rendered(participants.answers(protocol(), 5, 0).rows(), protocol())
    assert "Every answer here is simulated." in text
    assert re.search(r"<title>Evenhand: simulated answers to A small study", text)
    assert "Every answer here is simulated." not in rendered(people(), protocol())


def test_the_same_answers_give_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        written(tmp_path / name, people(2), two_sets(), pdf=True)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*.*"))
    assert len(files) > 20
    for path in files:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes(), path


def test_every_table_and_figure_is_there_as_csv_that_no_spreadsheet_runs(tmp_path):
    rows = [*people(), *judged("p9", "=set", 1, "=issue", "@identity", position=3)]
    written(tmp_path, rows)  # without a protocol names are what the file says
    for path in tmp_path.rglob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            for cells in csv.reader(file):
                for cell in cells:
                    assert not cell.startswith(("=", "@", "+")), (path, cell)
    named = (tmp_path / "data" / "people_named.csv").read_text()
    assert "'=issue" in named


def test_names_that_cannot_be_drawn_or_fit_do_no_harm(tmp_path):
    name = "\u6f22\u5b57 $x_1$ \x07 " + "long " * 20
    rows = [r for i in range(3) for r in judged(f"p{i}", name, 2, "<b>", "&")]
    Page(written(tmp_path, rows))


def test_very_small_studies_have_a_report(tmp_path):
    sets = (ClipSet("late", ("a.mp4",)),)
    for number, rows in enumerate((
        judged("p", "late", 3),
        judged("p", "late", None),
        [row("p", "end", "say")],
        [row("p", "about", "age-group", value="18-39")],
    )):  # fmt: skip
        Page(written(tmp_path / str(number), rows, protocol(sets=sets, pairs=(), checks=())))


def test_leaving_out_is_said_in_words():
    failed = [*judged("x", "late", 5), row("x", "check:look", "look", right=False)]
    settings = Settings(permutations=99, bootstraps=99, exclude_flagged=True)
    text = rendered([*people(), *failed], protocol(), settings)
    assert "1 of 5 are flagged (20.0\N{NO-BREAK SPACE}%) and left out of the results" in text
    assert "They are left out of the results above" in " ".join(text.split())
