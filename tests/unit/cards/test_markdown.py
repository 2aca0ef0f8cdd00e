"""Text from outside stays text: read back by a YAML and a Markdown library."""

import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from evenhand.report.model_cards import markdown
from evenhand.statistics.detector_accuracy import wilson

NASTY = [
    "<script>alert(1)</script>",
    "[click](javascript:alert(1))",
    "![x](http://evil.example/x.png)",
    "a | b | c",
    "**bold** _it_ `code` ~~no~~",
    "# title",
    "- item",
    "1. item",
    "=== ",
    "&lt;b&gt; &amp;",
    "x\n---\nlicense: mit\n---\n# taken",
    "```\ncode",
    "www.example.org and http://example.org and a@b.example",
    "$x$ \\( y \\) <!-- gone -->",
    "quote \" and ' and \\ back",
]


def shown(source: str) -> str:
    """Text that a reader sees of one paragraph, without anything but text in it."""
    tokens = MarkdownIt("commonmark").enable("table").enable("strikethrough").parse(source)
    assert [token.type for token in tokens] == ["paragraph_open", "inline", "paragraph_close"]
    children = tokens[1].children or []
    assert {child.type for child in children} <= {"text", "text_special"}
    return "".join(child.content for child in children)


@pytest.mark.parametrize("text", NASTY)
def test_words_show_just_their_characters(text):
    assert shown(markdown.words(text)) == " ".join(text.split())


@given(st.text(min_size=1))
def test_any_words_show_just_their_characters(text):
    if markdown.plain(text):
        assert shown(markdown.words(text)) == markdown.plain(text)


@pytest.mark.parametrize("text", NASTY)
def test_words_in_a_table_stay_in_their_cell(text):
    page = markdown.table(["a", "b"], [[markdown.words(text), "x"]])
    tokens = MarkdownIt("commonmark").enable("table").parse(page)
    cells = [tokens[i + 1] for i, token in enumerate(tokens) if token.type == "td_open"]
    assert [cell.content for cell in cells][1:] == ["x"]
    assert "".join(c.content for c in cells[0].children or []) == " ".join(text.split())


def test_no_bare_text_becomes_a_link():
    found = markdown.words("http://a.example WWW.b.example c@d.example mailto:e")
    for start in ("http://", "WWW.", "c@d", "mailto:"):
        assert start not in found


@given(st.text(), st.floats(allow_nan=False, allow_infinity=False), st.integers(), st.booleans())
def test_front_matter_is_read_back(text, real, whole, yes):
    content = {
        "name": text,
        "real": real,
        "nested": [{"a": whole, "deep": {"b": [text, yes]}}, {"c": text}],
        "gone": None,
    }
    page = markdown.front_matter(content)
    first, inside, rest = page.split("---\n") if page.count("---\n") == 2 else (None, "", None)
    assert (first, rest) == ("", "")
    kept = markdown.plain(text)
    expected = {
        "name": kept,
        "real": real,
        "nested": [{"a": whole, "deep": {"b": [kept, yes]}}, {"c": kept}],
    }
    assert yaml.safe_load(inside) == expected


@pytest.mark.parametrize("text", ["no", "1e5", "~", "a: b", "- x", "\u2028\ufeff\x85\x7f", "😀"])
def test_text_stays_text_in_yaml(text):
    inside = markdown.front_matter({"x": text}).split("---\n")[1]
    assert yaml.safe_load(inside)["x"] == markdown.plain(text)


def test_numbers_that_are_missing_are_called_so():
    assert markdown.number(None) == markdown.number(math.nan) == "not measured"
    assert markdown.number(0.12345) == "0.123"
    assert markdown.number(-1.5, places=1) == "\N{MINUS SIGN}1.5"
    assert markdown.between(None, 0.0, 1.0) == "not measured"
    assert markdown.between(0.5, None, None) == "0.500 (interval not measured)"
    assert markdown.between(0.5, 0.25, 0.75, 2) == "0.50 (0.25 to 0.75)"
    assert markdown.percent(wilson(0, 0)) == "not measured"
    # Wilson (1927) for 8 of 10, as statsmodels gives it: 0.4902 to 0.9433
    assert markdown.percent(wilson(8, 10)) == "80.0 % (49.0 to 94.3, n 10)"


def test_a_fence_is_longer_than_what_it_holds():
    page = markdown.code("```sh\nx\n```", "python")
    (block,) = MarkdownIt("commonmark").parse(page)
    assert (block.type, block.info, block.content) == ("fence", "python", "```sh\nx\n```\n")
