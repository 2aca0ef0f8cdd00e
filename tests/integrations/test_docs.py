"""The documentation: it builds without a warning, and every example in it runs."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)
_BLOCK = re.compile(r"^```(console|python)\n(.*?)^```$", re.M | re.S)


def examples(page: Path) -> list[tuple[str, str]]:
    """Kind and text of every example of a page, in order."""
    return [(kind, text) for kind, text in _BLOCK.findall(page.read_text(encoding="utf-8"))]


def run(words: list[str], folder: Path, **more: str) -> None:
    done = subprocess.run(
        words, cwd=folder, env=os.environ | more, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if examples(page)],
    ids=lambda page: page.relative_to(DOCS).as_posix(),
)
def test_every_example_of_a_page_runs(page: Path, tmp_path: Path):
    here = {"PATH": str(Path(sys.executable).parent) + os.pathsep + os.environ["PATH"]}
    for kind, text in examples(page):
        if kind == "python":
            run([sys.executable, "-c", text], tmp_path)
            continue
        for line in text.splitlines():
            assert line.startswith("$ "), f"{page}: {line!r} is neither command nor comment"
            run(shlex.split(line[2:]), tmp_path, **here)


class _Links(HTMLParser):
    """What a page refers to, and what can be referred to on it."""

    def __init__(self) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.loaded: set[str] = set()
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if "id" in given:
            self.names.add(given["id"])
        if tag == "a" and "href" in given:
            self.links.add(given["href"])
        elif tag in ("script", "img") and "src" in given:
            self.loaded.add(given["src"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon"):
            self.loaded.add(given["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    run([sys.executable, "-m", "sphinx", "-q", "-W", "-b", "html", str(DOCS), str(out)], DOCS)
    return out


def test_the_site_builds_without_a_warning_and_its_links_lead_somewhere(site: Path):
    read: dict[Path, _Links] = {}
    for page in site.rglob("*.html"):
        read[page] = _Links()
        read[page].feed(page.read_text(encoding="utf-8"))
    assert len(read) > len(PAGES)
    checked = 0
    for page, found in read.items():
        for link in found.links | found.loaded:
            if re.match(r"(https?|mailto):", link):
                assert link not in found.loaded, f"{page} loads {link} from elsewhere"
                continue
            path, name = urldefrag(link)
            path = unquote(path.partition("?")[0])
            target = (page.parent / path).resolve() if path else page
            assert target.exists(), f"{page}: {link}"
            if name and target in read and not name.startswith("L-"):
                assert unquote(name) in read[target].names, f"{page}: {link}"
            checked += 1
    assert checked > 500
