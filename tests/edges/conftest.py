"""The command line, in this process or in one of its own."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from evenhand.cli import main


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The one sentence on standard error of a command that refused its input."""
        assert (self.code, self.out) == (2, ""), self
        assert self.err.startswith("evenhand: "), self
        assert self.err.endswith("\n"), self
        assert self.err.count("\n") == 1, self
        assert "Traceback" not in self.err, self
        return self.err.removeprefix("evenhand: ").rstrip()


class Apart:
    """The command line in processes of their own."""

    program: tuple[str, ...] = (
        sys.executable,
        "-c",
        "import sys; from evenhand.cli import main; sys.exit(main())",
    )

    def __call__(self, *words: object, **options: Any) -> Ended:
        """Run a command to its end."""
        done = subprocess.run(
            [*self.program, *map(str, words)],
            **{"stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "check": False}
            | options,
        )
        return Ended(done.returncode, done.stdout or "", done.stderr or "")

    def with_small_files(self, largest: int, *words: object) -> Ended:
        """Run a command that can write files of so many bytes at most, as on a full disk."""
        limited = Apart()
        limited.program = ("prlimit", f"--fsize={largest}", *self.program)
        return limited(*words)

    def start(self, *words: object, **options: Any) -> subprocess.Popen[str]:
        """Start a command; its processes are a group of their own, as in a shell."""
        return subprocess.Popen(
            [*self.program, *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
            **options,
        )


@pytest.fixture
def apart() -> Apart:
    """``apart("train", "--out", folder)`` runs a command in a process of its own."""
    return Apart()


@pytest.fixture
def cli(capfd, monkeypatch, tmp_path) -> Callable[..., Ended]:
    """``cli("train", "--out", folder)`` runs a command in this process, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Ended:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return Ended(code, *capfd.readouterr())

    return run


@pytest.fixture
def content() -> Callable[[Path], dict[str, bytes]]:
    """``content(folder)``: every file in it by its name, but for locks."""

    def read(folder: Path) -> dict[str, bytes]:
        return {
            str(path.relative_to(folder)): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name != ".lock"
        }

    return read


@pytest.fixture
def alive() -> Callable[[int], list[str]]:
    """``alive(group)``: commands of the processes of a group.

    The resource tracker of multiprocessing is left out: it sees by itself that its parent ended.
    """

    def find(group: int) -> list[str]:
        found = []
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                state, _, belongs = stat.read_text().rsplit(")", 1)[1].split()[:3]
                command = (stat.parent / "cmdline").read_text().replace("\0", " ")
            except (FileNotFoundError, ProcessLookupError):
                continue
            # without a command line it has given back its memory and is about to be gone
            ended = state == "Z" or not command
            if int(belongs) == group and not ended and "resource_tracker" not in command:
                found.append(command)
        return found

    return find
