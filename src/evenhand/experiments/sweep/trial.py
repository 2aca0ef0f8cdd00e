"""One attempt of a run on a machine of a Ray cluster: what a trial of Ray Tune does."""

import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.core.plugins import load_texts
from evenhand.experiments.sweep import runs
from evenhand.experiments.sweep.files import Carrier
from evenhand.experiments.sweep.settings import Job
from evenhand.training import run_folder


def attempt(
    config: dict[str, Any],
    jobs: Sequence[Job],
    keeper: Any,
    versions: dict[str, str],
    plugins: dict[str, str],
    pause: float,
) -> None:
    """One attempt of a run, on whichever machine.

    A run that raises says why and is not tried again, for it would raise again; what Tune tries
    again is a run whose process or machine was lost.

    Args:
        config: ``index`` of the job.
        jobs: all of them.
        keeper: handle of the ``Keeper`` beside the driver.
        versions: that this machine needs.
        plugins: files with methods and scenarios, by name.
        pause: seconds between two reports of progress.
    """
    import ray
    from ray import tune

    job = jobs[config["index"]]
    tune.report({"place": ray.util.get_node_ip_address()})
    with tempfile.TemporaryDirectory(prefix="evenhand-") as scratch:
        folder = Path(scratch) / "run"
        failure = _performed(job, folder, keeper, versions, plugins, _slowly(pause))
    tune.report({"failure": failure})


def _performed(
    job: Job,
    folder: Path,
    keeper: Any,
    versions: dict[str, str],
    plugins: dict[str, str],
    tell: Callable[[int], None],
) -> str | None:
    """Do a job in a folder and send what it makes; returns why it failed, if it did."""
    import ray
    from ray.exceptions import RayError, RayTaskError

    try:
        differs = files.differences(run_folder.versions(), versions)
        if differs:  # a machine that came later
            raise InputError("changed machine", f"this machine has other versions ({differs})")
        load_texts(plugins)
        number, held = ray.get(keeper.begin.remote(str(job.path)))
        carrier = Carrier(
            folder, lambda *what: ray.get(keeper.keep.remote(str(job.path), number, *what))
        )
        carrier.unpack(held)

        def heard(units: int, numbers: dict[str, Any]) -> None:
            carrier.send_after_checkpoint()
            tell(units)

        runs.perform(tell=heard, job=job, folder=folder)
        carrier.send()
    except RayTaskError as error:  # of the keeper
        refused = isinstance(error.cause, InputError)
        return str(error.cause) if refused else traceback.format_exc()
    except RayError:
        raise  # the machine of the driver is gone, or this one
    except InputError as error:
        return str(error).replace(str(folder), str(job.path))
    except Exception:
        return traceback.format_exc()
    return None


def _slowly(pause: float) -> Callable[[int], None]:
    """Tells Tune of services, some at a time: each report costs the driver a millisecond."""
    from ray import tune

    gathered, last = 0, monotonic()

    def tell(units: int) -> None:
        nonlocal gathered, last
        gathered += units
        if monotonic() - last >= pause:
            tune.report({"units": gathered})
            gathered, last = 0, monotonic()

    return tell
