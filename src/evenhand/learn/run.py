"""One run in a folder: it can be stopped at any moment and goes on bit for bit.

A folder holds ``settings.json`` (settings, versions, fingerprint), ``detector.json``,
``epochs.jsonl`` (a line an epoch), ``services/`` (Parquet, a file for each checkpoint),
``checkpoint.npz`` and, once it is finished, ``done.json``.
"""

from __future__ import annotations

import dataclasses
import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from evenhand import detector_io, files
from evenhand.detector import Detector
from evenhand.errors import InputError
from evenhand.interactions import Interactions
from evenhand.learn import checkpoint, train
from evenhand.learn.update import LearnerState

CHECKPOINT_EVERY = 50
"""Epochs between checkpoints; a killed run loses at most so many."""

Progress = Callable[[dict[str, Any]], None]
"""Told the numbers of every epoch."""


def versions() -> dict[str, str]:
    """Versions of what decides results."""
    names = ("evenhand", "mujoco", "numpy", "jax", "equinox", "optax", "scikit-learn")
    return {"python": platform.python_version()} | {name: version(name) for name in names}


def as_dict(settings: Any) -> dict[str, Any]:
    """Settings as JSON holds them."""
    return json.loads(json.dumps(dataclasses.asdict(settings)))


def execute(
    folder: str | os.PathLike[str],
    settings: train.TrainSettings,
    detector: Detector,
    *,
    every: int = CHECKPOINT_EVERY,
    progress: Progress | None = None,
) -> LearnerState:
    """Train in a folder, from the start or from where an earlier process stopped.

    Args:
        folder: of this run; made if it does not exist.
        settings: of the run.
        detector: judges every epoch.
        every: epochs between checkpoints.
        progress: told the numbers of every new epoch.

    Returns:
        The trained learner.

    Raises:
        InputError: when the folder cannot be written, is in use, or holds another run.
    """
    root = files.make_folder(folder)
    with files.locked(root):
        prints = {
            "settings": checkpoint.fingerprint(as_dict(settings)),
            "detector": checkpoint.fingerprint(as_dict(detector)),
        }
        _claim(root, settings, detector, prints)
        state, rng, first = _resume(root, settings, prints)
        services: list[Interactions] = []
        lines: list[str] = []
        for record in train.train(settings, detector, state=state, rng=rng, first_epoch=first):
            services.append(record.interactions)
            lines.append(_line(record))
            state = record.state
            if progress is not None:
                progress({"epoch": record.epoch} | record.numbers)
            ended = record.epoch + 1
            if ended % every == 0 or ended == settings.epochs:
                _keep(root, state, rng, ended, services, lines, prints)
                services, lines = [], []
        return state


def finished(folder: str | os.PathLike[str], key: str) -> dict[str, Any] | None:
    """What ``done.json`` says if the run ended under this key, else None."""
    path = Path(folder) / "done.json"
    if not path.exists():
        return None
    done = files.read_json(path)
    return done if done.get("key") == key else None


def finish(folder: str | os.PathLike[str], key: str, content: dict[str, Any]) -> None:
    """Note that a run and all that follows from it have ended."""
    files.write_json(Path(folder) / "done.json", {"key": key} | content)


def read_epochs(folder: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """The lines of ``epochs.jsonl``.

    Raises:
        InputError: when the file is missing or a line is not JSON.
    """
    path = Path(folder) / "epochs.jsonl"
    if not path.exists():
        raise InputError(f"{path} does not exist: {folder} is no run folder, or nothing ran yet")
    out = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            out.append(json.loads(line))
        except json.JSONDecodeError as error:
            raise InputError(
                f"{path} line {number} is cut off: run the same command again to resume"
            ) from error
    return out


def read_services(folder: str | os.PathLike[str]) -> Interactions:
    """All services of a run, in order.

    Raises:
        InputError: when there are none or a file cannot be read.
    """
    found = sorted((Path(folder) / "services").glob("*.parquet"))
    if not found:
        raise InputError(f"{folder} holds no services: it is no run folder, or nothing ran yet")
    return Interactions.concat([Interactions.read_parquet(path) for path in found])


def load_policy(folder: str | os.PathLike[str]) -> tuple[train.TrainSettings, LearnerState]:
    """Settings and last state of a run.

    Raises:
        InputError: when the folder holds no run, or its files do not fit together.
    """
    root = Path(folder)
    if not (root / "settings.json").exists():
        raise InputError(f"{root} holds no run: there is no settings.json in it")
    noted = files.read_json(root / "settings.json")
    settings = _from_dict(train.TrainSettings, noted["settings"], root / "settings.json")
    found = checkpoint.load(root / "checkpoint.npz", train.begin(settings), noted["fingerprints"])
    return settings, found.state


def _from_dict(kind: type, content: dict[str, Any], where: Path) -> Any:
    known = {field.name: field for field in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    for name, value in content.items():
        if name not in known:
            raise InputError(f"{where} has a setting {name!r} that this version does not know")
        factory = known[name].default_factory
        if isinstance(value, dict) and isinstance(factory, type):
            value = _from_dict(factory, value, where)
        values[name] = tuple(value) if isinstance(value, list) else value
    return kind(**values)


def _claim(
    root: Path, settings: train.TrainSettings, detector: Detector, prints: dict[str, str]
) -> None:
    path = root / "settings.json"
    if path.exists():
        noted = files.read_json(path)
        if noted.get("fingerprints") != prints:
            raise InputError(
                f"{root} holds a run with other settings or another detector: "
                "give another folder, or delete this one"
            )
        return
    if any(root.glob("[!.]*")):
        raise InputError(f"{root} is not empty and holds no run: give another folder")
    detector_io.save(detector, root / "detector.json")
    files.write_json(
        path,
        {
            "settings": as_dict(settings),
            "fingerprints": prints,
            "versions": versions(),
            "seed": settings.seed,
        },
    )


def _resume(
    root: Path, settings: train.TrainSettings, prints: dict[str, str]
) -> tuple[LearnerState, np.random.Generator, int]:
    """Where the run stands; what was written after its last checkpoint is dropped."""
    state, rng, first = train.begin(settings), train.stream(settings), 0
    if (root / "checkpoint.npz").exists():
        found = checkpoint.load(root / "checkpoint.npz", state, prints)
        state, first = found.state, int(found.extra["epoch"])
        rng.bit_generator.state = found.extra["rng"]
    log = root / "epochs.jsonl"
    kept = log.read_text(encoding="utf-8").splitlines(keepends=True)[:first] if first else []
    if len(kept) < first:
        raise InputError(f"{log} has fewer lines than its checkpoint has epochs: delete {root}")
    files.write_text(log, "".join(kept))
    (root / "services").mkdir(exist_ok=True)
    for path in (root / "services").iterdir():
        if path.suffix != ".parquet" or int(path.stem.split("-")[1]) > first:
            path.unlink()
    return state, rng, first


def _keep(
    root: Path,
    state: LearnerState,
    rng: np.random.Generator,
    epoch: int,
    services: list[Interactions],
    lines: list[str],
    prints: dict[str, str],
) -> None:
    """Everything since the last checkpoint, and the checkpoint last of all."""
    first = epoch - len(services)
    Interactions.concat(services).write_parquet(
        root / "services" / f"{first:06d}-{epoch:06d}.parquet"
    )
    with (root / "epochs.jsonl").open("a", encoding="utf-8") as log:
        log.write("".join(f"{line}\n" for line in lines))
        log.flush()
        os.fsync(log.fileno())
    checkpoint.save(
        root / "checkpoint.npz",
        state,
        fingerprints=prints,
        extra={"epoch": epoch, "rng": rng.bit_generator.state},
    )


def _line(record: train.EpochRecord) -> str:
    """The epoch as JSON, without the clock: an undisturbed and a resumed run log the same."""
    numbers = {k: v for k, v in record.numbers.items() if not k.startswith("time_")}
    return json.dumps({"epoch": record.epoch} | numbers, allow_nan=False)
