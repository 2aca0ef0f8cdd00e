"""What people install: a source archive, a wheel made of it without Node, and what it can do."""

from __future__ import annotations

import json
import os
import site
import subprocess
import sys
import tarfile
import venv
import zipfile
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from evenhand.core import extras

PROJECT = Path(__file__).resolve().parents[2]
PAGES = {
    "evenhand/restaurant/replay/static/replay.js",
    "evenhand/study/server/static/index.html",
    "evenhand/study/server/static/study.css",
    "evenhand/study/server/static/study.js",
}
DATA = {
    "evenhand/methods/data/detector.json",
    "evenhand/study/design/data/paper.toml",
    "evenhand/experiments/sweep/data/sweep.toml",
}


@pytest.fixture(scope="module")
def without_node(tmp_path_factory) -> dict[str, str]:
    """An environment in which nothing but Python's own folder and basic tools are found."""
    tools = tmp_path_factory.mktemp("tools")
    for name in ("sh", "env", "cat"):
        (tools / name).symlink_to(f"/bin/{name}" if Path(f"/bin/{name}").exists() else "/bin/true")
    return {"PATH": str(tools), "HOME": str(tools), "LANG": "C.UTF-8"}


def run(words: list[object], folder: Path, environment: dict[str, str]) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    """The source archive of the project, with its pages built."""
    out = tmp_path_factory.mktemp("sdist")
    words = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", out]
    run(words, PROJECT, dict(os.environ))
    (found,) = out.glob("*.tar.gz")
    return found


@pytest.fixture(scope="module")
def wheel(archive, without_node, tmp_path_factory) -> Path:
    """The wheel of the unpacked archive, made where there is no Node."""
    folder = tmp_path_factory.mktemp("wheel")
    with tarfile.open(archive) as file:
        file.extractall(folder, filter="data")
    (root,) = folder.iterdir()
    assert not (root / "frontend" / "node_modules").exists()
    words = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder / "dist"]
    run(words, root, without_node)
    (found,) = (folder / "dist").glob("*.whl")
    return found


def environment(wheel: Path, folder: Path) -> Path:
    """A new environment with the wheel and nothing that it needs; its site-packages."""
    venv.create(folder, with_pip=False, symlinks=True)
    (inside,) = folder.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(inside)
    return inside


@pytest.fixture(scope="module")
def empty(wheel, tmp_path_factory) -> Path:
    """A new environment with the wheel; packages that it needs are lent, Evenhand is not."""
    folder = tmp_path_factory.mktemp("empty")
    # a folder that is named here is searched, but what makes a clone editable is not read
    (environment(wheel, folder) / "lent.pth").write_text("\n".join(site.getsitepackages()))
    return folder


def needed(requirements: Iterable[str]) -> dict[str, metadata.Distribution]:
    """Installed packages that pip would install for these, without any extra, by name."""
    found: dict[str, metadata.Distribution] = {}
    todo = list(requirements)
    while todo:
        wanted = Requirement(todo.pop())
        if wanted.name not in found and (not wanted.marker or wanted.marker.evaluate()):
            found[wanted.name] = metadata.distribution(wanted.name)
            todo += found[wanted.name].requires or []
    return found


@pytest.fixture(scope="module")
def core(wheel, tmp_path_factory) -> Path:
    """A new environment with what `pip install .` brings: the wheel and its dependencies."""
    folder = tmp_path_factory.mktemp("core")
    inside = environment(wheel, folder)
    (noted,) = inside.glob("evenhand-*.dist-info/METADATA")
    base = metadata.Distribution.at(noted.parent).requires or []
    for one in needed(base).values():
        for top in {path.parts[0] for path in one.files or ()} - {"..", "__pycache__"}:
            if not (inside / top).exists():
                (inside / top).symlink_to(Path(str(one.locate_file(top))))
    return folder


def test_archive_and_wheel_hold_the_built_pages_and_all_data(archive, wheel):
    with zipfile.ZipFile(wheel) as file:
        inside = set(file.namelist())
    assert inside >= PAGES | DATA
    assert not [name for name in inside if "node_modules" in name or name.startswith("tests/")]
    with tarfile.open(archive) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    assert names >= {f"src/{name}" for name in PAGES | DATA}
    assert "LICENSE" in names
    assert not [name for name in names if "node_modules" in name or ".venv" in name]


def test_it_runs_in_an_empty_environment(empty, without_node, tmp_path):
    python = empty / "bin" / "python"
    code = "import evenhand; print(evenhand.__file__)"
    assert str(empty) in run([python, "-c", code], tmp_path, without_node)
    tool = [python, "-c", "import sys; from evenhand.cli import main; sys.exit(main())"]
    run([*tool, "example", "fleet.csv", "--services", 900], tmp_path, without_node)
    run([*tool, "audit", "fleet.csv", "--out", "card.html"], tmp_path, without_node)
    assert (tmp_path / "card.html").stat().st_size > 50_000
    run([*tool, "train", "--epochs", 2, "--out", "run"], tmp_path, without_node)
    run([*tool, "replay", "run", "--out", "replay.html"], tmp_path, without_node)
    assert (tmp_path / "replay.html").stat().st_size > 100_000
    run([*tool, "study", "new", "study.toml"], tmp_path, without_node)


CORE = """
import json, sys
import evenhand
log = evenhand.Services.build(
    {"age": ([0, 1] * 300, ["child", "adult"])},
    {"responded": [True, False] * 300, "response_distance": [1.2, None] * 300,
     "response_step": [90, None] * 300, "min_distance": [0.8] * 600},
)
scores = evenhand.score(log).by_identity["age"].tolist()
print(json.dumps([scores, evenhand.audit(log).verdict, sorted(sys.modules)]))
"""


def test_the_core_audits_scores_and_judges(core, without_node, tmp_path):
    """All children are answered and no adult: willingness is as uneven as can be."""
    python = core / "bin" / "python"
    scores, verdict, modules = json.loads(run([python, "-c", CORE], tmp_path, without_node))
    assert (scores[0], scores[3], verdict) == (1.0, 0.0, "disparity")
    heavy = {package for packages in extras.EXTRAS.values() for package in packages} - {"PIL"}
    assert heavy & set(modules) == set()
    tool = [python, "-c", "import sys; from evenhand.cli import main; sys.exit(main())"]
    run([*tool, "example", "fleet.csv", "--services", 900], tmp_path, without_node)
    run([*tool, "audit", "fleet.csv", "--out", "card.html"], tmp_path, without_node)
    assert (tmp_path / "card.html").stat().st_size > 50_000
    run([*tool, "detect", "judge", "--scores", 0.5, 0.2, 0.4, 0.4], tmp_path, without_node)
    run([*tool, "study", "new", "study.toml"], tmp_path, without_node)


def test_the_core_names_the_extra_that_a_command_needs(core, without_node, tmp_path):
    code = "import sys; from evenhand.cli import main; sys.exit(main())"
    done = subprocess.run(
        [core / "bin" / "python", "-c", code, "train", "--out", "run"],
        cwd=tmp_path,
        env=without_node,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "run pip install '.[train]' in a clone of Evenhand" in done.stderr
    assert not (tmp_path / "run").exists()
