"""How the pages are built: stamps, pins, sizes."""

import importlib.util
import json
from pathlib import Path

import pytest

FRONTEND = Path(__file__).resolve().parents[2] / "frontend"


@pytest.fixture
def build():
    spec = importlib.util.spec_from_file_location("evenhand_frontend", FRONTEND / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_both_pages_are_made_of_every_source(build):
    names = {path.name for path in build.sources()}
    assert {"main.ts", "walk.ts", "study.css", "index.html", "package-lock.json"} <= names
    assert [path.relative_to(build.PACKAGE).as_posix() for path in build.OUTPUTS] == [
        "restaurant/replay/static/replay.js", "study/server/static/index.html",
        "study/server/static/study.css", "study/server/static/study.js",
    ]  # fmt: skip


def test_it_is_built_only_while_every_file_is_there_and_of_these_sources(
    build, tmp_path, monkeypatch
):
    outputs = tuple(tmp_path / name for name in ("a.js", "b.css", "c.html"))
    monkeypatch.setattr(build, "OUTPUTS", outputs)
    assert not build.is_built()
    mark = build.stamp()
    for path in outputs:
        path.write_text(build.first_line(path, mark) + "rest\n")
    assert outputs[0].read_text().startswith("/* built from frontend/ ")
    assert outputs[2].read_text().startswith("<!-- built from frontend/ ")
    assert build.is_built()
    for path in outputs:
        text = path.read_text()
        path.write_text(text.replace(mark, "built from frontend/ 0"))
        assert not build.is_built()
        path.unlink()
        assert not build.is_built()
        path.write_text(text)
    source = tmp_path / "changed.ts"
    source.write_text("")
    monkeypatch.setattr(build, "HERE", tmp_path)
    monkeypatch.setattr(build, "sources", lambda: [source])
    assert not build.is_built()


def test_packages_are_pinned_by_hash_and_name_no_address():
    lock = json.loads((FRONTEND / "package-lock.json").read_text())
    wanted = json.loads((FRONTEND / "package.json").read_text())
    assert lock["name"] == wanted["name"]
    packages = {name: one for name, one in lock["packages"].items() if name}
    for name, one in packages.items():
        assert one["integrity"].startswith("sha512-"), name
        assert "resolved" not in one, name
    for name, version in wanted["devDependencies"].items():
        assert packages[f"node_modules/{name}"]["version"] == version


def test_what_the_policy_forbids_is_not_in_the_study_s_page(build, require):
    require(build.OUTPUTS[-1].is_file(), "the built pages: python frontend/build.py")
    page, style, script = (path.read_text() for path in build.OUTPUTS[1:])
    assert "style=" not in page
    assert "onclick" not in page
    assert page.count("<script") == page.count('<script src="/static/study.js" defer></script>')
    for text in (page, style, script):
        assert "eval(" not in text
        assert "new Function" not in text
    assert "SPDX-License-Identifier: MIT" in script
    assert len(page) + len(style) + len(script) < 300_000
