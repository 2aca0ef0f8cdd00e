"""Tasks in parallel processes: progress while they run, and none is left behind.

``run_all`` is for tasks that belong together: one error or Ctrl-C ends them all. ``run_each`` is
for tasks that stand alone: one that fails leaves the others be, and one whose process dies is
tried again.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import connection, resource_tracker
from typing import Any, Literal

from evenhand.core.errors import InputError, WorkerLostError

Tell = Callable[[int, dict[str, Any]], None]
"""(units done, numbers to show): how a task reports while it runs."""
Stage = Callable[[str, int], Tell]
"""Called with a stage's name and its units (services); returns where to tell progress."""
RETRIES = 2
"""How often ``run_each`` tries a task again whose process died."""

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


@dataclass(frozen=True)
class Event:
    """Something that happened to a task of ``run_each``.

    Attributes:
        index: of the task.
        kind: lost is said of an attempt whose process died, and another one follows; ended and
            failed are said of the task, once.
        units: done since the last event.
        numbers: to show.
        reason: why it was lost or failed.
        place: where it works, if that is another machine.
    """

    index: int
    kind: Literal["began", "progress", "lost", "ended", "failed"]
    units: int = 0
    numbers: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    place: str = ""


@dataclass(frozen=True)
class Outcome:
    """How a task of ``run_each`` ended.

    Attributes:
        result: what it gave; None if it failed.
        failure: why it failed, a sentence or a traceback; None if it did not.
        attempts: how often it was begun.
    """

    result: Any = None
    failure: str | None = None
    attempts: int = 1


def run_all(tasks: Sequence[Task], workers: int, tell: Tell, *, apart: bool = False) -> list[Any]:
    """Run every task; results come in the order of the tasks.

    Args:
        tasks: what to do.
        workers: processes; with 1 everything runs in this one.
        tell: told of progress, in this process.
        apart: nothing but finished tasks runs in this process, whatever their number.

    Raises:
        InputError: as a task raised it.
        WorkerLostError: when a process died.
        RuntimeError: when a task failed otherwise, with its traceback.
    """
    _check(workers)
    left = [task for task in tasks if not task.finished]
    here = not apart and (len(left) <= 1 or workers == 1)
    results: dict[int, Any] = {
        index: task.run(tell=tell, **task.arguments)
        for index, task in enumerate(tasks)
        if here or task.finished
    }
    if not here:
        _run_apart({i: t for i, t in enumerate(tasks) if not t.finished}, workers, tell, results)
    return [results[index] for index in range(len(tasks))]


def run_each(
    tasks: Sequence[Task], workers: int, tell: Callable[[Event], None], retries: int = RETRIES
) -> list[Outcome]:
    """Run every task whatever becomes of the others; outcomes come in the order of the tasks.

    Nothing but finished tasks runs in this process, so that none can end it.

    Args:
        tasks: what to do.
        workers: processes.
        tell: told of all that happens, in this process.
        retries: how often a task is tried again whose process died. One that raises is not: it
            would raise again.
    """
    _check(workers)
    outcomes: dict[int, Outcome] = {}
    attempts = dict.fromkeys(range(len(tasks)), 0)

    def end(index: int, outcome: Outcome) -> None:
        outcomes[index] = outcome
        kind = "ended" if outcome.failure is None else "failed"
        tell(Event(index, kind, reason=outcome.failure or ""))

    for index, task in enumerate(tasks):
        if task.finished:
            attempts[index] = 1
            result = task.run(
                tell=lambda n, numbers, i=index: tell(Event(i, "progress", n, numbers)),
                **task.arguments,
            )
            end(index, Outcome(result))
    left = {i: task for i, task in enumerate(tasks) if not task.finished}
    with _Crew(left, workers) as crew:
        for kind, index, content in crew.messages():
            if kind == "began":
                attempts[index] += 1
                tell(Event(index, "began"))
            elif kind == "progress":
                tell(Event(index, "progress", *content))
            elif kind == "result":
                end(index, Outcome(pickle.loads(content), attempts=attempts[index]))
            elif kind != "lost":
                said = content[1] if kind == "input" else content
                end(index, Outcome(failure=said, attempts=attempts[index]))
            elif attempts[index] <= retries:
                tell(Event(index, "lost", reason=_lost(content)))
                crew.again(index)
            else:
                tries = f"{_lost(content)}, {attempts[index]} times"
                end(index, Outcome(failure=tries, attempts=attempts[index]))
    return [outcomes[index] for index in range(len(tasks))]


def _check(workers: int) -> None:
    if workers < 1:
        raise InputError("range workers", f"workers is {workers}: give at least 1")


def _lost(code: int) -> str:
    return f"its process ended with code {code} (out of memory, or killed)"


def _run_apart(
    tasks: Mapping[int, Task], workers: int, tell: Tell, results: dict[int, Any]
) -> None:
    with _Crew(tasks, workers) as crew:
        for kind, index, content in crew.messages():
            if kind == "progress":
                tell(*content)
            elif kind == "result":
                results[index] = pickle.loads(content)
            elif kind == "input":
                raise InputError(*content)
            elif kind == "failure":
                raise RuntimeError(f"{tasks[index].name} failed:\n{content}")
            elif kind == "lost" and content == 0:
                raise RuntimeError(f"no result came of {tasks[index].name}")
            elif kind == "lost":
                raise WorkerLostError(
                    f"a worker process ended with code {content} (out of memory, or killed): "
                    "run the same command again, what is finished is kept"
                )


class _Crew:
    """Processes that are given one task after the other, each by a pipe of its own.

    A pipe has one reader and one writer, so that a process which is killed in the middle of a
    word holds no lock that the others wait for.
    """

    def __init__(self, tasks: Mapping[int, Task], workers: int) -> None:
        one_thread()
        self._tasks, self._most = tasks, workers
        self._waiting = deque(tasks)
        self._processes: dict[connection.Connection, Any] = {}
        self._doing: dict[connection.Connection, int] = {}

    def __enter__(self) -> _Crew:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            if process.is_alive():
                process.terminate()
        for line, process in self._processes.items():
            process.join()
            line.close()

    def again(self, index: int) -> None:
        """Put a task back, as the next one."""
        self._waiting.appendleft(index)

    def messages(self) -> Iterator[tuple[str, int, Any]]:
        """(kind, index of the task, content) until nothing is left to do.

        began; progress with its units and numbers; result, pickled; input, a sentence; failure, a
        traceback; lost, with the exit code of the process.
        """
        while self._waiting or self._doing:
            yield from self._hand_out()
            for line in connection.wait(list(self._doing)):
                assert isinstance(line, connection.Connection)
                index = self._doing[line]
                try:
                    kind, content = line.recv()
                except (EOFError, OSError):  # OSError: in the middle of a word
                    del self._doing[line]
                    process = self._processes.pop(line)
                    process.join()
                    line.close()
                    yield "lost", index, process.exitcode
                    continue
                if kind != "progress":
                    del self._doing[line]
                yield kind, index, content

    def _hand_out(self) -> Iterator[tuple[str, int, Any]]:
        while self._waiting and len(self._doing) < self._most:
            free = [line for line in self._processes if line not in self._doing]
            line = free[0] if free else self._start()
            index = self._waiting.popleft()
            self._doing[line] = index
            with suppress(OSError):  # it has died, which is noticed when it is listened to
                line.send_bytes(pickle.dumps(self._tasks[index]))
            yield "began", index, None

    def _start(self) -> connection.Connection:
        """A process that does not hear Ctrl-C: it is for this one, which ends it."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_work, args=(theirs,), daemon=True)
        # the first process of all starts this one too, which would let Ctrl-C through again
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # it is inherited
        try:
            with _no_script():
                process.start()
            self._processes[ours] = process
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        return ours


@contextmanager
def _no_script() -> Iterator[None]:
    """A process that starts meanwhile does not run the user's script again, guarded or not."""
    main = vars(sys.modules["__main__"])
    hidden = {name: main.pop(name) for name in ("__spec__", "__file__") if name in main}
    main["__spec__"] = None
    try:
        yield
    finally:
        main |= hidden


def _work(line: connection.Connection) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here: look for no display
    while True:
        try:
            packed = line.recv_bytes()
        except (EOFError, OSError):
            return

        def tell(units: int, numbers: dict[str, Any]) -> None:
            line.send(("progress", (units, numbers)))

        try:
            task = pickle.loads(packed)
            # here, for what cannot be sent is a failure of the task
            line.send(("result", pickle.dumps(task.run(tell=tell, **task.arguments))))
        except InputError as error:
            line.send(("input", error.args))
        except Exception:
            line.send(("failure", traceback.format_exc()))


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers, and nobody would take their results."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
