"""What a sweep would cost: a few short runs measured, and the rest calculated from them.

Seconds are of processor time, which is what a run takes on a core of its own, whatever else the
machine does while it is measured.
"""

import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean
from time import process_time

from evenhand.experiments.comparison.settings import method_of
from evenhand.experiments.settings import SERVICES
from evenhand.experiments.sweep import runs as sweep_runs
from evenhand.experiments.sweep.settings import Job, Sweep
from evenhand.training import run_folder

EPOCHS = run_folder.CHECKPOINT_EVERY
"""Of a sample; the first ones are left out, for they compile and fill caches."""
_WARM = 10
_TESTED = 1500
MOST = 8
"""Samples at most; other kinds of runs are taken to be as dear as those of the same algorithm."""


@dataclass(frozen=True)
class Kind:
    """Runs that cost about the same for each epoch."""

    algorithm: str
    method: str
    people: int


@dataclass(frozen=True)
class Sample:
    """What a short run took.

    Attributes:
        begin: seconds before its first epoch had ended, compiling included.
        epoch: seconds of an epoch; 0 for an arm that learns nothing.
        service: seconds of a service in the test.
        fixed: bytes on the disk, whatever the number of epochs.
        bytes: on the disk, for each epoch.
    """

    begin: float
    epoch: float
    service: float
    fixed: float
    bytes: float


@dataclass(frozen=True)
class Cost:
    """Of one kind of runs.

    Attributes:
        kind: which.
        runs: how many.
        sample: measured, or calculated from others of its algorithm.
        measured: whether it was measured.
        seconds: of all its runs, one after the other, compiled before.
        compiling: seconds, once on every machine for each variant and scenario.
        bytes: on the disk.
    """

    kind: Kind
    runs: int
    sample: Sample
    measured: bool
    seconds: float
    compiling: float
    bytes: float


def kind_of(job: Job) -> Kind:
    """Of a run."""
    return Kind(job.cell.algorithm, method_of(job.cell.arm)[0], job.variant.people)


def estimate(plan: Sweep) -> list[Cost]:
    """Measure a short run of each kind, the most frequent ones first, and calculate the rest."""
    counts = Counter(kind_of(job) for job in plan.jobs)
    first = {kind_of(job): job for job in reversed(plan.jobs)}
    samples = {kind: measure(first[kind]) for kind, _ in counts.most_common(MOST)}
    return calculate(plan, samples)


def measure(job: Job) -> Sample:
    """A short run of the kind of a job, in a folder that is removed again."""
    with tempfile.TemporaryDirectory(prefix="evenhand-") as scratch:
        folder = Path(scratch) / "run"
        trained = _stamps(_short(job, SERVICES[0]), folder)
        tested = _stamps(_short(job, _TESTED), folder)  # trained and compiled: a test alone
        growing = _bytes(folder / "services") + _bytes(folder / "epochs.jsonl")
        fixed = _bytes(folder) - growing
    service = (tested[-1] - tested[-2]) / _TESTED
    if not job.learns:
        return Sample(0.0, 0.0, service, fixed, 0.0)
    first, last = trained[1:-1][_WARM - 1], trained[-2]
    return Sample(
        begin=trained[1] - trained[0],
        epoch=(last - first) / (EPOCHS - _WARM),
        service=service,
        fixed=fixed,
        bytes=growing / EPOCHS,
    )


def _bytes(path: Path) -> float:
    found = path.rglob("*") if path.is_dir() else [path]
    return float(sum(one.stat().st_size for one in found if one.is_file()))


def _short(job: Job, services: int) -> Job:
    return replace(job, variant=replace(job.variant, epochs=EPOCHS, services=services))


def _stamps(job: Job, folder: Path) -> list[float]:
    """When the run began, and when it told of something."""
    stamps = [process_time()]
    sweep_runs.perform(tell=lambda *_: stamps.append(process_time()), job=job, folder=folder)
    return stamps


def calculate(plan: Sweep, samples: Mapping[Kind, Sample]) -> list[Cost]:
    """Costs of every kind, dearest first.

    Args:
        plan: the sweep.
        samples: of some kinds, at least one.
    """
    found = []
    for kind in dict.fromkeys(kind_of(job) for job in plan.jobs):
        jobs = [job for job in plan.jobs if kind_of(job) == kind]
        sample = samples.get(kind) or _like(kind, samples)
        found.append(
            Cost(
                kind=kind,
                runs=len(jobs),
                sample=sample,
                measured=kind in samples,
                seconds=sum(_seconds(job, sample) for job in jobs),
                compiling=sample.begin * len({job.variant for job in jobs}),
                bytes=sum(sample.fixed + job.variant.epochs * sample.bytes for job in jobs),
            )
        )
    return sorted(found, key=lambda cost: -cost.seconds)


def _seconds(job: Job, sample: Sample) -> float:
    trained = job.variant.epochs * sample.epoch if job.learns else 0.0
    return trained + job.variant.services * sample.service


def _like(kind: Kind, samples: Mapping[Kind, Sample]) -> Sample:
    """The mean of the samples of its algorithm, or of all, by the services of an epoch."""
    near = {k: s for k, s in samples.items() if k.algorithm == kind.algorithm} or samples

    def average(of: Callable[[Sample], float], scaled: bool = False) -> float:
        return mean(of(s) * (kind.people / k.people if scaled else 1.0) for k, s in near.items())

    return Sample(
        begin=average(lambda s: s.begin),
        epoch=average(lambda s: s.epoch, scaled=True),
        service=average(lambda s: s.service),
        fixed=average(lambda s: s.fixed),
        bytes=average(lambda s: s.bytes, scaled=True),
    )
