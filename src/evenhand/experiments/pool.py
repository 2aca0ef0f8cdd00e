"""Tasks in parallel processes: progress while they run, one error or Ctrl-C ends them all."""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from evenhand.errors import InputError

Tell = Callable[[int, dict[str, Any]], None]
"""(units done, numbers to show): how a task reports while it runs."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Task:
    """One piece of work.

    Attributes:
        name: shown when it fails.
        run: a module-level function, called with ``tell`` and the arguments.
        arguments: what it is called with; must be picklable.
    """

    name: str
    run: Callable[..., Any]
    arguments: dict[str, Any]


def run_all(tasks: Sequence[Task], workers: int, tell: Tell) -> list[Any]:
    """Run every task; results come in the order of the tasks.

    Args:
        tasks: what to do.
        workers: processes; with 1 everything runs in this one.
        tell: told of progress, in this process.

    Raises:
        InputError: as a task raised it.
        RuntimeError: when a task failed otherwise, with its traceback, or a process died.
    """
    if workers < 1:
        raise InputError(f"workers is {workers}: give at least 1")
    if workers == 1 or len(tasks) <= 1:
        return [task.run(tell=tell, **task.arguments) for task in tasks]
    for name in _THREADS:
        os.environ.setdefault(name, "1")  # read by the libraries when a process starts
    context = multiprocessing.get_context("spawn")
    todo, done = context.Queue(), context.Queue()
    for index, task in enumerate(tasks):
        todo.put((index, task))
    processes = [
        context.Process(target=_work, args=(todo, done), daemon=True)
        for _ in range(min(workers, len(tasks)))
    ]
    results: dict[int, Any] = {}
    try:
        for process in processes:
            process.start()
        while len(results) < len(tasks):
            try:
                kind, index, content = done.get(timeout=1.0)
            except queue.Empty:
                _check_alive(processes)
                continue
            if kind == "progress":
                tell(*content)
            elif kind == "result":
                results[index] = content
            elif kind == "input":
                raise InputError(content)
            else:
                raise RuntimeError(f"{tasks[index].name} failed:\n{content}")
    finally:
        for process in processes:
            if process.is_alive():
                process.terminate()
        for process in processes:
            if process.pid is not None:
                process.join()
        for line in (todo, done):
            line.cancel_join_thread()
            line.close()
    return [results[index] for index in range(len(tasks))]


def _check_alive(processes: Sequence[Any]) -> None:
    for process in processes:
        if process.exitcode not in (None, 0):
            raise RuntimeError(
                f"a worker process ended with code {process.exitcode} (out of memory, or killed): "
                "run the same command again, it goes on where it was"
            )


def _work(todo: Any, done: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends us
    while True:
        try:
            # every task was put in before this process began, so an empty queue is the end
            index, task = todo.get(timeout=2.0)
        except queue.Empty:
            return

        def tell(units: int, numbers: dict[str, Any], index: int = index) -> None:
            done.put(("progress", index, (units, numbers)))

        try:
            done.put(("result", index, task.run(tell=tell, **task.arguments)))
        except InputError as error:
            done.put(("input", index, str(error)))
        except Exception:
            done.put(("failure", index, traceback.format_exc()))
