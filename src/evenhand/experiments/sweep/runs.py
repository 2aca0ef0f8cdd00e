"""One run of a sweep in its folder: the same function on this machine and on a cluster."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from evenhand.core import files
from evenhand.core.processes import Tell
from evenhand.experiments.comparison import compare, tables
from evenhand.experiments.sweep.file import POLICY, UPDATE, WORLD
from evenhand.experiments.sweep.settings import Job
from evenhand.training import checkpoint, run_folder
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import TrainSettings

CLOCK = "clock.json"
"""How long a run took: the one file of its folder that another machine would write otherwise."""


def training_of(job: Job) -> TrainSettings:
    """Settings of a run; for an arm that learns nothing, those of the world it serves in."""
    base = compare.training_of(job.cell, job.variant.epochs)
    chosen = dict(job.variant.learner)

    def of(names: tuple[str, ...]) -> dict[str, Any]:
        return {name: chosen[name] for name in names if name in chosen}

    return replace(
        base,
        people=job.variant.people,
        update=replace(base.update, **of(UPDATE)),
        policy=replace(base.policy, **of(POLICY)),
        **of(WORLD),
    )


def key_of(job: Job) -> str:
    """What a finished run was: under another key it does not count, and is done again."""
    training = checkpoint.fingerprint(run_folder.as_dict(training_of(job)))
    return f"{job.variant.services} services, settings {training}"


def finished(job: Job, folder: Path) -> dict[str, Any] | None:
    """The numbers of a run's test if it has ended, else None."""
    done = run_folder.finished(folder, key_of(job))
    return None if done is None else done["test"]


def seconds_of(folder: Path) -> float | None:
    """How long the process worked that ended a run; None when that is not known."""
    path = folder / CLOCK
    return files.read_record(path, "seconds")["seconds"] if path.exists() else None


def perform(*, tell: Tell, job: Job, folder: Path) -> None:
    """One run: train, or go on training; then serve people it never saw.

    It may be called again at any time, after it was stopped or when it had ended: what is there
    is not done again, and ends with the same bits.

    Args:
        tell: told of services and physics steps.
        job: what to do.
        folder: of the run.
    """
    if finished(job, folder) is not None:
        tell(job.units, {"physics_steps": 0})
        return
    set_up_jax()
    began = perf_counter()
    services = job.variant.services
    test, steps = compare.learn_and_serve(tell, folder, job.cell, training_of(job), services)
    files.write_json(folder / CLOCK, {"seconds": round(perf_counter() - began, 2)})
    run_folder.finish(folder, key_of(job), {"test": test})
    tell(services, {"physics_steps": steps})


def row_of(job: Job) -> tables.Row:
    """What a run is, as the first columns of a table."""
    cell = job.cell
    return {
        "variant": job.variant.name,
        "scenario": cell.scenario,
        "algorithm": cell.algorithm,
        "arm": cell.arm,
        "seed": cell.seed,
    }
