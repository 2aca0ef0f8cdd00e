"""The card: whole, offline, harmless, readable without eyes for colour or without eyes."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import pairwise

import pytest

from evenhand.audits.show import card, figures
from evenhand.report import style
from support import pages

NAN = math.nan


class Page(pages.Page):
    """With its words as one text."""

    @property
    def words(self) -> str:
        """All that a reader sees, signs as on a keyboard."""
        return " ".join(" ".join(self.text).split()).replace("\N{MINUS SIGN}", "-")


@pytest.fixture(scope="module")
def cache():
    return {}


@pytest.fixture
def html(cache, made_up, about):
    if "html" not in cache:
        cache["html"] = card.render(made_up(), about)
    return cache["html"]


@pytest.fixture
def page(html):
    return Page(html)


@pytest.fixture
def small(made_up, one):
    """Findings with one identity and issue, quick to draw."""

    def make(*groups: str, **other):
        found = [one("site", group, "risk", (2, 10), (3, 20)) for group in groups]
        nothing = {"waits": (), "measures": (), "resemblance": (), "verdict": "no evidence"}
        return made_up(findings=tuple(found), **(nothing | other))

    return make


def test_it_is_well_formed_and_has_one_heading_above_all_others_in_order(page):
    assert page.attributes("html") == [{"lang": "en"}]
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    named = [a[k] for _, a in page.tags for k in ("aria-labelledby",) if k in a]
    inside = [a["href"][1:] for a in page.attributes("a")]
    assert {*named, *inside} <= set(ids)
    assert len(page.attributes("main")) == 1


def test_it_needs_no_script_no_network_and_no_other_file(html, page):
    assert "http:" not in html
    assert "https:" not in html
    assert "@import" not in html
    assert not {"script", "link", "img", "iframe", "object", "base"} & {t for t, _ in page.tags}
    assert all(a["href"].startswith("#") for a in page.attributes("a"))
    assert all(found == "#" for found in re.findall(r"url\((.)", html))
    assert not any(name.startswith("on") for _, a in page.tags for name in a)


def test_the_verdict_is_a_badge_with_words(page):
    (badge,) = [i for i, a in enumerate(page.tags) if a[1].get("class") == "badge"]
    assert page.tags[badge + 1][1]["class"] == "status disparity"
    assert page.words.count("Disparity") >= 1
    assert "Disparity: in 3 of 32 comparisons" in page.words
    assert "disparity: 3 – no evidence: 17 ? insufficient data: 12" in page.words


def test_every_number_of_every_finding_is_there(page):
    text = page.words
    for row in (  # written by hand from the made-up counts
        "Elder willingness ! disparity 30.0 % (72 of 240) 12.0 % of 760 +18.0 [+13.0, +23.0] "
        "17.0 < 0.001",
        "quality – no evidence 15.0 % (36 of 240) 12.0 % of 760 +3.0 [-2.0, +8.0] 2.0 0.900",
        "Child willingness ! disparity 5.0 % (8 of 160) 18.8 % of 840 -13.8 [-18.8, -8.8] "
        "12.8 0.012",
        "Female willingness – no evidence 12.0 % (60 of 500) 11.6 % of 500 +0.4 [-4.6, +5.4] "
        "-0.6 0.900",
        "visitor willingness ? insufficient data 42.9 % (3 of 7) 16.4 % of 993 "
        "+26.4 [+21.4, +31.4] 25.4 0.900 12,345",
        "unknown willingness ? insufficient data not known (0 of 0) 16.6 % of 1,000 not known "
        "not known not known",
        "Elder (age) 240 160 not reached 55.0 % [49.0, 61.0] 15.0 % +40.0 [+33.0, +46.0] < 0.001",
        "unknown (age) 0 0 not known not known 20.0 % not known not known",
        "Elder (age) smiles 240 1.25 2.50 0.002 1.00 2.00 0.060",
        "age 0.14 0.03 0.03 0.12 42.0 % 11.0 % ageism",
        "badge not known not known not known not known not known not known none named",
    ):
        assert row in text, row
    assert "nan" not in text.lower().split()


def test_data_mapping_limits_and_how_to_repeat_it_are_there(page):
    for said in (
        "Synthetic log. No real person was served.",
        "from not known",
        "response time waited s",
        "a response after more than 4 s",
        "The log has no column for the tone of voice.",
        "Association is not cause.",
        "evenhand audit fleet.parquet --seed 7",
        "verdict.permutations 2000",
        "seed 7",
        "simulated respondents",
    ):
        assert said in page.words.replace("2,000", "2000"), said


def test_every_figure_has_words_and_every_table_heads(page):
    images = [a["aria-label"] for a in page.attributes("div") if a.get("role") == "img"]
    assert len(images) == len(set(images)) == 4  # three identities and waiting
    assert "Elder, willingness: +18.0 points" in images[0]
    assert "No disparity." in images[1]
    assert sum(tag == "figcaption" for tag, _ in page.tags) == 4
    assert all(a.get("scope") in ("col", "row", "rowgroup") for a in page.attributes("th"))
    assert all(a.get("aria-hidden") == "true" for a in page.attributes("svg"))
    regions = [a for a in page.attributes("div") if a.get("role") == "region"]
    assert all(a.get("aria-label") and a.get("tabindex") == "0" for a in regions)
    figure = [place for place, (tag, _) in enumerate(page.tags) if tag == "figure"]
    for start, stop in zip(figure, [*figure[1:], len(page.tags)], strict=True):
        assert "table" in [tag for tag, _ in page.tags[start:stop]]


def test_names_from_the_log_are_shown_and_never_run(small, about):
    evil = '</svg><script>alert(1)</script>"><img src=x onerror=alert(1)> {{ 7*7 }} $x_1$'
    found = small(evil, "\u202eturned\x00\nround")
    found = replace(found, findings=tuple(replace(f, identity=evil) for f in found.findings))
    hostile = replace(
        about,
        title=evil,
        log={evil: evil},
        mapping=((evil, evil, evil),),
        command=evil,
        within=evil,
        judges=evil,
        left_out=(evil,),
        meanings={evil: evil},
    )
    html = card.render(found, hostile)
    page = Page(html)
    assert not {"script", "img"} & {tag for tag, _ in page.tags}
    assert not any("onerror" in attributes for _, attributes in page.tags)
    assert "".join(page.text).count("<script>alert(1)</script>") >= 12
    assert "{{ 7*7 }}" in page.words
    assert not set("\u202e\x00") & set(html)
    assert "�turned��round" in html


def test_the_same_findings_give_the_same_bytes(html, made_up, about):
    assert card.render(made_up(), about) == html


def test_other_findings_give_another_badge_and_leave_out_what_is_not_there(small, about):
    page = Page(card.render(small("a", "b"), replace(about, synthetic=False)))
    classes = [a.get("class") for a in page.attributes("span")]
    assert classes[0] == "status no-evidence"
    assert "status disparity" in classes  # counted as none
    assert "disparity: 0" in page.words
    assert "Synthetic" not in page.words
    sections = [a["id"] for a in page.attributes("section")]
    assert sections == ["summary", "groups", "data", "method", "limits", "repeat"]


def test_combined_groups_show_their_shrunk_rates(small, about):
    found = small("a", "b")
    both = tuple(replace(f, identity="x × y", group=f"{f.group} × c", shrunk=0.1875)
                 for f in found.findings)  # fmt: skip
    text = Page(card.render(replace(found, findings=both), about)).words
    assert "Adjusted p Shrunk rate" in text
    assert "0.900 18.8 %" in text
    assert "Shrunk rate" not in Page(card.render(found, about)).words


def test_a_log_with_many_groups_draws_some_and_lists_all(small, about, one):
    found = small(*(f"g{i:03}" for i in range(60)))
    last = one("site", "g059", "risk", (1, 3), (3, 20), "disparity")
    found = replace(found, findings=(*found.findings[:-1], last))
    drawn = figures.drawn_groups(found, "site")
    assert len(drawn) == 40
    assert "g059" in drawn
    page = Page(card.render(found, about))
    assert "Drawn: 40 of 60 groups." in page.words
    names = [f"g{i:03} risk" for i in range(60)]
    assert all(name in page.words for name in names)
    assert all("open" not in a for a in page.attributes("details"))


def test_letters_that_the_font_lacks_are_left_to_the_browser(small, about):
    assert "日本語" in Page(card.render(small("日本語", "b"), about)).words


def positions(figure, colour):
    """Where the markers of a colour stand, from left to right."""
    return sorted(
        round(float(x), 6)
        for ax in figure.axes
        for line in ax.get_lines()
        if line.get_marker() in ("o", "s") and line.get_color() == colour
        for x in line.get_xdata()
    )


def test_the_figure_draws_the_numbers(made_up):
    with style.drawing():
        wide = figures.differences(made_up(), "age")
        narrow = figures.differences(made_up(), "age", wide=False)
    gaps = [100 * (8 / 160 - 158 / 840), *[100 * (72 / 240 - 91 / 760)] * 2]
    for figure in (wide, narrow):
        assert positions(figure, style.VERMILLION) == pytest.approx(gaps, abs=1e-5)
        assert [ax.get_title(loc="left") for ax in figure.axes] == [
            "willingness", "quality", "priority", "risk",
        ]  # fmt: skip
    with style.drawing():
        empty = figures.differences(made_up(), "badge")
    assert [t.get_text() for ax in empty.axes for t in ax.texts] == ["not known"] * 4


def test_the_figure_of_waiting_draws_the_numbers(made_up):
    with style.drawing():
        figure = figures.waiting(made_up())
    assert positions(figure, style.VERMILLION) == [55.0]
    assert positions(figure, style.BLUE) == [10.0, 17.0]


@pytest.mark.parametrize(
    ("name", "letters", "said"),
    [
        ("Elder", 15, "Elder"),
        ("Native Hawaiian", 10, "Native Ha…"),
        ("日本語日本語", 8, "日本語…"),
        ("Black or African American × Female", 20, "Black or A… × Female"),
        ("a" * 30 + " × " + "b" * 30, 15, "aaaaa… × bbbbb…"),
    ],
)
def test_long_names_are_cut_where_least_is_lost(name, letters, said):
    assert figures.elided(name, letters) == said


def test_a_headline_of_no_evidence_says_how_much_could_be_told(made_up, about, one):
    known = [one("gender", group, "risk", (1, 9), (1, 9)) for group in ("a", "b")]
    few = [one("age", group, "risk", (0, 2), (1, 7), "insufficient data") for group in "cde"]
    part = card.render(made_up(findings=(*known, *few), verdict="no evidence"), about)
    said = "o evidence in 2 of 5 comparisons, too few services in the others"
    assert f": n{said}</title>" in part
    assert f"</span>N{said}</span>" in part
    assert card.headline(made_up(findings=known, verdict="no evidence")) == "no evidence"
    assert card.headline(made_up()) == "disparity"
