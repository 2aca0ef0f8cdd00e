"""A sweep: its runs on this machine or on a cluster, then tables and a report.

The folder holds ``sweep.toml`` (the file), ``runs.csv`` (what became of every run),
``results.csv``, ``summary.csv`` and ``fronts.csv`` (as a comparison has them, with the variant as
first column), ``failures.txt`` if any run failed, ``manifest.json``, ``report.html``, and for each
variant of the settings ``variants/NAME/``: a comparison with a report of its own.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Protocol

from evenhand.core import files, processes
from evenhand.core.errors import InputError
from evenhand.core.processes import Event, Outcome, Task
from evenhand.core.processors import CORES
from evenhand.experiments import provenance
from evenhand.experiments.sweep import report, runs
from evenhand.experiments.sweep.settings import Job, Line, Sweep

_NOTE = "experiment.json"


class Cluster(Protocol):
    """Where runs can be done other than in processes of this machine."""

    @property
    def cores(self) -> int:
        """How many it has."""
        ...

    def run_each(
        self, jobs: Sequence[Job], out: Path, workers: int, tell: Callable[[Event], None]
    ) -> list[Outcome]:
        """As ``pool.run_each``; what runs made is in the folder when this returns."""
        ...


Watch = Callable[[Sequence[Job], int], Callable[[Event], None]]
"""Called once with the runs and how many of them had ended before; returns where to tell."""


def sweep(
    plan: Sweep,
    out: Path,
    watch: Watch,
    command: str,
    workers: int | None = None,
    cluster: Cluster | None = None,
) -> list[Line]:
    """Run whatever is missing in the folder, then write tables and report.

    Args:
        plan: the runs.
        out: folder of the sweep.
        watch: shows progress.
        command: noted in the manifest.
        workers: runs at the same time; by default as many as there are cores.
        cluster: where they run; processes of this machine by default.

    Returns:
        What became of every run, in order.

    Raises:
        InputError: when the folder cannot be written, is in use, or holds something else, or what
            was made with other versions.
    """
    began = perf_counter()
    workers = (cluster.cores if cluster else CORES) if workers is None else workers
    if workers < 1:
        raise InputError("range workers", f"workers is {workers}: give at least 1")
    files.make_folder(out)
    with files.locked(out):
        provenance.claim(out, _NOTE, {"experiment": "sweep"})
        files.sweep(out)
        files.write_text(out / "sweep.toml", plan.text)
        before = [runs.finished(job, out / job.path) is not None for job in plan.jobs]
        left = [job for job, done in zip(plan.jobs, before, strict=True) if not done]
        tell = watch(left, sum(before))
        if cluster is None:
            outcomes = processes.run_each(tasks(left, out), workers, tell)
        else:
            outcomes = cluster.run_each(left, out, workers, tell)
        ended = dict(zip(left, outcomes, strict=True))
        lines = [_line(job, out, ended.get(job)) for job in plan.jobs]
        report.write_all(out, lines, command, workers, perf_counter() - began)
    return lines


def tasks(jobs: Sequence[Job], out: Path) -> list[Task]:
    """The runs as tasks of processes."""
    return [Task(str(job), runs.perform, {"job": job, "folder": out / job.path}) for job in jobs]


def _line(job: Job, out: Path, outcome: Outcome | None) -> Line:
    folder = out / job.path
    attempts = outcome.attempts if outcome else 0
    if outcome is not None and outcome.failure is not None:
        return Line(job, None, None, attempts, outcome.failure)
    test = runs.finished(job, folder)
    if test is None:
        raise RuntimeError(f"{folder} holds no result of {job}, which has ended")
    return Line(job, test, runs.seconds_of(folder), attempts, None)
