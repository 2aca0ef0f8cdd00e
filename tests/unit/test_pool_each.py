"""Tasks that stand alone: one that fails, or whose process dies, leaves the others be."""

import importlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evenhand.core.processes import Event, Outcome, Task, run_each

HERE = Path(__file__).parent


@pytest.fixture
def work(monkeypatch, alive) -> Iterator[Any]:
    """The module of tasks, which other processes find by the same path; none may be left."""
    monkeypatch.syspath_prepend(str(HERE))
    yield importlib.import_module("pool_tasks")
    assert alive(parent=os.getpid()) == []


def test_everything_is_done_and_told_whatever_fails(work):
    tasks = [
        Task("a", work.square, {"number": 3}),
        Task("b", work.break_down, {}),
        Task("c", work.refuse, {"why": "no such file"}),
        Task("d", work.unsendable, {}),
        Task("e", work.square, {"number": 4}),
    ]
    heard: list[Event] = []
    outcomes = run_each(tasks, 2, heard.append)
    assert [outcome.attempts for outcome in outcomes] == [1] * 5
    assert [outcomes[i].result["square"] for i in (0, 4)] == [9, 16]
    assert [outcome.failure is None for outcome in outcomes] == [True, False, False, False, True]
    assert "ZeroDivisionError: a defect" in str(outcomes[1].failure)
    assert outcomes[2].failure == "no such file"
    assert "ickl" in str(outcomes[3].failure)
    for index in range(5):
        kinds = [event.kind for event in heard if event.index == index]
        ended = "ended" if index in (0, 4) else "failed"
        told = ["progress"] * 2 if index in (0, 4) else []
        assert kinds == ["began", *told, ended], index
    assert [event.units for event in heard if event.kind == "progress"] == [1] * 4
    assert [e.reason for e in heard if e.kind == "failed" and e.index == 2] == ["no such file"]


def test_a_process_that_dies_is_replaced_and_its_task_tried_again(work, tmp_path):
    mark = tmp_path / "mark"
    tasks = [
        Task("dies once", work.die_once, {"mark": mark, "number": 5}),
        *(Task("square", work.square, {"number": n}) for n in range(4)),
    ]
    heard: list[Event] = []
    outcomes = run_each(tasks, 2, heard.append)
    assert [outcome.result for outcome in outcomes[:1]] == [25]
    assert outcomes[0].attempts == 2
    assert [outcome.result["square"] for outcome in outcomes[1:]] == [0, 1, 4, 9]
    assert [event.kind for event in heard if event.index == 0] == [
        "began", "lost", "began", "ended",
    ]  # fmt: skip
    [lost] = [event for event in heard if event.kind == "lost"]
    assert lost.reason == "its process ended with code -9 (out of memory, or killed)"


@pytest.mark.parametrize(("retries", "attempts"), [(0, 1), (2, 3)])
def test_no_more_often_than_said(work, retries, attempts):
    tasks = [Task("crash", work.crash, {"code": 7}), Task("good", work.square, {"number": 2})]
    outcomes = run_each(tasks, 2, lambda _: None, retries)
    assert outcomes[0] == Outcome(
        failure=f"its process ended with code 7 (out of memory, or killed), {attempts} times",
        attempts=attempts,
    )
    assert outcomes[1].result["square"] == 4


def test_one_worker_is_another_process_too(work):
    """A task that dies must not take this process along."""
    [outcome] = run_each([Task("a", work.square, {"number": 3})], 1, lambda _: None)
    assert outcome.result["process"] != os.getpid()


def test_what_was_finished_before_is_told_here(work):
    heard: list[Event] = []
    [outcome] = run_each([Task("a", work.square, {"number": 3}, finished=True)], 1, heard.append)
    assert outcome.result["process"] == os.getpid()
    assert [event.kind for event in heard] == ["progress", "progress", "ended"]


def test_a_process_killed_in_the_middle_of_a_word(work, tmp_path):
    """A result of 64 MB, and a kill while it is on its way: the others wait for no lock."""
    tasks = [
        Task("long word", work.long_word, {"mark": tmp_path / "mark"}),
        *(Task("square", work.square, {"number": n}) for n in range(3)),
    ]
    heard: list[Event] = []

    def tell(event: Event) -> None:
        heard.append(event)
        if event.kind == "progress" and event.numbers.get("process"):
            # it sends as soon as it has told, and we do not listen meanwhile
            while not (tmp_path / "mark").exists():
                time.sleep(0.01)
            os.kill(event.numbers["process"], signal.SIGKILL)

    outcomes = run_each(tasks, 2, tell, retries=0)
    assert [outcome.failure is None for outcome in outcomes] == [False, True, True, True]


def test_nothing_to_do():
    assert run_each([], 2, lambda _: None) == []
