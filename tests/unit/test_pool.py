"""Tasks in other processes: what they give, how they fail, and that none is left behind."""

import importlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evenhand.core import processes as pool
from evenhand.core.errors import WorkerLostError
from evenhand.core.processes import Task, run_all
from support.refusals import refused

HERE = Path(__file__).parent


@pytest.fixture
def work(monkeypatch, alive) -> Iterator[Any]:
    """The module of tasks, which other processes find by the same path; none may be left."""
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    yield importlib.import_module("pool_tasks")
    assert alive(parent=os.getpid()) == []


def told() -> tuple[list[tuple[int, dict[str, Any]]], pool.Tell]:
    heard: list[tuple[int, dict[str, Any]]] = []
    return heard, lambda units, numbers: heard.append((units, numbers))


def silent(units: int, numbers: dict[str, Any]) -> None:
    pass


class TestResults:
    def test_in_the_order_of_the_tasks_and_with_progress(self, work, tmp_path):
        # the first waits for the last, so that it ends last and needs a second process
        signs: list[dict[str, Any]] = [{} for _ in range(5)]
        signs[0], signs[4] = {"after": tmp_path / "x"}, {"mark": tmp_path / "x"}
        tasks = [Task("square", work.square, {"number": n, **signs[n]}) for n in range(5)]
        heard, tell = told()
        results = run_all(tasks, 2, tell)
        assert [result["square"] for result in results] == [0, 1, 4, 9, 16]
        processes = {result["process"] for result in results}
        assert len(processes) == 2
        assert os.getpid() not in processes
        assert {result["threads"] for result in results} == {"1"}
        assert sum(units for units, _ in heard) == 10
        assert sorted(numbers["number"] for _, numbers in heard) == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]

    def test_one_worker_is_this_process(self, work):
        heard, tell = told()
        tasks = [Task("a", work.square, {"number": n}) for n in (3, 2)]
        results = run_all(tasks, 1, tell)
        assert [result["square"] for result in results] == [9, 4]
        assert {result["process"] for result in results} == {os.getpid()}
        assert [numbers["number"] for _, numbers in heard] == [3, 3, 2, 2]

    def test_one_task_needs_no_other_process(self, work):
        results = run_all([Task("a", work.square, {"number": 3})], 4, silent)
        assert results[0]["process"] == os.getpid()

    def test_one_task_apart(self, work):
        results = run_all([Task("a", work.square, {"number": 3})], 1, silent, apart=True)
        assert results[0]["square"] == 9
        assert results[0]["process"] != os.getpid()

    def test_what_was_finished_before_is_told_here_and_keeps_its_place(self, work, tmp_path):
        # the second waits for the fourth, so that both need a process of their own
        signs: list[dict[str, Any]] = [{}, {"after": tmp_path / "x"}, {}, {"mark": tmp_path / "x"}]
        tasks = [
            Task("square", work.square, {"number": n, **signs[n]}, finished=n % 2 == 0)
            for n in range(4)
        ]
        results = run_all(tasks, 2, silent)
        assert [result["square"] for result in results] == [0, 1, 4, 9]
        here = [result["process"] == os.getpid() for result in results]
        assert here == [True, False, True, False]

    def test_one_unfinished_task_needs_no_other_process(self, work):
        tasks = [Task("square", work.square, {"number": n}, finished=n != 1) for n in range(3)]
        results = run_all(tasks, 2, silent)
        assert [result["square"] for result in results] == [0, 1, 4]
        assert {result["process"] for result in results} == {os.getpid()}

    def test_nothing_to_do(self):
        assert run_all([], 2, silent) == []

    def test_fewer_than_one_worker(self):
        with refused("range workers", "0", "1"):
            run_all([], 0, silent)


class TestFailures:
    def with_a_long_one(self, work, folder: Path, run, **arguments) -> list[Task]:
        """A task that fails beside one that would take ten minutes."""
        return [Task("long", work.linger, {"folder": folder}), Task("bad", run, arguments)]

    def test_wrong_input_stays_wrong_input(self, work, tmp_path):
        tasks = self.with_a_long_one(work, tmp_path, work.refuse, why="no such file: give one")
        with refused("missing file", "no such file: give one"):
            run_all(tasks, 2, silent)

    def test_a_defect_keeps_its_traceback_and_says_which_task(self, work, tmp_path):
        tasks = self.with_a_long_one(work, tmp_path, work.break_down)
        with pytest.raises(RuntimeError, match=r"bad failed:\n(.*\n)*.*ZeroDivisionError: a def"):
            run_all(tasks, 2, silent)

    def test_a_process_that_dies_ends_all(self, work, tmp_path):
        tasks = self.with_a_long_one(work, tmp_path, work.crash, code=7)
        with pytest.raises(
            WorkerLostError, match=r"ended with code 7 .*: run the same command again"
        ):
            run_all(tasks, 2, silent)

    def test_a_process_that_leaves_without_a_result(self, work):
        tasks = [Task("leaves", work.leave, {}), Task("stays", work.square, {"number": 1})]
        with pytest.raises(RuntimeError, match=r"no result came of leaves$"):
            run_all(tasks, 2, silent)

    def test_a_result_that_cannot_be_sent(self, work):
        tasks = [Task("odd", work.unsendable, {}), Task("good", work.square, {"number": 1})]
        with pytest.raises(RuntimeError, match=r"odd failed:\n(.*\n)*.*[Pp]ickl"):
            run_all(tasks, 2, silent)

    def test_an_error_of_the_listener_ends_all(self, work, tmp_path):
        tasks = [Task("long", work.linger, {"folder": tmp_path}) for _ in range(2)]

        def tell(units: int, numbers: dict[str, Any]) -> None:
            raise KeyError("shown nowhere")

        with pytest.raises(KeyError, match="shown nowhere"):
            run_all(tasks, 2, tell)


MAIN = """
import sys
from pathlib import Path
import pool_tasks
from evenhand.core.processes import Task, run_all

if __name__ == "__main__":
    tasks = [Task("long", pool_tasks.linger, {"folder": Path(sys.argv[1])}) for _ in range(2)]
    run_all(tasks, 2, lambda units, numbers: None)
"""


@pytest.fixture
def program(apart, alive, tmp_path) -> Iterator[subprocess.Popen[str]]:
    """A program whose two workers are at work, in a session of its own as in a terminal."""
    pids, script = tmp_path / "pids", tmp_path / "main.py"
    pids.mkdir()
    script.write_text(MAIN)
    command = apart.of(sys.executable, script)
    environment = {**os.environ, "PYTHONPATH": str(HERE)}
    busy = command.at_work(pids, when=lambda: len(os.listdir(pids)) == 2, env=environment)
    with busy as process:
        assert len(alive(process.pid)) == 3
        yield process


def test_no_worker_hears_ctrl_c_not_even_the_first_one_of_a_program(tmp_path):
    script = tmp_path / "main.py"
    script.write_text(
        MAIN.replace(
            'pool_tasks.linger, {"folder": Path(sys.argv[1])}', "pool_tasks.hears_ctrl_c, {}"
        )
        .replace("    run_all(", "    print(run_all(")
        .replace("lambda units, numbers: None)", "lambda units, numbers: None))")
    )
    environment = {**os.environ, "PYTHONPATH": str(HERE)}
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, env=environment, check=True
    )
    assert done.stdout == "[False, False]\n"


def test_ctrl_c_ends_every_process(program, apart, alive):
    ended = apart.interrupt(program)
    assert ended.code == -signal.SIGINT
    assert ended.err.count("Traceback") == 1  # of the parent alone
    assert ended.err.rstrip().endswith("KeyboardInterrupt")
    assert alive(program.pid) == []


def test_workers_end_when_their_parent_is_killed(program, alive):
    program.kill()
    # without a parent they would go on for minutes; their ends are closed when they have ended
    program.communicate(timeout=60)
    assert alive(program.pid) == []
