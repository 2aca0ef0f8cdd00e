"""The view of all runs: what it says where there is a terminal, and where there is none."""

import io

import pytest
from rich.console import Console
from rich.progress import Progress, TextColumn

from evenhand.cli.sweep_view import View
from evenhand.core.processes import Event
from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.sweep.settings import Job, Variant

JOBS = [
    Job(Variant(epochs=10, people=10, services=300), Cell("tips", "ppo", "service", seed))
    for seed in range(3)
]
NAME = "epochs=10,people=10,services=300: tips, ppo, service, seed"


@pytest.fixture
def progress():
    console = Console(file=io.StringIO(), force_terminal=True, width=160)
    with Progress(TextColumn("{task.description}"), console=console, auto_refresh=False) as bars:
        yield bars


def bars(progress: Progress) -> list[tuple[str, float]]:
    return [(task.description, task.completed) for task in progress.tasks]


def test_what_is_at_work_has_a_bar(progress):
    tell = View(progress)(JOBS, 2)
    assert bars(progress) == [("2 of 5 runs", 0)]
    tell(Event(0, "began"))
    tell(Event(1, "began", place="10.0.0.7"))
    tell(Event(0, "progress", 30))
    tell(Event(1, "progress", 50))
    assert bars(progress) == [
        ("2 of 5 runs", 80), (f"{NAME} 0", 30), (f"{NAME} 1 on 10.0.0.7", 50),
    ]  # fmt: skip
    tell(Event(0, "ended"))
    assert bars(progress) == [("3 of 5 runs", 450), (f"{NAME} 1 on 10.0.0.7", 50)]


def test_a_lost_attempt_begins_anew_and_a_failure_is_counted(progress):
    tell = View(progress)(JOBS, 0)
    tell(Event(0, "began"))
    tell(Event(0, "progress", 30))
    tell(Event(0, "lost", reason="its process ended with code -9"))
    assert bars(progress) == [("0 of 3 runs", 0)]
    tell(Event(0, "began"))
    tell(Event(0, "progress", 20))
    tell(Event(0, "failed", reason="Traceback\n  a line\nZeroDivisionError: x"))
    assert bars(progress) == [("0 of 3 runs, 1 failed", 400)]
    said = progress.console.file.getvalue()  # type: ignore[attr-defined]
    assert f"{NAME} 0: its process ended with code -9; tried again, 2 times at most" in said
    assert f"{NAME} 0 failed: ZeroDivisionError: x" in said
    assert "a line" not in said


def test_no_more_bars_than_a_terminal_has_lines(progress):
    tell = View(progress)(JOBS * 20, 0)
    for index in range(60):
        tell(Event(index, "began"))
        tell(Event(index, "progress", 400))
        if index >= 30:
            tell(Event(index, "ended"))
    assert len(progress.tasks) == 21
    assert bars(progress)[0] == ("30 of 60 runs", 60 * 400)


def test_without_a_terminal_only_what_went_wrong(capsys):
    tell = View(Progress(disable=True))(JOBS, 0)
    for kind in ("began", "lost", "began", "ended"):
        tell(Event(0, kind, reason="gone"))
    assert capsys.readouterr() == (
        "", f"evenhand: {NAME} 0: gone; tried again, 2 times at most\n",
    )  # fmt: skip
