"""One run in a folder: it can be stopped at any moment and goes on bit for bit.

A folder holds ``settings.json`` (settings, versions, fingerprint), ``detector.json``,
``epochs.jsonl`` (a line an epoch), ``services/`` (Parquet, a file for each checkpoint),
``states/`` (what was to be seen of them, likewise), ``checkpoint.npz`` and, once an experiment
has tested what was learned, ``done.json``.
"""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import re
import shutil
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.methods import detector_file, registry
from evenhand.methods.issue_weights import IssueWeights
from evenhand.methods.paper.detector import Detector
from evenhand.methods.services import Services
from evenhand.restaurant import worlds
from evenhand.restaurant.simulation.recording import Recording
from evenhand.restaurant.worlds import World
from evenhand.training import checkpoint, epoch_log, policy, recordings, train
from evenhand.training.checkpoint import State
from evenhand.training.memory import Memory
from evenhand.training.settings import TrainSettings
from evenhand.training.update import LearnerState

CHECKPOINT_EVERY = 50
"""Epochs between checkpoints; a killed run loses at most so many."""

Progress = Callable[[dict[str, Any]], None]
"""Told the numbers of every epoch; when a run goes on, first what it holds already."""
_SERVICES = re.compile(r"(\d{6,})-(\d{6,})\.parquet")


def versions() -> dict[str, str]:
    """Versions of what decides results."""
    names = ("evenhand", "mujoco", "numba", "numpy", "jax", "equinox", "optax", "scikit-learn")
    return {"python": platform.python_version()} | {name: version(name) for name in names}


def other_versions(then: dict[str, Any], here: dict[str, Any]) -> str:
    """What differs between versions but for Python itself; empty if nothing does."""
    return files.differences(then | {"python": ""}, here | {"python": ""})


def as_dict(settings: Any) -> dict[str, Any]:
    """Settings as JSON holds them; a method by name, settings and a hash of its source."""
    content = {
        field.name: getattr(settings, field.name)
        for field in dataclasses.fields(settings)
        if field.name != "method"
    }
    plain = json.loads(json.dumps(content, default=dataclasses.asdict))
    if isinstance(settings, TrainSettings):
        plain["method"] = registry.described(settings.method)
    return {field.name: plain[field.name] for field in dataclasses.fields(settings)}


def sources(settings: TrainSettings) -> dict[str, str]:
    """Fingerprints of files that are not Evenhand's own and decide what a run does."""
    return worlds.sources(settings.scenario) | policy.sources(settings.policy.kind)


def fingerprint(settings: TrainSettings) -> str:
    """Of the settings of a run, and of the files of others that they name."""
    return checkpoint.fingerprint(as_dict(settings) | sources(settings))


def execute(
    folder: str | os.PathLike[str],
    settings: TrainSettings,
    detector: Detector | None,
    *,
    every: int = CHECKPOINT_EVERY,
    progress: Progress | None = None,
    recorded: bool = False,
    threads: int = 1,
) -> LearnerState:
    """Train in a folder, from the start or from where an earlier process stopped.

    Args:
        folder: of this run; made if it does not exist.
        settings: of the run.
        detector: judges every epoch, if there is one.
        every: epochs between checkpoints.
        progress: told ``services`` and ``physics_steps`` (0 for what an earlier process did), and
            the other numbers of every new epoch.
        recorded: keep what was to be seen of the services (``states/``), for clips and replay.
        threads: that step the physics; results are the same on any number.

    Returns:
        The trained learner.

    Raises:
        InputError: when the detector judges something else, or the folder cannot be written, is in
            use, holds another run, or a file of it is missing or damaged.
    """
    train.check_detector(detector, settings)
    root = files.make_folder(folder)
    with files.locked(root):
        files.sweep(root)
        prints = {
            "settings": checkpoint.fingerprint(_apart_from_length(as_dict(settings))),
            "detector": "none" if detector is None else checkpoint.fingerprint(as_dict(detector)),
            **sources(settings),
        }
        _claim(root, settings, detector, prints)
        state, rng, first, memory = _resume(root, settings, prints)
        if first and progress is not None:
            progress({"services": first * settings.people, "physics_steps": 0})
        services: list[Services] = []
        seen: list[Recording] = []
        lines: list[str] = []
        for record in train.train(
            settings,
            detector,
            state=state,
            rng=rng,
            first_epoch=first,
            memory=memory,
            recorded=recorded,
            threads=threads,
        ):
            services.append(record.services)
            if record.seen is not None:
                seen.append(record.seen)
            lines.append(_line(record))
            state = record.state
            if progress is not None:
                progress({"epoch": record.epoch} | record.numbers)
            ended = record.epoch + 1
            if ended % every == 0 or ended == settings.epochs:
                if seen:
                    recordings.keep(root, seen, ended)
                _keep(root, record, services, lines, prints)
                services, seen, lines = [], [], []
        return state


def drop_edited(folder: str | os.PathLike[str], settings: TrainSettings) -> None:
    """Delete a run that is the same but for the source of its method, which was edited since.

    Args:
        folder: of the run, if there is one.
        settings: of the run as it would be now.
    """
    path = Path(folder) / "settings.json"
    if not path.exists():
        return
    noted, now = files.read_record(path, "settings")["settings"], as_dict(settings)
    source = noted.get("method", {}).get("source") if isinstance(noted, dict) else None
    if source is None or source == now["method"]["source"]:
        return
    if noted == now | {"method": now["method"] | {"source": source}}:
        shutil.rmtree(folder)


def finished(folder: str | os.PathLike[str], key: str) -> dict[str, Any] | None:
    """What ``done.json`` says if the run ended under this key, else None."""
    path = Path(folder) / "done.json"
    if not path.exists():
        return None
    done = files.read_record(path, "key")
    return done if done["key"] == key else None


def finish(folder: str | os.PathLike[str], key: str, content: dict[str, Any]) -> None:
    """Note that a run and all that follows from it have ended."""
    files.write_json(Path(folder) / "done.json", {"key": key} | content)


def read_services(folder: str | os.PathLike[str]) -> Services:
    """All services of a run, in order.

    Raises:
        InputError: when there are none or a file cannot be read.
    """
    found = _service_files(Path(folder))
    if not found:
        raise InputError(
            "missing folder", f"{folder} holds no services: it is no run folder, or nothing ran yet"
        )
    return Services.concat([Services.read_parquet(path) for path in found])


def world_of(folder: str | os.PathLike[str]) -> World:
    """The world that a run was trained in.

    Raises:
        InputError: when the folder holds no run, or its scenario is not known here or was edited.
    """
    path = Path(folder) / "settings.json"
    if not path.exists():
        raise InputError(
            "missing folder", f"{folder} holds no run: there is no settings.json in it"
        )
    noted = files.read_record(path, "settings", "fingerprints")
    name = _known_scenario(noted["settings"], folder)
    for source, text in worlds.sources(name).items():
        if noted["fingerprints"].get(source) != text:
            raise InputError(
                "changed scenario",
                f"the file of {source} was edited since {folder} was trained: restore it",
            )
    return worlds.scenario(name)


def _known_scenario(noted: dict[str, Any], folder: str | os.PathLike[str]) -> str:
    for one in noted["scenario"].split("+"):
        if one not in worlds.names():
            raise InputError(
                "unknown scenario",
                f"{folder} was trained in scenario {one!r}, which is not known here: "
                "name its file by --plugin",
            )
    return noted["scenario"]


def load_policy(folder: str | os.PathLike[str]) -> tuple[TrainSettings, LearnerState]:
    """Settings and last state of a run.

    Raises:
        InputError: when the folder holds no run, or its files do not fit together.
    """
    root = Path(folder)
    path = root / "settings.json"
    if not path.exists():
        raise InputError("missing folder", f"{root} holds no run: there is no settings.json in it")
    noted = _noted(path)
    _known_scenario(noted["settings"], root)
    settings = _from_dict(TrainSettings, noted["settings"], path)
    if not (root / "checkpoint.npz").exists():
        raise InputError(
            "missing checkpoint",
            f"{root} has no checkpoint yet, there is one every {CHECKPOINT_EVERY} epochs: "
            "let the run go on",
        )
    like = State(train.untrained(settings))
    found = checkpoint.load(root / "checkpoint.npz", like, noted["fingerprints"])
    return settings, found.state.learner


def _noted(path: Path) -> dict[str, Any]:
    """``settings.json``, which has not been changed since it was written."""
    noted = files.read_record(path, "settings", "fingerprints", "versions", "whole")
    prints = noted["fingerprints"]
    if noted["whole"] != checkpoint.fingerprint(noted["settings"]) or not isinstance(prints, dict):
        raise InputError(
            "changed file", f"{path} was changed after the run began: restore it, or begin anew"
        )
    return noted


def _apart_from_length(plain: dict[str, Any]) -> dict[str, Any]:
    """Settings but for how long the run is: a training can be extended."""
    annealed = plain["update"]["anneal_updates"]
    if annealed == plain["epochs"]:
        annealed = "to the end"
    return plain | {"epochs": None, "update": plain["update"] | {"anneal_updates": annealed}}


def _from_dict(kind: type, content: dict[str, Any], where: Path) -> Any:
    names = [field.name for field in dataclasses.fields(kind)]
    odd = sorted(set(names) ^ set(content))
    if odd:
        raise InputError(
            "changed file",
            f"{where} is of another version of Evenhand, which differs in {', '.join(odd)}: "
            "use that version, or begin anew",
        )
    values: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        value = content[field.name]
        if field.name == "method":
            value = registry.restored(value)
        elif isinstance(value, dict):
            part = IssueWeights if field.name == "judges" else field.default_factory
            assert isinstance(part, type)
            value = _from_dict(part, value, where)
        values[field.name] = tuple(value) if isinstance(value, list) else value
    return kind(**values)


def _claim(
    root: Path, settings: TrainSettings, detector: Detector | None, prints: dict[str, str]
) -> None:
    path = root / "settings.json"
    if path.exists():
        noted, now = _noted(path), as_dict(settings)
        _from_dict(TrainSettings, noted["settings"], path)  # another version's are no other run
        differs = files.differences(noted["settings"], now)
        extended = noted["settings"]["epochs"] < settings.epochs
        if extended and _apart_from_length(noted["settings"]) == _apart_from_length(now):
            differs = ""
        if not differs and noted["fingerprints"] != prints:
            names = {*prints, *noted["fingerprints"]} - {"settings"}
            other = [n for n in sorted(names) if noted["fingerprints"].get(n) != prints.get(n)]
            differs = f"another {other[0]}"
        if differs:
            raise InputError(
                "conflict folder",
                f"{root} holds another run ({differs}): give another folder, or delete this one",
            )
        if extended:
            lengths = [*noted.get("extended", []), noted["settings"]["epochs"]]
            files.write_json(path, noted | _settings_noted(now) | {"extended": lengths})
    elif any(root.glob("[!.]*")):
        raise InputError(
            "conflict folder", f"{root} is not empty and holds no run: give another folder"
        )
    else:
        noted = {"fingerprints": prints, "versions": versions(), "seed": settings.seed}
        files.write_json(path, _settings_noted(as_dict(settings)) | noted)
    if detector is not None and not (root / "detector.json").exists():
        detector_file.save(detector, root / "detector.json")


def _settings_noted(plain: dict[str, Any]) -> dict[str, Any]:
    return {"settings": plain, "whole": checkpoint.fingerprint(plain)}


def _resume(
    root: Path, settings: TrainSettings, prints: dict[str, str]
) -> tuple[LearnerState, np.random.Generator, int, Memory]:
    """Where the run stands; what was written after its last checkpoint is dropped."""
    rng, first, memory = train.stream(settings), 0, Memory.begin(settings)
    if (root / "checkpoint.npz").exists():
        like = State(train.untrained(settings), memory)
        found = checkpoint.load(root / "checkpoint.npz", like, prints)
        (state, memory), first = found.state, int(found.extra["epoch"])
        rng.bit_generator.state = found.extra["rng"]
    else:
        state = train.begin(settings)
    if 0 < first < settings.epochs:
        check_versions(root, files.read_record(root / "settings.json", "versions")["versions"])
    log = root / "epochs.jsonl"
    kept = log.read_bytes().splitlines(keepends=True)[:first] if log.exists() else []
    if len(epoch_log.parse(log, kept)) < first:
        raise InputError(
            "changed folder",
            f"{log} has {len(kept)} lines, but {first} epochs have run: delete {root} and run the "
            "same command again",
        )
    files.write_text(log, b"".join(kept).decode())
    recordings.drop(root, first)
    services = files.make_folder(root / "services")
    files.sweep(services)
    there = 0
    for path in _service_files(root):
        begin, end = _epochs_of(path)
        if end > first:
            path.unlink()
        elif begin != there:
            break
        else:
            there = end
    if there < first:
        raise InputError(
            "missing services",
            f"{services} lacks the services of epoch {there}: delete {root} and run the same "
            "command again",
        )
    return state, rng, first, memory


def check_versions(where: Path, then: dict[str, Any]) -> None:
    """Another version may calculate otherwise, and a run goes on bit for bit or not at all.

    Raises:
        InputError: when the versions noted there differ from those of now.
    """
    if differs := other_versions(then, versions()):
        raise InputError(
            "changed file",
            f"{where} was begun with other versions ({differs}): install those, or begin anew in "
            "another folder",
        )


def _service_files(root: Path) -> list[Path]:
    """Files of services in the order of their epochs."""
    named = [p for p in (root / "services").glob("*") if _SERVICES.fullmatch(p.name)]
    return sorted(named, key=_epochs_of)


def _epochs_of(path: Path) -> tuple[int, int]:
    first, last = path.stem.split("-")
    return int(first), int(last)


def _keep(
    root: Path,
    record: train.EpochRecord,
    services: list[Services],
    lines: list[str],
    prints: dict[str, str],
) -> None:
    """Everything since the last checkpoint, and the checkpoint last of all."""
    epoch = record.epoch + 1
    Services.concat(services).write_parquet(
        root / "services" / f"{epoch - len(services):06d}-{epoch:06d}.parquet"
    )
    files.append_text(root / "epochs.jsonl", "".join(f"{line}\n" for line in lines))
    checkpoint.save(
        root / "checkpoint.npz",
        State(record.state, record.memory),
        fingerprints=prints,
        extra={"epoch": epoch, "rng": record.rng},
    )


def _line(record: train.EpochRecord) -> str:
    """The epoch as JSON, without the clock: an undisturbed and a resumed run log the same."""
    numbers = {k: v for k, v in record.numbers.items() if not k.startswith("time_")}
    return json.dumps({"epoch": record.epoch} | numbers, allow_nan=False)
