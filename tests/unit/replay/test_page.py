"""The file: whole, alone, small, and safe with any title."""

import json

import pytest

from evenhand.core.errors import InputError
from evenhand.restaurant.replay import page
from support import replayed
from support.pages import Page
from support.refusals import refused

SCRIPT = "document.title;"
NASTY = "</script><script>alert('&')</script>"


@pytest.fixture(scope="module")
def served():
    return replayed.served(4)


@pytest.fixture(scope="module")
def content(served):
    return page.payload(*served)


@pytest.fixture
def built(monkeypatch, tmp_path):
    """A script that stands in for the built one."""
    path = tmp_path / "replay.js"
    path.write_text(SCRIPT)
    monkeypatch.setattr(page, "SCRIPT", path)
    return path


def data_of(text):
    return json.loads(text.split('id="replay-data">')[1].split("</script>")[0])


def test_the_page_holds_what_it_was_told(content):
    text = page.render(content, SCRIPT, "Ours", "Chosen by hand.")
    assert data_of(text) == content
    read = Page(text)
    assert "Ours" in read.text
    assert "Chosen by hand." in " ".join(read.text)
    assert [s.get("type", "") for s in read.attributes("script")] == ["application/json", ""]


def test_a_title_and_a_note_are_text_and_nothing_else(content):
    text = page.render(content, SCRIPT, NASTY, NASTY)
    read = Page(text)
    assert len(read.attributes("script")) == 2
    assert NASTY in read.text
    assert "<script>alert" not in text


def test_names_in_the_data_cannot_end_their_element():
    told = {"who": [NASTY, "<!--", "]]>"]}
    text = page.as_json(told)
    assert not set("<>&") & set(text)
    assert json.loads(text) == told


def test_the_page_asks_for_no_other_file(content):
    read = Page(page.render(content, SCRIPT, "Ours"))
    for name, attributes in read.tags:
        for attribute in ("src", "href", "action", "poster", "srcset", "data"):
            address = attributes.get(attribute)
            assert address is None or address.startswith(("#", "data:")), (name, address)
    rule = next(m["content"] for m in read.attributes("meta") if "http-equiv" in m)
    assert rule.startswith("default-src 'none';")


def test_the_same_services_give_the_same_bytes(served, built, tmp_path):
    seen, rows = served
    one, two = (page.write(seen, rows, tmp_path / name) for name in ("1.html", "2.html"))
    assert one.read_bytes() == two.read_bytes()


def test_a_page_that_is_there_is_replaced(served, built, tmp_path):
    path = tmp_path / "replay.html"
    path.write_text("older")
    assert page.write(served[0], served[1], path) == path
    assert path.read_text().startswith("<!DOCTYPE html>")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["replay.html", "replay.js"]


def test_thirty_services_are_at_most_three_megabytes(require, tmp_path):
    require(page.SCRIPT.exists(), "the built replay page: python frontend/build.py")
    seen, rows = replayed.served(30)
    path = page.write(seen, rows, tmp_path / "replay.html")
    assert 500_000 < path.stat().st_size <= 3_000_000


def test_a_script_that_has_not_been_built(served, monkeypatch, tmp_path):
    monkeypatch.setattr(page, "SCRIPT", tmp_path / "none.js")
    with refused("unavailable script", "build.py"):
        page.write(served[0], served[1], tmp_path / "replay.html")
    assert not (tmp_path / "replay.html").exists()


@pytest.mark.parametrize("number", [0, 301])
def test_too_few_and_too_many_services(served, built, tmp_path, number):
    seen, rows = served
    some = seen[[0] * number]
    with pytest.raises(InputError, match=rf"^{number} services .* name 1 to 300"):
        page.write(some, rows, tmp_path / "replay.html")
