"""The rules of the house that no linter knows. `make check` and `make test` both hold them."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from evenhand.core import extras
from evenhand.core.errors import KINDS
from evenhand.methods import vocabulary
from evenhand.restaurant import people

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
LONGEST = 600

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
BASE = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]


def declared(lines: Iterable[str]) -> set[str]:
    """Names of packages, but for Evenhand's own extras."""
    return {re.split(r"[^\w.-]", line)[0] for line in lines} - {"evenhand"}


def brought(extra: str) -> set[str]:
    """Names of the packages that an extra brings, and those that it is built on."""
    found = declared(EXTRAS[extra])
    for line in EXTRAS[extra]:
        own = re.fullmatch(r"evenhand\[(.*)\]", line)
        for other in own[1].split(",") if own else ():
            found |= brought(other)
    return found


DEPENDENCIES = sorted(declared([*BASE, *(line for lines in EXTRAS.values() for line in lines)]))


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def undocumented(tree: ast.Module) -> Iterator[str]:
    """What others can see and has no docstring: module, classes, functions, methods."""
    if not ast.get_docstring(tree):
        yield "the module"
    todo: list[tuple[str, ast.Module | ast.ClassDef]] = [("", tree)]
    while todo:
        prefix, parent = todo.pop()
        for node in parent.body:
            if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            if node.name.startswith("_"):
                continue
            if not ast.get_docstring(node):
                yield f"{prefix}{node.name} (line {node.lineno})"
            if isinstance(node, ast.ClassDef):
                todo.append((f"{prefix}{node.name}.", node))


@pytest.fixture(scope="module")
def tracked(require) -> list[Path]:
    """Every file of the project that git holds or would take in."""
    asked = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    require(asked.returncode == 0, "a git checkout of the project")
    return [path for line in asked.stdout.split("\0") if line and (path := ROOT / line).is_file()]


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_everything_public_has_a_docstring(path):
    assert list(undocumented(ast.parse(path.read_text()))) == []


def test_the_search_for_docstrings_finds_what_is_missing():
    tree = ast.parse("class A:\n  def b(self): ...\n  def _c(self): ...\ndef d():\n  'said'")
    assert list(undocumented(tree)) == ["the module", "A (line 1)", "A.b (line 2)"]


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_a_room_is_short_enough_to_read(path):
    assert len(path.read_text().splitlines()) <= LONGEST


def test_the_papers_idea_is_read_in_one_sitting():
    paper = [path for path in SOURCES if path.parent.match("methods/paper")]
    assert len(paper) == 6
    assert sum(len(path.read_text().splitlines()) for path in paper) < 1000


def test_there_are_rooms():
    assert ROOT / "src" / "evenhand" / "__init__.py" in SOURCES


# Written in pieces, so that this file does not hold what it looks for.
REGISTRIES = (
    "pypi" + ".org",
    "python" + "hosted",
    "npm" + "js",
    "crates" + ".io",
    "proxy.go" + "lang",
)
FORBIDDEN = re.compile(
    "|".join(
        [
            *(rf"//[\w.-]*{re.escape(address)}" for address in REGISTRIES),
            r"(?:--|\b)(?:extra-)?(?:index|registry)[-_]url\b",
            r"/(?:root|home/\w+|Users/\w+)/",
            re.escape(str(ROOT)) + r"\b",
        ]
    )
)


def test_no_file_names_a_registry_or_a_place_on_one_machine(tracked):
    found = [
        f"{name(path)}:{number}: {match.group()}"
        for path in tracked
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
        if path != Path(__file__) and (match := FORBIDDEN.search(line))
    ]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "see https://" + "pypi.org/project/x",
        "--extra-index-url x",
        "open('/" + "root/x')",
        f"cd {ROOT}",
    ],
)
def test_the_search_for_addresses_finds_them(line):
    assert FORBIDDEN.search(line)


def test_the_changelog_has_room_for_the_next_change():
    assert re.search(r"^## \[Unreleased\]$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)


@pytest.mark.parametrize("dependency", DEPENDENCIES)
def test_contributing_says_what_a_dependency_is_for(dependency):
    row = rf"^\| `{re.escape(dependency)}` \| [^|]*\w[^|]* \|"
    assert re.search(row, (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)


MOST_ENTRIES = 12


def test_who_lists_the_package_sees_at_once_what_it_is():
    entries = {path.relative_to(ROOT / "src" / "evenhand").parts[0] for path in SOURCES}
    assert len(entries) <= MOST_ENTRIES


def distribution(module: str) -> str:
    """The package that a module is imported from, as its project is called."""
    (found, *_) = packages_distributions().get(module, [module])
    plain = re.sub(r"[-_.]+", "-", found.lower())
    return {"mujoco-core": "mujoco"}.get(plain, plain)


def imported(tree: ast.Module) -> Iterator[str]:
    """Modules that are imported anywhere, by their first name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.partition(".")[0]


def test_what_is_imported_is_declared_and_nothing_else():
    """What another package happens to bring may go with its next version."""
    every = {one for path in SOURCES for one in imported(ast.parse(path.read_text()))}
    foreign = every - set(sys.stdlib_module_names) - {"evenhand"}
    known = declared(BASE).union(*(brought(extra) for extra in EXTRAS if extra != "dev"))
    assert {distribution(one) for one in foreign} == known


@pytest.mark.parametrize("extra", [extra for extra in EXTRAS if extra != "dev"])
def test_what_an_extra_brings_is_known_where_it_is_missed(extra):
    found = {distribution(module) for module in extras.EXTRAS[extra]}
    # by way of minari[hdf5]
    assert found - {"h5py"} == brought(extra)


def test_every_extra_but_the_largest_is_for_development_too():
    every = set().union(*(brought(extra) for extra in EXTRAS if extra not in ("dev", "sb3")))
    assert every <= brought("dev")


def test_nothing_says_that_evenhand_is_in_a_registry(tracked):
    """It is installed from a clone."""
    wanted = re.compile(r"pip install (-\S+ )*['\"]?even" + r"hand\b|even" + r"hand\[")
    found = [
        f"{name(path)}:{number}"
        for path in tracked
        if path.suffix in (".py", ".md", ".toml", ".txt") and path.name != "pyproject.toml"
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if wanted.search(line)
    ]
    assert found == []


ROOMS = sorted(
    path.name if path.is_file() else f"{path.name}/"
    for path in (ROOT / "src" / "evenhand").iterdir()
    if not path.name.startswith("__")
)


@pytest.mark.parametrize("room", ROOMS)
def test_contributing_shows_every_room_of_the_house(room):
    row = rf"^  {re.escape(room)} +\w"
    assert re.search(row, (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)


def test_constraints_pin_exactly_and_hold_every_dependency():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.+!-]+", line)] == []
    pinned = {re.sub(r"[-_.]+", "-", line.split("==")[0].lower()) for line in lines}
    assert [dependency for dependency in DEPENDENCIES if dependency not in pinned] == []


def test_the_citation_names_this_version():
    version = PROJECT["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()


def test_both_pillars_call_identities_and_discriminations_alike():
    # Judgement and world never import each other, so nothing but this keeps their words together.
    asked = dict(zip(vocabulary.IDENTITIES, vocabulary.DISCRIMINATIONS, strict=True))
    assert asked.items() <= people.DISCRIMINATION.items()


def codes_of(tree):
    """First arguments of the errors that a file makes: what they begin with, and whether a field
    follows.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("InputError"):
            code = node.args[0]
            if isinstance(code, ast.JoinedStr):
                yield (
                    str(ast.unparse(code.values[0]).strip("'")).split(" ")[0],
                    len(code.values) > 1,
                )
            elif isinstance(code, ast.Constant):
                kind, _, field = str(code.value).partition(" ")
                yield kind, bool(field)


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_every_refusal_has_a_kind_and_a_field(path):
    assert {*codes_of(ast.parse(path.read_text()))} <= {(kind, True) for kind in KINDS}


def test_the_search_for_refusals_finds_what_is_missing():
    found = codes_of(ast.parse("InputError('odd x', 's')\nInputError(f'range {x}', 's')"))
    assert [*found] == [("odd", True), ("range", True)]
    assert [*codes_of(ast.parse("raise errors.InputError('range', 's')"))] == [("range", False)]
