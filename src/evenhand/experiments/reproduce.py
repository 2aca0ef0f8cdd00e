"""The paper's experiment from end to end: demonstrations, study, training, test, report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import Any

from evenhand import detector_io, files, report
from evenhand.experiments import claims, demos, measure, replays, study_tables, tables
from evenhand.experiments.pool import Task, Tell, run_all
from evenhand.experiments.settings import DEMO_SEED, TEST_SEED, ReproduceSettings
from evenhand.guidance import SERVICE_KINDS
from evenhand.learn import run
from evenhand.learn.runtime import set_up_jax
from evenhand.learn.settings import settings_of
from evenhand.replay.page import read_script

ARMS: dict[str, tuple[str, str]] = {
    "reinforce": ("reinforce", "score"),
    "reinforce+guidance": ("reinforce", "penalty"),
    "reinforce+levelup": ("reinforce", "levelup"),
    "ppo": ("ppo", "score"),
    "ppo+guidance": ("ppo", "penalty"),
    "ppo+levelup": ("ppo", "levelup"),
}
"""Arm -> (algorithm, kind of guidance): Eq. 4; Eq. 4 and 5; Evenhand's own, which needs a service
reward and is therefore no arm of the preset paper."""
_EPOCH_COLUMNS = (
    "total", "willingness", "quality", "priority", "risk", "biased_detector", "biased_threshold",
    "probability", "perfect_rate", "response_rate", "mean_response_distance",
    "mean_response_step",
)  # fmt: skip


def arms_of(preset: str) -> list[str]:
    """Names of the arms of a preset, in order."""
    added = SERVICE_KINDS if preset == "paper" else ()
    return [arm for arm, (_, kind) in ARMS.items() if kind not in added]


Stage = Callable[[str, int], Tell]
"""Called with a stage's name and its units (services); returns where to tell progress."""


def reproduce(settings: ReproduceSettings, stage: Stage, command: str) -> Path:
    """Run whatever is missing in the folder, then write tables, claims and the report.

    Args:
        settings: of the experiment.
        stage: shows progress.
        command: noted in the manifest.

    Returns:
        Path of the report.

    Raises:
        InputError: when the folder cannot be written, is in use, or holds another experiment.
    """
    out = files.make_folder(settings.out)
    read_script()  # what cannot be shown in the end is said before hours of work
    with files.locked(out):
        _claim_folder(out, settings)
        for name in (".", "data", "figures", "runs", "data/demonstrations"):
            files.sweep(files.make_folder(out / name))
        clock = out / "data" / "stages.json"
        with _timed(clock, "demonstrations"):
            shown = _demonstrate(out, settings, stage)
        with _timed(clock, "study"):
            study = demos.study(shown, DEMO_SEED)
            detector_io.save(study.detector, out / "data" / "detector.json")
        with _timed(clock, "training and test"):
            results = _train(out, settings, stage)
        with _timed(clock, "tables"):
            tell = stage("tables and report", 1)
            _write_tables(out, shown, study, results)
        _write_manifest(out, settings, command, files.read_record(clock))
        page = report.build(out, settings.workers)
        tell(1, {})
    return page


@contextmanager
def _timed(clock: Path, name: str) -> Iterator[None]:
    """Add the seconds of a stage to a file, so that those of an interrupted call count too."""
    began = monotonic()
    try:
        yield
    finally:
        spent = files.read_record(clock) if clock.exists() else {}
        spent[name] = round(spent.get(name, 0.0) + monotonic() - began, 1)
        files.write_json(clock, spent)


def _claim_folder(out: Path, settings: ReproduceSettings) -> None:
    """A folder holds one experiment; more seeds or presets may be added to it."""
    fixed = {
        name: value
        for name, value in asdict(settings).items()
        if name not in ("out", "workers", "seeds", "preset")
    }
    files.claim_folder(out, "experiment.json", fixed)


def _demonstrate(out: Path, settings: ReproduceSettings, stage: Stage) -> demos.Demos:
    folder = out / "data" / "demonstrations"
    tell = stage("demonstrations", settings.windows * measure.WINDOW)
    run_all(
        demos.tasks(settings.windows, DEMO_SEED, settings.population, folder),
        settings.workers,
        tell,
    )
    return demos.load(settings.windows, DEMO_SEED, folder)


def _train(out: Path, settings: ReproduceSettings, stage: Stage) -> list[dict[str, Any]]:
    """Train and test every arm; returns what each run's ``done.json`` says, with its epochs."""
    tasks, heads = [], []
    # PPO takes longest: begin with it, so that no process is left alone with it at the end
    for preset in sorted(settings.preset, reverse=True):
        for arm in reversed(arms_of(preset)):
            for seed in range(settings.seeds):
                head = {"preset": preset, "arm": arm, "seed": seed}
                folder = out / "runs" / preset / arm / f"seed-{seed:02d}"
                key = f"{settings.epochs} epochs, {settings.services} services"
                heads.append(head)
                tasks.append(
                    Task(
                        f"{preset}, {arm}, seed {seed}",
                        train_and_test,
                        {
                            "folder": folder,
                            "key": key,
                            "detector": out / "data" / "detector.json",
                            "epochs": settings.epochs,
                            "population": settings.population,
                            "services": settings.services,
                            "page": replays.page_of(out, preset, arm, seed),
                            **head,
                        },
                        finished=run.finished(folder, key) is not None,
                    )
                )
    units = len(tasks) * (settings.epochs * measure.WINDOW + settings.services)
    beside = study_tables.task(out / "data", settings.windows, DEMO_SEED)
    *results, _ = run_all([*tasks, beside], settings.workers, stage("training and test", units))
    order = {name: i for i, name in enumerate(ARMS)}
    found = [head | result for head, result in zip(heads, results, strict=True)]
    return sorted(found, key=lambda r: (r["preset"], order[r["arm"]], r["seed"]))


def train_and_test(
    *,
    tell: Tell,
    folder: Path,
    key: str,
    detector: Path,
    preset: str,
    arm: str,
    seed: int,
    epochs: int,
    population: str,
    services: int,
    page: Path | None,
) -> dict[str, Any]:
    """One run in its folder: train, or go on training; then serve people it never saw."""
    done = run.finished(folder, key)
    if done is not None:
        tell(epochs * measure.WINDOW + services, {"physics_steps": 0})
        return {"test": done["test"], "folder": str(folder)}
    set_up_jax()
    algorithm, kind = ARMS[arm]
    settings = settings_of(preset, algorithm, kind, seed=seed, epochs=epochs, population=population)
    # the paper's arms stay as printed, and a tenth of their time is saved
    settings = replace(settings, reflect=kind in SERVICE_KINDS)
    state = run.execute(
        folder,
        settings,
        detector_io.load(detector),
        progress=lambda numbers: tell(
            numbers["services"], {"physics_steps": numbers["physics_steps"]}
        ),
        recorded=True,
    )
    table = measure.serve_policy(state, settings, services, TEST_SEED + seed)
    test = measure.summary(table, TEST_SEED + seed)
    if page is not None:
        replays.write(folder, page)
    run.finish(folder, key, {"test": test})
    tell(services, {"physics_steps": int(table.fact("steps").sum())})
    return {"test": test, "folder": str(folder)}


def _write_tables(
    out: Path, shown: demos.Demos, study: demos.Study, results: Sequence[dict[str, Any]]
) -> None:
    data = out / "data"
    epochs: list[tables.Row] = []
    test: list[tables.Row] = []
    tidy: list[tables.Row] = []
    reflected: list[tables.Row] = []
    for result in results:
        algorithm, kind = ARMS[result["arm"]]
        head = {name: result[name] for name in ("preset", "arm", "seed")}
        lines = run.read_epochs(result["folder"])
        epochs += [
            head
            | {"algorithm": algorithm, "guided": kind != "score", "epoch": line["epoch"]}
            | {name: line[name] for name in _EPOCH_COLUMNS}
            for line in lines
        ]
        test.append(head | result["test"])
        found = tables.reflection(head, lines, _reflection_settings(Path(result["folder"])))
        reflected += found
        numbers = result["test"] | {
            "biased_epochs_detector": sum(line["biased_detector"] for line in lines),
            "biased_epochs_threshold": sum(line["biased_threshold"] for line in lines),
            "reflection_alarms": sum(row["alarm"] for row in found) if found else None,
        }
        tidy += [head | {"metric": name, "value": value} for name, value in numbers.items()]
    tables.write(data / "epochs.csv", epochs)
    tables.write(data / "test.csv", test)
    # a preset without Evenhand's own arms has no row of it
    tables.write(data / "reflection.csv", reflected, tables.REFLECTION_COLUMNS)
    tables.write(out / "results.csv", tidy, ("preset", "arm", "seed", "metric", "value"))
    files.write_json(out / "claims.json", claims.all_claims(shown, study, epochs, test))


def _reflection_settings(folder: Path) -> dict[str, Any]:
    """Rate and history that a run was made with."""
    noted = files.read_record(folder / "settings.json", "settings")["settings"]
    return noted.get("reflection", {})  # a run from before there was any has no such lines either


def _write_manifest(
    out: Path, settings: ReproduceSettings, command: str, clock: dict[str, float]
) -> None:
    plain = {name: value for name, value in asdict(settings).items() if name != "out"}
    versions = run.versions()
    files.write_json(
        out / "manifest.json",
        {
            "version": versions["evenhand"],
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "command": command,
            "settings": plain | {"preset": list(settings.preset)},
            "versions": versions,
            "seeds": list(range(settings.seeds)),
            "test_seeds": [TEST_SEED + seed for seed in range(settings.seeds)],
            "demonstration_seed": DEMO_SEED,
            "eval_services": settings.services,
            "epochs": settings.epochs,
            "people": measure.WINDOW,
            "population": settings.population,
            "elapsed_s": round(sum(clock.values()), 1),
            "stages": clock,
            "replays": replays.links(out),
        },
    )
