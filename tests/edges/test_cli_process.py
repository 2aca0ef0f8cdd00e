"""The command line as a process: libraries, terminal, pipes, disks, and the ways it can end."""

import os
import pty
import re
import subprocess
import sys
from contextlib import suppress

import pytest

# --- libraries, terminal, pipes, disks ---


def test_numeric_libraries_keep_to_one_thread_unless_told_otherwise(apart):
    script = (
        "import os, sys; from evenhand.cli import main; main([]);"
        "print('numpy' in sys.modules, os.environ['OMP_NUM_THREADS'],"
        " os.environ['OPENBLAS_NUM_THREADS'])"
    )
    clean = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}

    def last(environment: dict[str, str]) -> str:
        return apart.of(sys.executable, "-c", script)(env=environment).out.splitlines()[-1]

    assert last(clean) == "False 1 1"
    assert last(clean | {"OMP_NUM_THREADS": "2"}) == "False 2 1"


def test_half_a_character_of_a_process_that_was_stopped_is_read(apart):
    script = "import sys; sys.stdout.buffer.write(b'ol\\xc3')"
    assert apart.of(sys.executable, "-c", script)().out == "ol\\xc3"


def in_a_terminal(apart, *words: object) -> tuple[int, str]:
    """Run with standard error as a terminal; returns code and what it showed."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*apart.program, *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "140"},
    )
    os.close(theirs)
    shown = b""
    with suppress(OSError):  # when the other side has ended
        while True:
            shown += os.read(ours, 4096)
    os.close(ours)
    return process.wait(), re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())


SHORT = ("--epochs", 30, "--people", 4, "--algorithm", "reinforce")


@pytest.mark.slow
def test_progress_is_shown_in_a_terminal(apart, tmp_path):
    code, shown = in_a_terminal(apart, "train", "--out", tmp_path / "run", *SHORT)
    assert code == 0
    assert "reinforce, seed 0" in shown
    assert "100 %" in shown
    assert re.search(r"\d:\d\d:\d\d left  [\d,]+ steps/s  [\d,]+ services/s", shown)


@pytest.mark.slow
def test_nothing_but_the_result_is_shown_elsewhere(apart, tmp_path):
    shown = apart("train", "--out", tmp_path / "run", "--epochs", 1, "--people", 2)
    assert (shown.code, shown.out, shown.err) == (0, f"{tmp_path / 'run'}\n", "")


def test_a_reader_that_has_gone_is_no_error(apart):
    process = apart.start("train", "--help")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait() == 0


def test_output_that_cannot_be_written(apart):
    with open("/dev/full", "w") as full:
        ended = apart("train", "--help", capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert ended.code == 1
    assert ended.err == (
        "evenhand: the output cannot be written: No space left on device: free some space\n"
    )


@pytest.mark.slow
def test_a_full_disk(apart, tmp_path, monkeypatch):
    monkeypatch.setenv("EVENHAND_CACHE", str(tmp_path / "cache"))
    words = ("evaluate", "--robot", "even", "--services", 300, "--out", tmp_path / "x.parquet")
    ended = apart.with_small_files(4_000, *words)
    assert ended.complaint == f"{tmp_path / 'x.parquet'} cannot be written: File too large"
    words = ("train", "--out", tmp_path / "run", "--epochs", 2, "--algorithm", "reinforce")
    ended = apart.with_small_files(4_000, *words)
    assert ended.complaint.endswith(" cannot be written: File too large")
    assert not list(tmp_path.rglob("*.part"))
    assert not (tmp_path / "run" / "checkpoint.npz").exists()


# --- Ctrl-C, and other ends ---

STUB = """
import atexit, os, signal, sys, time
from evenhand import cli
from evenhand.cli import interrupts
from evenhand.core.errors import WorkerLostError

class Dying:
    def __del__(self):  # what is raised in here is lost
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)

def stopped_while_memory_is_collected(words):
    Dying()
    time.sleep(600)

def stopped_while_a_library_loads(words):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(600)
    except KeyboardInterrupt:
        raise ImportError("initialization failed")

def lost_and_made_another_error(words):
    atexit.register(time.sleep, 0.2)  # as long as it takes to end a program with large libraries
    Dying()
    raise RuntimeError("the work was broken off")

def expected_and_lost(words):
    atexit.register(time.sleep, 0.2)
    with interrupts.expected():
        Dying()
        raise RuntimeError("the work was broken off")
    return 0

def expected_and_came_through(words):
    with interrupts.expected():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(600)
    return 0

def expected_and_did_not_come(words):
    with interrupts.expected():
        raise ZeroDivisionError("a defect")

def ended(words):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(600)

def lost(words):
    raise WorkerLostError("a worker is gone")

def defect(words):
    raise ZeroDivisionError("a defect")

cli._dispatch = globals()[sys.argv.pop()]
sys.exit(cli.main())
"""


@pytest.mark.parametrize(
    ("what", "code", "said"),
    [
        ("stopped_while_memory_is_collected", 130, "evenhand: stopped; what was finished is kept"),
        ("stopped_while_a_library_loads", 130, "evenhand: stopped; what was finished is kept"),
        ("lost_and_made_another_error", 130, "evenhand: stopped; what was finished is kept"),
        ("expected_and_lost", 0, ""),
        ("expected_and_came_through", 0, ""),
        ("expected_and_did_not_come", 1, "Traceback (most recent call last):"),
        ("ended", 143, ""),
        ("lost", 1, "evenhand: a worker is gone"),
        ("defect", 1, "Traceback (most recent call last):"),
    ],
)
def test_how_a_command_can_end(apart, what, code, said):
    done = apart.of(sys.executable, "-c", STUB)(what, timeout=120)
    assert (done.code, done.out) == (code, "")
    assert done.err.startswith(said)
    defect = "a defect" in done.err
    assert defect == ("Traceback" in done.err) == said.startswith("Traceback")
    assert done.err.count("\n") <= 1 or defect
