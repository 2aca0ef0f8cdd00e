"""A sweep of one run whose process is killed again and again; prints how often, as JSON.

    python mortal.py FOLDER ALGORITHM KILLS SEED

Everything is imported once, and each attempt is a process forked from this one before JAX has
computed anything, so that moments fall into the work. A moment is so many epochs and then some
milliseconds after the beginning: the same stretch of work, however busy the machine is.
"""

import json
import os
import signal
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from evenhand.experiments import provenance
from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.sweep import report, runs
from evenhand.experiments.sweep.settings import Job, Line, Variant

EPOCHS = 110
VARIANT = Variant(epochs=EPOCHS, people=4, services=300)


def work(folder: Path, job: Job, ticks: int) -> None:
    """The run and the report; a byte into a pipe for everything that is told."""

    def tell(units: int, numbers: dict) -> None:
        os.write(ticks, b".")

    runs.perform(tell=tell, job=job, folder=folder / job.path)
    lines = [Line(job, runs.finished(job, folder / job.path), None, 1, None)]
    (folder / "sweep.toml").touch()
    provenance.commit = lambda: None  # somebody may commit meanwhile
    report.write_all(folder, lines, "evenhand sweep", 1, 0.0)


def attempt(folder: Path, job: Job) -> tuple[int, int]:
    """Begin the work in a process of its own; returns its number, and where it tells."""
    sys.stdout.flush()
    told, ticks = os.pipe()
    child = os.fork()
    if child:
        os.close(ticks)
        return child, told
    try:
        os.close(told)
        work(folder, job, ticks)
        os._exit(0)
    except BaseException as error:
        print(repr(error), file=sys.stderr, flush=True)
        os._exit(1)


def ended(child: int, told: int, after: int | None = None, pause: float = 0.0) -> int:
    """Its exit code, negative for a signal.

    Args:
        child: number of the process.
        told: where it tells.
        after: things told before it is killed; let it end if None.
        pause: seconds between the last of them and the end.
    """
    heard = 0
    while (after is None or heard < after) and os.read(told, 1):
        heard += 1
    if after is not None:
        time.sleep(pause)
        os.kill(child, signal.SIGKILL)  # it is still ours to wait for, even if it has ended
    os.close(told)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def main(folder: Path, algorithm: str, kills: int, seed: int) -> None:
    """Undisturbed in ``calm``, then with so many kills in ``killed-0``, ``killed-1`` and so on."""
    job = Job(VARIANT, Cell("tips", algorithm, "levelup", 0))
    rng, done, rounds = np.random.default_rng(seed), 0, 1
    assert ended(*attempt(folder / "calm", job)) == 0
    while done < kills:
        # one in five falls between the last service and the end of the report
        late = rng.uniform() < 0.2
        after = EPOCHS + 1 if late else int(rng.integers(0, EPOCHS))
        pause = rng.uniform(0.0, 1.0 if late else 0.05)
        code = ended(*attempt(folder / f"killed-{rounds - 1}", job), after, pause)
        assert code in (0, -signal.SIGKILL), code
        done += code != 0
        rounds += code == 0  # it had ended before: another one
    for number in range(rounds):
        assert ended(*attempt(folder / f"killed-{number}", job)) == 0
    print(json.dumps({"kills": done, "rounds": rounds}))


if __name__ == "__main__":
    warnings.filterwarnings("ignore", message=r"os.fork\(\) was called")
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
