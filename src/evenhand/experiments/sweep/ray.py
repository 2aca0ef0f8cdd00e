"""Runs of a sweep on a Ray cluster, by Ray Tune; needs the extra ``ray``.

A run is the same function as on one machine (``sweep_runs.perform``), in a folder on the disk of
the machine where it runs. No disk is shared: at every checkpoint, and in the end, its files are
sent to an actor beside the driver, which writes them into the folder of the sweep
(``sweep_files``). When a machine is lost, the run goes on elsewhere from what was sent.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evenhand.core import extras, files, plugins
from evenhand.core.errors import InputError
from evenhand.core.processes import RETRIES, Event, Outcome, one_thread
from evenhand.experiments.sweep.files import Keeper
from evenhand.experiments.sweep.settings import Job
from evenhand.experiments.sweep.trial import attempt
from evenhand.training import run_folder

PATIENCE = 10
"""Seconds in which a cluster has to answer."""
_QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_gcs_server_request_timeout_seconds": str(PATIENCE),
    "TUNE_DISABLE_AUTO_CALLBACK_LOGGERS": "1",
    "TUNE_DISABLE_SIGINT_HANDLER": "1",
    "TUNE_WARN_EXCESSIVE_EXPERIMENT_CHECKPOINT_SYNC_THRESHOLD_S": "0",
}
"""Read by Ray when it is imported: nothing is reported to anybody, and Ctrl-C is ours."""
_LOST = "its worker or its machine was lost"


@contextlib.contextmanager
def connected(address: str) -> Iterator[RayCluster]:
    """A cluster, for as long as this lasts.

    Raises:
        InputError: when Ray is not installed, nothing answers there, or a machine of the cluster
            has other versions than this one.
    """
    _knock(address)
    os.environ |= {name: os.environ.get(name, value) for name, value in _QUIET.items()}
    one_thread()
    extras.require("ray", "--ray")
    import ray
    from ray import tune  # noqa: F401 - imported while nothing else runs

    _check_answer(address)
    try:
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
        logging.getLogger("ray").setLevel(logging.CRITICAL)  # we say what was lost
    except (ConnectionError, RuntimeError, TimeoutError, ValueError) as error:
        ray.shutdown()
        raise InputError(
            "unavailable ray", f"{_unusable(address)} ({_first(error)}): {_REMEDY}"
        ) from error
    try:
        versions = run_folder.versions()
        _check_machines(versions)
        yield RayCluster(max(1, int(ray.cluster_resources().get("CPU", 0))), versions)
    finally:
        ray.shutdown()


_REMEDY = (
    "start the cluster with `ray start --head`, run this on one of its machines, and give the "
    "address that it prints"
)


def _unusable(address: str) -> str:
    return f"the Ray cluster at {address} cannot be used"


def _first(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0].rstrip(".")


def _knock(address: str) -> None:
    """Is anybody there at all? Ray itself would try for a minute."""
    match = re.fullmatch(r"(\[[0-9a-fA-F:]+\]|[^\s:/]+):(\d{1,5})", address)
    if match is None or not 0 < int(match.group(2)) < 65536:
        raise InputError(
            "format ray", f"--ray is {address!r}: give HOST:PORT of the head of a Ray cluster"
        )
    try:
        place = (match.group(1).strip("[]"), int(match.group(2)))
        socket.create_connection(place, timeout=PATIENCE).close()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            "unavailable ray", f"nothing answers at {address} ({reason}): {_REMEDY}"
        ) from error


def _check_answer(address: str) -> None:
    """Is it Ray, of this version? Asked by another process, which it ends if it is neither."""
    words = [sys.executable, "-m", "ray.scripts.scripts", "health-check", "--address", address]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False)
        said = done.stderr.strip().rpartition("\n")[2] if done.returncode else ""
    except subprocess.TimeoutExpired:
        said = "it does not answer as Ray does"
    if said:
        raise InputError(
            "unavailable ray", f"{_unusable(address)} ({said[:200].rstrip('.')}): {_REMEDY}"
        )


def _check_machines(versions: dict[str, str]) -> None:
    """Every machine has to calculate as this one does."""
    import ray
    from ray.exceptions import RayError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    asked: dict[str, Any] = {}
    for node in ray.nodes():
        if node["Alive"]:
            strategy = NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
            there = ray.remote(run_folder.versions).options(
                num_cpus=0, scheduling_strategy=strategy
            )
            asked[node["NodeManagerAddress"]] = there.remote()
    for place, answer in asked.items():
        try:
            theirs: Any = ray.get(answer)
        except RayError as error:
            last = str(error).strip().rpartition("\n")[2]
            raise InputError(
                "unavailable machine",
                f"machine {place} of the cluster cannot run Evenhand ({last}): there, "
                f"{extras.install('ray')} {versions['evenhand']}",
            ) from error
        differs = files.differences(theirs, versions)
        if differs:
            raise InputError(
                "changed machine",
                f"machine {place} of the cluster has other versions ({differs}): results would "
                "not be the same, so install these",
            )


@dataclass(frozen=True)
class RayCluster:
    """A cluster that this process is connected to."""

    cores: int
    versions: dict[str, str]

    def run_each(
        self, jobs: Sequence[Job], out: Path, workers: int, tell: Callable[[Event], None]
    ) -> list[Outcome]:
        """Run every job whatever becomes of the others."""
        if not jobs:
            return []
        import ray
        from ray import tune
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        for path in out.glob(".ray-*"):  # of a driver that was killed
            shutil.rmtree(path, ignore_errors=True)
        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
        keeper = (
            ray.remote(Keeper)
            .options(num_cpus=0, scheduling_strategy=here)
            .remote(str(out.resolve()))
        )
        listener = _listener(tell)
        parameters = {
            "jobs": list(jobs),
            "keeper": keeper,
            "versions": self.versions,
            "plugins": plugins.texts(),
            "pause": max(1.0, workers / 100),
        }
        silent = contextlib.redirect_stdout(io.StringIO())  # Tune has its own idea of progress
        with tempfile.TemporaryDirectory(prefix=".ray-", dir=out) as notes, silent:
            tuner = tune.Tuner(
                tune.with_resources(tune.with_parameters(attempt, **parameters), {"cpu": 1}),
                param_space={"index": tune.grid_search(list(range(len(jobs))))},
                tune_config=tune.TuneConfig(max_concurrent_trials=workers, reuse_actors=True),
                run_config=tune.RunConfig(
                    name="sweep",
                    storage_path=str(Path(notes).resolve()),
                    failure_config=tune.FailureConfig(max_failures=RETRIES),
                    callbacks=[listener],
                    verbose=0,
                ),
            )
            tuner.fit()
        ray.kill(keeper)  # type: ignore[arg-type] # a handle is what it takes
        missing = Outcome(failure=f"{_LOST} before it began", attempts=0)
        return [listener.outcomes.get(index, missing) for index in range(len(jobs))]


def _listener(tell: Callable[[Event], None]) -> Any:
    """Hears of trials in this process, and tells of runs."""
    from ray import tune

    class Listener(tune.Callback):
        def __init__(self) -> None:
            self.outcomes: dict[int, Outcome] = {}

        def __reduce__(self) -> tuple[Any, ...]:
            # Tune notes it, to restore an experiment; runs go on without that
            return tune.Callback, ()

        def on_trial_result(
            self, iteration: int, trials: list[Any], trial: Any, result: dict[str, Any], **_: Any
        ) -> None:
            index = trial.config["index"]
            if "place" in result:
                tell(Event(index, "began", place=result["place"]))
            elif "units" in result:
                tell(Event(index, "progress", result["units"], {}))
            elif "failure" in result:
                failure = result["failure"]
                self._end(index, Outcome(None, failure, trial.num_failures + 1))

        def on_trial_recover(self, iteration: int, trials: list[Any], trial: Any, **_: Any) -> None:
            tell(Event(trial.config["index"], "lost", reason=_LOST))

        def on_trial_error(self, iteration: int, trials: list[Any], trial: Any, **_: Any) -> None:
            times = trial.num_failures
            self._end(trial.config["index"], Outcome(None, f"{_LOST}, {times} times", times))

        def _end(self, index: int, outcome: Outcome) -> None:
            if index not in self.outcomes:
                self.outcomes[index] = outcome
                kind = "ended" if outcome.failure is None else "failed"
                tell(Event(index, kind, reason=outcome.failure or ""))

    return Listener()
