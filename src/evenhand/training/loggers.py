"""The numbers of a run's epochs for other people's dashboards: TensorBoard, Weights & Biases.

The run folder stays the truth. A sink is written from ``epochs.jsonl`` when a run goes on, and from
then on with every epoch, so it never holds a step twice and never lacks one, however often the run
was stopped. Nothing leaves the machine: Weights & Biases is used in its offline mode only, and what
it wrote can be sent by its user with ``wandb sync``. Neither package is imported unless asked for.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic, time
from typing import Any, Protocol

from evenhand.core import extras, files
from evenhand.core.errors import InputError, unknown
from evenhand.training import epoch_log

SINKS = ("tensorboard", "wandb")
"""Each needs the extra of its name."""
PROJECT = "evenhand"
"""Project of Weights & Biases."""

_SECTIONS = {
    "update_": "update",
    "reflection_": "reflection",
    "guard_": "guard",
    "time_": "time",
    "biased_": "verdict",
}
_WHOLE_NAMES = {"missing_gaps": "issues", "probability": "verdict"}
_FLUSH_EVERY = 5.0
"""Seconds after which what was written is to be seen by others."""


def check(names: Sequence[str]) -> None:
    """Before long work: do the sinks exist, and are their packages there?

    Raises:
        InputError: for an unknown name, a name given twice, or a missing extra.
    """
    for name in names:
        if name not in SINKS:
            raise unknown("sink", name, SINKS)
        if names.count(name) > 1:
            raise InputError("duplicate log", f"the sink {name} is named twice: name it once")
        extras.require(name, f"the sink {name}")


def scalars(numbers: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of an epoch under tags such as ``issues/total`` and ``service/perfect_rate``.

    What is missing or no number is left out; yes and no are 1 and 0.

    Args:
        numbers: an epoch as ``run.execute`` tells it, or as a line of ``epochs.jsonl``.
    """
    issues = _issues(numbers)
    return {
        f"issues/{name}" if name in issues else _tag(name): float(value)
        for name, value in numbers.items()
        if name != "epoch" and isinstance(value, int | float)
    }


def _issues(numbers: Mapping[str, Any]) -> list[str]:
    """The total, the world's issues and the totals of its identities, which stand together."""
    names = list(numbers)
    totals = [i for i, name in enumerate(names) if name == "total" or name.startswith("total_")]
    return names[totals[0] : totals[-1] + 1] if totals else []


def _tag(name: str) -> str:
    if name in _WHOLE_NAMES:
        return f"{_WHOLE_NAMES[name]}/{name}"
    for prefix, section in _SECTIONS.items():
        if name.startswith(prefix):
            kept = name if section == "verdict" else name.removeprefix(prefix)
            return f"{section}/{kept}"
    return f"service/{name}"


@contextlib.contextmanager
def opened(
    names: Sequence[str], folder: str | os.PathLike[str]
) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Sinks of a run, as something that ``run.execute`` can tell its progress to.

    Nothing is written before the first call, for until then the folder may be another process's.

    Args:
        names: of the sinks; none of them is fine.
        folder: of the run.

    Yields:
        To be called with the numbers of every epoch, and before them with numbers of no epoch when
        a run goes on.

    Raises:
        InputError: as `check`, or when a sink cannot be written.
    """
    check(names)
    root = Path(folder)
    sinks: list[Sink] = []

    def tell(numbers: dict[str, Any]) -> None:
        for name in names[len(sinks) :]:
            sinks.append(_KINDS[name](root))
        told = [numbers] if "epoch" in numbers else epoch_log.read(root) if names else []
        for sink in sinks:
            for line in told:
                sink.write(line["epoch"], scalars(line))

    try:
        yield tell
    finally:
        for sink in sinks:
            sink.close()


def write(names: Sequence[str], folder: str | os.PathLike[str]) -> int:
    """Write the sinks of a run from what its folder holds; earlier ones are replaced.

    Returns:
        How many epochs the run has.

    Raises:
        InputError: as `opened`, or when the folder holds no run or a process works in it.
    """
    root = Path(folder)
    if not (root / "settings.json").exists():
        raise InputError("missing folder", f"{root} holds no run: there is no settings.json in it")
    with files.locked(root), opened(names, root) as tell:
        tell({})
        return len(epoch_log.read(root))


class Sink(Protocol):
    """Where the numbers of epochs go."""

    def write(self, epoch: int, numbers: Mapping[str, float]) -> None:
        """Take the numbers of an epoch, by tag."""

    def close(self) -> None:
        """Everything is written."""


class TensorBoard:
    """An event file in ``tensorboard/`` of a run folder, which outdoes earlier ones.

    It begins with a purge step: TensorBoard drops what it read before. The file before it stays,
    for a TensorBoard that is reading it would never get over its loss; earlier ones go.

    The writer of tensorboardX hands its events to a thread, which dies unheard on a full disk, and
    then the run hangs; so the records are written here, one an epoch.
    """

    def __init__(self, root: Path) -> None:
        from tensorboardX import RecordWriter

        # their classes are made when they are imported, which no type checker sees
        event: Any = importlib.import_module("tensorboardX.proto.event_pb2")
        summary: Any = importlib.import_module("tensorboardX.proto.summary_pb2")
        folder = files.make_folder(root / "tensorboard")
        before = sorted(folder.glob("events.out.tfevents.*"))
        # TensorBoard reads the files of a folder in the order of their names
        number = 1 + max((_number(path) for path in before), default=-1)
        self._path = folder / f"events.out.tfevents.{number:010d}.evenhand"
        self._event, self._summary = event.Event, summary.Summary
        with _said(self._path):
            self._records = RecordWriter(str(self._path))
        self._flushed = monotonic()
        with contextlib.ExitStack() as failed:
            failed.callback(self.close)
            self._put(file_version="brain.Event:2")
            # the purge step: what was read of this step and later ones is dropped
            self._put(step=0, session_log=event.SessionLog(status=event.SessionLog.START))
            self._flush()
            failed.pop_all()
        for path in before[:-1]:
            path.unlink()

    def write(self, epoch: int, numbers: Mapping[str, float]) -> None:
        """Take the numbers of an epoch, by tag."""
        value = self._summary.Value
        values = [value(tag=tag, simple_value=number) for tag, number in numbers.items()]
        self._put(step=epoch, summary=self._summary(value=values))
        if monotonic() - self._flushed > _FLUSH_EVERY:
            self._flush()

    def close(self) -> None:
        """Everything is written."""
        with _said(self._path):
            self._records.close()

    def _put(self, **content: Any) -> None:
        with _said(self._path):
            self._records.write(self._event(wall_time=time(), **content).SerializeToString())

    def _flush(self) -> None:
        with _said(self._path):
            self._records.flush()
        self._flushed = monotonic()


class Wandb:
    """An offline run in ``wandb/`` of a run folder, in place of earlier ones of the same run.

    Its identifier is made of the settings and the detector, so that what is sent twice stays one
    run. What Weights & Biases would note of machine, user, code and console is left out.
    """

    def __init__(self, root: Path) -> None:
        os.environ["WANDB_ERROR_REPORTING"] = "false"  # it would tell its makers about errors
        import wandb
        from wandb.errors import Error

        noted = files.read_record(root / "settings.json", "settings", "fingerprints", "versions")
        prints = noted["fingerprints"]
        name = "-".join(str(prints[key]) for key in sorted(prints))
        for path in root.glob(f"wandb/offline-run-*-{name}"):
            shutil.rmtree(path)
        try:
            self._run = wandb.init(
                project=PROJECT,
                id=name,
                name=root.resolve().name,
                dir=root,
                mode="offline",
                config={**noted["settings"], "versions": noted["versions"]},
                settings=wandb.Settings(
                    console="off",
                    silent=True,
                    disable_code=True,
                    disable_git=True,
                    host="",
                    symlink=False,
                    x_disable_machine_info=True,
                    x_disable_meta=True,
                    x_disable_stats=True,
                    x_save_requirements=False,
                ),
            )
        except Error as error:
            raise InputError(
                "unavailable wandb", f"Weights & Biases cannot write to {root}: {error}"
            ) from error

    def write(self, epoch: int, numbers: Mapping[str, float]) -> None:
        """Take the numbers of an epoch, by tag."""
        self._run.log(dict(numbers), step=epoch)

    def close(self) -> None:
        """Everything is written."""
        self._run.finish()


_KINDS: dict[str, Callable[[Path], Sink]] = {"tensorboard": TensorBoard, "wandb": Wandb}


@contextlib.contextmanager
def _said(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be written: {error.strerror or error}"
        ) from error


def _number(path: Path) -> int:
    """Number of an event file; of one that this room has not written, the largest there is."""
    part = path.name.split(".")[3]
    return int(part) if part.isdigit() else 0
