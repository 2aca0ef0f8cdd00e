"""What tests share: the same examples each time, one CPU, nothing skipped in CI, and commands."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

os.environ["JAX_PLATFORMS"] = "cpu"  # before anything imports jax
with contextlib.suppress(ImportError):
    # before any test draws, see evenhand.adapters.sb3.loading
    import triton  # pyright: ignore[reportMissingImports]  # noqa: F401
# A shell that starts tests in the background has Ctrl-C ignored, and processes inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Several tests run at once, and threads that wait for each other cost more than they help.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The same examples on every run, and no verdict by the clock.
settings.register_profile("evenhand", derandomize=True, deadline=None)
settings.load_profile("evenhand")


@pytest.fixture(scope="session")
def require() -> Callable[[bool, str], None]:
    """``require(present, what)``: skip a test that lacks something of the machine.

    With EVENHAND_REQUIRE_ALL=1, as in CI, the test fails instead, so that nothing is skipped
    unseen.
    """

    def check(present: bool, what: str) -> None:
        if present:
            return
        if os.environ.get("EVENHAND_REQUIRE_ALL") == "1":
            pytest.fail(f"this machine lacks {what}, and EVENHAND_REQUIRE_ALL=1 allows no skip")
        pytest.skip(f"this machine lacks {what}")

    return check


# --- commands, in this process or in one of their own ---


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


def running(group: int | None = None, *, parent: int | None = None) -> list[str]:
    """Commands of the processes that run in a group, or are children of a parent.

    The resource tracker of multiprocessing is left out: it belongs to the interpreter, and sees by
    itself that its parent has ended.
    """
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, its_parent, its_group = stat.read_text().rsplit(")", 1)[1].split()[:3]
            command = (stat.parent / "cmdline").read_text().replace("\0", " ")
        except (FileNotFoundError, ProcessLookupError):
            continue
        # without a command line it has given back its memory and is about to be gone
        ended = state == "Z" or not command
        wanted = int(its_group) == group or int(its_parent) == parent
        if wanted and not ended and "resource_tracker" not in command:
            found.append(command)
    return found


@dataclass(frozen=True)
class Apart:
    """The command line, or another program, in processes of their own."""

    program: tuple[str, ...] = (
        sys.executable,
        "-c",
        "import sys; from evenhand.cli import main; sys.exit(main())",
    )

    def __call__(self, *words: object, **options: Any) -> Ended:
        """Run a command to its end."""
        usual: dict[str, Any] = {
            "stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "check": False,
            "errors": "backslashreplace",
        }  # fmt: skip
        done = subprocess.run([*self.program, *map(str, words)], **(usual | options))
        return Ended(done.returncode, done.stdout or "", done.stderr or "")

    def with_small_files(self, largest: int, *words: object) -> Ended:
        """Run a command that can write files of so many bytes at most, as on a full disk."""
        return self.of("prlimit", f"--fsize={largest}", *self.program)(*words)

    def of(self, *program: object) -> "Apart":
        """Another program instead."""
        return replace(self, program=tuple(map(str, program)))

    def start(self, *words: object, **options: Any) -> subprocess.Popen[str]:
        """Start a command; its processes are a group of their own, as in a shell."""
        return subprocess.Popen(
            [*self.program, *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
            errors="backslashreplace",  # a process that is stopped may leave half a character
            start_new_session=True,
            **options,
        )

    @contextlib.contextmanager
    def at_work(
        self, *words: object, when: Callable[[], object], **options: Any
    ) -> Iterator[subprocess.Popen[str]]:
        """A command that has got so far; what is left of its group in the end is killed.

        Args:
            words: of the command.
            when: whether it has; asked again and again.
            options: of the process.
        """
        process = self.start(*words, **options)
        try:
            while not when():
                assert process.poll() is None, process.communicate()
                time.sleep(0.02)
            yield process
        finally:
            if running(process.pid):
                with contextlib.suppress(ProcessLookupError):  # gone in between
                    os.killpg(process.pid, signal.SIGKILL)
            process.communicate()

    def interrupt(self, process: subprocess.Popen[str]) -> Ended:
        """Ctrl-C, which every process of a terminal's command hears; returns how it ended."""
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=120)
        return Ended(process.returncode, out, err)


@pytest.fixture(scope="session")
def apart() -> Apart:
    """``apart("train", "--out", folder)`` runs a command in a process of its own."""
    return Apart()


@pytest.fixture(scope="session")
def alive() -> Callable[..., list[str]]:
    """``alive(group)`` or ``alive(parent=number)``: commands of the processes that still run."""
    return running


@pytest.fixture
def cli(capfd, monkeypatch, tmp_path) -> Callable[..., Ended]:
    """``cli("train", "--out", folder)`` runs a command in this process, in a folder of its own."""
    from evenhand.cli import main

    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Ended:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return Ended(code, *capfd.readouterr())

    return run


@pytest.fixture(scope="session")
def content() -> Callable[[Path], dict[str, bytes]]:
    """``content(folder)``: every file in it by its name, but for locks."""

    def read(folder: Path) -> dict[str, bytes]:
        return {
            str(path.relative_to(folder)): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name != ".lock"
        }

    return read


@pytest.fixture(scope="session")
def opengl(require):
    """Skips where nothing can be drawn."""
    from evenhand.core.errors import InputError
    from evenhand.restaurant.drawing.renderer import Screen

    try:
        Screen("room", 64, 48).close()
    except InputError as error:
        require("OpenGL" not in str(error), "OpenGL: libegl1 libegl-mesa0 libgl1-mesa-dri")
        raise


def _registries() -> Iterator[tuple[dict[str, Any], Callable[[str], bool]]]:
    """Of modules that are loaded: what is registered, and whether a name is Evenhand's own."""
    loaded = sys.modules.get
    if methods := loaded("evenhand.methods.registry"):
        yield methods._entries, methods.BUILT_IN.__contains__
    for module, name in [("restaurant.worlds", "_SCENARIOS"), ("training.policy", "_POLICIES")]:
        if found := loaded(f"evenhand.{module}"):
            entries = getattr(found, name)
            yield entries, lambda one, entries=entries: entries[one].source is None


@pytest.fixture(autouse=True)
def nothing_registered_stays() -> Iterator[None]:
    """What a test registers, by itself or by a plugin file, is forgotten after it."""
    from evenhand.core import plugins

    before = {id(entries): {*entries} for entries, _ in _registries()}
    files, variable = dict(plugins._files), os.environ.get(plugins.VARIABLE)
    yield
    for entries, own in _registries():
        for name in {*entries} - before.get(id(entries), set()):
            if not own(name):
                del entries[name]
    plugins._files.clear()
    plugins._files.update(files)
    if variable is None:
        os.environ.pop(plugins.VARIABLE, None)
    else:
        os.environ[plugins.VARIABLE] = variable


@pytest.fixture
def registered():
    """``evenhand.method``."""
    from evenhand.methods import registry

    return registry.method
