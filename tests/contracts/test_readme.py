"""The README shows only what runs: its Python is executed, its commands and files exist."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from evenhand.cli import COMMANDS, DETECT

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("code", re.findall(r"```python\n(.*?)```", TEXT, re.S))
def test_python_in_the_readme_runs(code, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_commands_in_the_readme_exist():
    lines = re.findall(r"^ {4}evenhand (\S+)(?: (\S+))?", TEXT, re.M)
    assert lines
    for command, following in lines:
        assert command in COMMANDS
        if command == "detect":
            assert following in DETECT


def test_make_targets_in_the_readme_exist():
    targets = re.findall(r"^ {4}make (\w+)", TEXT, re.M)
    assert targets
    for target in targets:
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.M)


def test_files_and_figures_in_the_readme_exist():
    links = re.findall(r"\]\((?!http)([^)]+)\)", TEXT)
    rooms = re.findall(r"`((?:restaurant|learn|tests)/[\w/.]*|\w+\.py)`", TEXT)
    assert links
    assert rooms
    for link in links:
        assert (ROOT / link).exists(), link
    for room in rooms:
        base = ROOT if room.startswith("tests/") else ROOT / "src/evenhand"
        assert (base / room).exists(), room


def test_the_readme_is_finished():
    assert not re.search(r"[A-Z]+_(TIME|TABLE)", TEXT)


def test_make_sb3_installs_that_extra_by_either_installer():
    by_uv, by_pip = made("--dry-run", "sb3")[-1].split(" || ")
    assert shlex.split(by_uv)[-2:] == shlex.split(by_pip)[-2:] == ["--editable", ".[dev,sb3]"]


def test_make_says_every_target():
    phony = re.search(r"^\.PHONY: (.*)", (ROOT / "Makefile").read_text(), re.M)
    assert phony
    assert {line.split()[1] for line in made()} == {*phony[1].split()}


def made(*words: str) -> list[str]:
    """What make says, whoever has called the tests: another make hands things down."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(
        ["make", *words], cwd=ROOT, env=env, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()
