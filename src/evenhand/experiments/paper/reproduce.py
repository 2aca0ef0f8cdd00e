"""The paper's experiment from end to end: demonstrations, study, training, test, report."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from time import monotonic
from typing import Any

from evenhand.core import files
from evenhand.core.processes import Stage, Task, Tell, run_all
from evenhand.experiments import provenance
from evenhand.experiments.paper import claims, demonstrations, tables
from evenhand.experiments.paper.report.build import build
from evenhand.experiments.settings import DEMO_SEED, PRESETS, TEST_SEED, ReproduceSettings
from evenhand.methods import detector_file, registry
from evenhand.report.table import write
from evenhand.restaurant import replay
from evenhand.restaurant.replay.page import read_script
from evenhand.training import checkpoint, epoch_log, evaluate, recordings, run_folder
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import TrainSettings, settings_of

ARMS: dict[str, tuple[str, str]] = {
    "reinforce": ("reinforce", "score@1"),
    "reinforce+guidance": ("reinforce", "penalty"),
    "reinforce+levelup": ("reinforce", "levelup"),
    "ppo": ("ppo", "score@1"),
    "ppo+guidance": ("ppo", "penalty"),
    "ppo+levelup": ("ppo", "levelup"),
}
"""Arm -> (algorithm, method): Eq. 4, which pays as much as a perfect service; Eq. 4 and 5;
Evenhand's own, which needs a service reward and is therefore no arm of the preset paper."""
_EPOCH_COLUMNS = (
    "total", "willingness", "quality", "priority", "risk", "biased_detector", "biased_threshold",
    "probability", "perfect_rate", "response_rate", "mean_response_distance",
    "mean_response_step",
)  # fmt: skip


def arms_of(preset: str) -> list[str]:
    """Names of the arms of a preset, in order."""
    if preset == "service":
        return list(ARMS)
    return [arm for arm, (_, name) in ARMS.items() if hasattr(registry.create(name), "alone")]


def reproduce(settings: ReproduceSettings, stage: Stage, command: str) -> Path:
    """Run whatever is missing in the folder, then write tables, claims and the report.

    Returns:
        Path of the report.

    Raises:
        InputError: when the folder cannot be written, is in use, or holds another experiment, or
            runs of other versions.
    """
    out = files.make_folder(settings.out)
    read_script()  # what cannot be shown in the end is said before hours of work
    with files.locked(out):
        _claim_folder(out, settings)
        made = provenance.now()
        _check_origins(out, settings, made)
        for name in (".", "data", "figures", "runs", "data/demonstrations"):
            files.sweep(files.make_folder(out / name))
        clock = out / "data" / "stages.json"
        with _timed(clock, "demonstrations"):
            shown = _demonstrate(out, settings, stage)
        with _timed(clock, "study"):
            study = demonstrations.study(shown, DEMO_SEED)
            detector_file.save(study.detector, out / "data" / "detector.json")
        with _timed(clock, "training and test"):
            _train(out, settings, made, stage)
        with _timed(clock, "tables"):
            tell = stage("tables and report", 1)
            results = finished(out, settings)
            _write_tables(out, shown, study, results)
        _write_manifest(out, settings, command, made, results, files.read_record(clock))
        page = build(out, settings.workers)
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
    provenance.claim(out, "experiment.json", fixed)


def _demonstrate(out: Path, settings: ReproduceSettings, stage: Stage) -> demonstrations.Demos:
    folder = out / "data" / "demonstrations"
    tell = stage("demonstrations", settings.windows * evaluate.WINDOW)
    run_all(
        demonstrations.tasks(settings.windows, DEMO_SEED, settings.population, folder),
        settings.workers,
        tell,
    )
    return demonstrations.load(settings.windows, DEMO_SEED, folder)


def training_of(preset: str, arm: str, seed: int, epochs: int, population: str) -> TrainSettings:
    """Settings of a run."""
    algorithm, name = ARMS[arm]
    reward, scenario = ("service", "prejudiced") if preset == "prejudiced" else (preset, "even")
    settings = settings_of(reward, algorithm, name, seed=seed, epochs=epochs, population=population)
    settings = replace(settings, scenario=scenario)
    # the paper's arms stay as printed, and a tenth of their time is saved
    return replace(settings, reflect=arm not in arms_of("paper"))


def key_of(training: TrainSettings, services: int) -> str:
    """What a finished run was: under another key it does not count, and is tested again."""
    prints = checkpoint.fingerprint(run_folder.as_dict(training))
    return f"{training.epochs} epochs, {services} services, settings {prints}"


def _run_of(settings: ReproduceSettings, preset: str, arm: str, seed: int) -> tuple[Path, str]:
    training = training_of(preset, arm, seed, settings.epochs, settings.population)
    folder = settings.out / "runs" / preset / arm / f"seed-{seed:02d}"
    return folder, key_of(training, settings.services)


def _seeds_there(out: Path, preset: str) -> list[int]:
    """Seeds of a preset that any arm has a folder of, in order."""
    found = (re.fullmatch(r"seed-(\d+)", path.name) for path in (out / "runs" / preset).glob("*/*"))
    return sorted({int(match.group(1)) for match in found if match})


def finished(out: Path, settings: ReproduceSettings) -> list[dict[str, Any]]:
    """Every run in a folder that has ended, of whichever call, in order.

    A seed counts once all arms of its preset have it: without and with guidance are paired.

    Returns:
        preset, arm, seed and folder of each, and what its ``done.json`` says.
    """
    found = []
    for preset in PRESETS:
        whole = []
        for seed in _seeds_there(out, preset):
            for arm in arms_of(preset):
                folder, key = _run_of(settings, preset, arm, seed)
                head = {"preset": preset, "arm": arm, "seed": seed, "folder": folder}
                whole.append((head, run_folder.finished(folder, key)))
        lacking = {head["seed"] for head, done in whole if done is None}
        found += [head | done for head, done in whole if done and head["seed"] not in lacking]
    order = {name: i for i, name in enumerate(ARMS)}
    return sorted(found, key=lambda r: (r["preset"], order[r["arm"]], r["seed"]))


def _check_origins(out: Path, settings: ReproduceSettings, made: provenance.Origin) -> None:
    """No run that is there was made by other versions."""
    for preset in PRESETS:
        for seed in _seeds_there(out, preset):
            for arm in arms_of(preset):
                folder, key = _run_of(settings, preset, arm, seed)
                done = run_folder.finished(folder, key) or {}
                provenance.check(folder, provenance.of_run(folder, done), made)


def _train(out: Path, settings: ReproduceSettings, made: provenance.Origin, stage: Stage) -> None:
    tasks = []
    # PPO takes longest: begin with it, so that no process is left alone with it at the end
    for preset in sorted(settings.preset, reverse=True):
        for arm in reversed(arms_of(preset)):
            for seed in range(settings.seeds):
                folder, key = _run_of(settings, preset, arm, seed)
                tasks.append(
                    Task(
                        f"{preset}, {arm}, seed {seed}",
                        train_and_test,
                        {
                            "folder": folder,
                            "made": made,
                            "detector": out / "data" / "detector.json",
                            "training": training_of(
                                preset, arm, seed, settings.epochs, settings.population
                            ),
                            "services": settings.services,
                            "page": replay_page(out, preset, arm, seed),
                        },
                        finished=run_folder.finished(folder, key) is not None,
                    )
                )
    units = len(tasks) * (settings.epochs * evaluate.WINDOW + settings.services)
    beside = tables.study_task(out / "data", settings.windows, DEMO_SEED)
    run_all([*tasks, beside], settings.workers, stage("training and test", units))


def train_and_test(
    *,
    tell: Tell,
    folder: Path,
    made: provenance.Origin,
    detector: Path,
    training: TrainSettings,
    services: int,
    page: Path | None,
) -> None:
    """One run in its folder: train, or go on training; then serve people it never saw."""
    key = key_of(training, services)
    if run_folder.finished(folder, key) is not None:
        tell(training.epochs * evaluate.WINDOW + services, {"physics_steps": 0})
        return
    set_up_jax()
    state = run_folder.execute(
        folder,
        training,
        detector_file.load(detector),
        progress=lambda numbers: tell(
            numbers["services"], {"physics_steps": numbers["physics_steps"]}
        ),
        recorded=True,
    )
    seed = TEST_SEED + training.seed
    table = evaluate.serve_policy(state, training, services, seed)
    test = evaluate.summary(table, seed)
    if page is not None:
        write_replay(folder, page)
    run_folder.finish(folder, key, {"test": test} | made)
    tell(services, {"physics_steps": int(table.fact("steps").sum())})


def _write_tables(
    out: Path,
    shown: demonstrations.Demos,
    study: demonstrations.Study,
    results: Sequence[dict[str, Any]],
) -> None:
    data = out / "data"
    epochs: list[tables.Row] = []
    test: list[tables.Row] = []
    tidy: list[tables.Row] = []
    reflected: list[tables.Row] = []
    for result in results:
        algorithm, name = ARMS[result["arm"]]
        head = {name: result[name] for name in ("preset", "arm", "seed")}
        lines = epoch_log.read(result["folder"])
        epochs += [
            head
            | {
                "algorithm": algorithm,
                "guided": not name.startswith("score"),
                "epoch": line["epoch"],
            }
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
    write(data / "epochs.csv", epochs)
    write(data / "test.csv", test)
    # a preset without Evenhand's own arms has no row of it
    write(data / "reflection.csv", reflected, tables.REFLECTION_COLUMNS)
    write(out / "results.csv", tidy, ("preset", "arm", "seed", "metric", "value"))
    files.write_json(out / "claims.json", claims.all_claims(shown, study, epochs, test))


def _reflection_settings(folder: Path) -> dict[str, Any]:
    noted = files.read_record(folder / "settings.json", "settings")["settings"]
    return noted.get("reflection", {})  # a run from before there was any has no such lines either


def _write_manifest(
    out: Path,
    settings: ReproduceSettings,
    command: str,
    made: provenance.Origin,
    results: Sequence[dict[str, Any]],
    clock: dict[str, float],
) -> None:
    plain = {name: value for name, value in asdict(settings).items() if name != "out"}
    seeds_of = {
        preset: sorted({result["seed"] for result in results if result["preset"] == preset})
        for preset in dict.fromkeys(result["preset"] for result in results)
    }
    seeds = sorted({result["seed"] for result in results})
    origins = [provenance.of_run(result["folder"], result) for result in results]
    files.write_json(
        out / "manifest.json",
        {
            **provenance.heading(made, command),
            # of everything in the folder, whichever call added it
            "settings": plain | {"preset": list(seeds_of), "seeds": len(seeds)},
            "versions": made["versions"],
            "made_with": provenance.distinct(origins),
            "seeds": seeds,
            "seeds_of": seeds_of,
            "test_seeds": [TEST_SEED + seed for seed in seeds],
            "demonstration_seed": DEMO_SEED,
            "eval_services": settings.services,
            "epochs": settings.epochs,
            "people": evaluate.WINDOW,
            "population": settings.population,
            "elapsed_s": round(sum(clock.values()), 1),
            "stages": clock,
            "replays": replay_links(out),
        },
    )


REPLAYED = {"paper": ("ppo", 0), "service": ("ppo+levelup", 0)}
"""Preset -> arm and seed: what the printed reward leads to, and what Evenhand's guidance does."""


def replay_page(out: Path, preset: str, arm: str, seed: int) -> Path | None:
    """Where the page of a run stands; None for a run that has none."""
    if REPLAYED.get(preset) != (arm, seed):
        return None
    return out / "replays" / f"{preset}-{arm}-seed-{seed}.html"


def write_replay(folder: Path, page: Path) -> None:
    """Write the page of a finished run, once.

    Raises:
        InputError: when the run was not recorded, or the page cannot be written.
    """
    if page.exists():
        return
    table = run_folder.read_services(folder)
    seen = recordings.read(folder, replay.choose(table))
    files.make_folder(page.parent)
    replay.write(
        seen,
        table,
        page,
        title=f"After training: {page.stem}",
        note=(
            f"The run served {len(table):,} people. These are of the latest, chosen so that every "
            "issue there is can be seen: they are no sample."
        ),
    )


def replay_links(out: Path) -> list[dict[str, str]]:
    """The pages that are there: address beside the report, preset, arm, seed."""
    return [
        {"page": f"replays/{page.name}", "preset": preset, "arm": arm, "seed": str(seed)}
        for preset, (arm, seed) in REPLAYED.items()
        if (page := replay_page(out, preset, arm, seed)) is not None and page.exists()
    ]
