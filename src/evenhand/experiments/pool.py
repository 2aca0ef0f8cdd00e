"""Tasks in parallel processes: progress while they run, one error or Ctrl-C ends them all."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import queue
import signal
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evenhand.errors import InputError, WorkerLostError

Tell = Callable[[int, dict[str, Any]], None]
"""(units done, numbers to show): how a task reports while it runs."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread() -> None:
    """Keep numeric libraries to one thread, unless the user has said otherwise.

    They read this when they are imported, so it counts for what is imported afterwards and for
    processes that begin afterwards. Our products are small: threads would only fight for cores,
    and sums would come out in another order with another number of them.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")


@dataclass(frozen=True)
class Task:
    """One piece of work.

    Attributes:
        name: shown when it fails.
        run: a module-level function, called with ``tell`` and the arguments.
        arguments: what it is called with; must be picklable.
        finished: an earlier call has done it, so that it only has to be told: no other process
            is needed.
    """

    name: str
    run: Callable[..., Any]
    arguments: dict[str, Any]
    finished: bool = False


def run_all(tasks: Sequence[Task], workers: int, tell: Tell) -> list[Any]:
    """Run every task; results come in the order of the tasks.

    Args:
        tasks: what to do.
        workers: processes; with 1 everything runs in this one.
        tell: told of progress, in this process.

    Raises:
        InputError: as a task raised it.
        WorkerLostError: when a process died.
        RuntimeError: when a task failed otherwise, with its traceback.
    """
    if workers < 1:
        raise InputError(f"workers is {workers}: give at least 1")
    here = len([task for task in tasks if not task.finished]) <= 1 or workers == 1
    results: dict[int, Any] = {
        index: task.run(tell=tell, **task.arguments)
        for index, task in enumerate(tasks)
        if here or task.finished
    }
    if not here:
        _run_apart({i: t for i, t in enumerate(tasks) if not t.finished}, workers, tell, results)
    return [results[index] for index in range(len(tasks))]


def _run_apart(
    tasks: Mapping[int, Task], workers: int, tell: Tell, results: dict[int, Any]
) -> None:
    """Run numbered tasks in other processes and put their results into ``results``."""
    one_thread()
    context = multiprocessing.get_context("spawn")
    todo, done = context.Queue(), context.Queue()
    processes = [
        context.Process(target=_work, args=(todo, done), daemon=True)
        for _ in range(min(workers, len(tasks)))
    ]
    for item in [*tasks.items(), *[None] * len(processes)]:
        todo.put(item)
    try:
        _start(processes)
        while tasks.keys() - results.keys():
            working = any(process.is_alive() for process in processes)
            try:
                kind, index, content = done.get(timeout=1.0)
            except queue.Empty:
                _check_alive(processes)
                if not working:  # all have ended, and nothing of theirs is on its way
                    lost = [task.name for i, task in tasks.items() if i not in results]
                    raise RuntimeError(f"no result came of {', '.join(lost)}") from None
                continue
            if kind == "progress":
                tell(*content)
            elif kind == "result":
                results[index] = pickle.loads(content)
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


def _start(processes: Sequence[Any]) -> None:
    """Start processes that do not hear Ctrl-C: it is for this one, which ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # processes inherit it
    try:
        for process in processes:
            process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check_alive(processes: Sequence[Any]) -> None:
    for process in processes:
        if process.exitcode not in (None, 0):
            raise WorkerLostError(
                f"a worker process ended with code {process.exitcode} (out of memory, or killed): "
                "run the same command again, it goes on where it was"
            )


def _work(todo: Any, done: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here: look for no display
    while (item := todo.get()) is not None:
        index, task = item

        def tell(units: int, numbers: dict[str, Any], index: int = index) -> None:
            done.put(("progress", index, (units, numbers)))

        try:
            # here, for what cannot be sent would vanish in the queue without a word
            done.put(("result", index, pickle.dumps(task.run(tell=tell, **task.arguments))))
        except InputError as error:
            done.put(("input", index, str(error)))
        except Exception:
            done.put(("failure", index, traceback.format_exc()))


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers, and nobody would take their results."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
