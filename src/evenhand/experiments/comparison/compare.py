"""Every way to evenness in every scenario: training, test, tables; resumable run by run.

A run is a seed of an arm in a scenario (``compare_settings.Cell``), in a folder of its own. Runs
share nothing, so that more seeds, arms or scenarios can be added to a folder at any time; tables
are made of all that is finished there.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.core.processes import Stage, Task, Tell, run_all
from evenhand.experiments import provenance
from evenhand.experiments.comparison import earlier as compare_earlier
from evenhand.experiments.comparison import tables
from evenhand.experiments.comparison.settings import (
    NO_ALGORITHM,
    Cell,
    CompareSettings,
    checked,
    learns,
    method_of,
    place,
)
from evenhand.experiments.settings import TEST_SEED
from evenhand.report.table import write
from evenhand.restaurant import worlds
from evenhand.training import epoch_log, evaluate, run_folder, train
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import TrainSettings, settings_of


def compare(
    settings: CompareSettings, stage: Stage, announce: Callable[[str], None], command: str
) -> list[tables.Row]:
    """Run whatever is missing in the folder, then write tables, manifest, figures and report.

    Returns:
        The rows of ``summary.csv``, of everything finished in the folder.

    Raises:
        InputError: for a strength out of range, or when the folder cannot be written, is in use,
            or holds another experiment, or runs of other versions.
    """
    fixed = {"epochs": settings.epochs, "services": settings.services}
    for cell in settings.cells():  # what is wrong is said before anything is written
        chosen = training_of(cell, settings.epochs)
        if cell.arm == "reference":
            chosen.world.robot_to_compare_with()
    earlier = None
    if settings.earlier is not None:
        prints = partial(fingerprint_of, epochs=settings.epochs)
        earlier = compare_earlier.load(
            settings.earlier, **fixed, prints=prints, detector=provenance.shipped_detector()
        )
    known = earlier.results if earlier else {}
    cells = [cell for cell in settings.cells() if cell not in known]
    out = files.make_folder(settings.out)
    with files.locked(out):
        files.claim_folder(out, "experiment.json", {"experiment": "compare"} | fixed)
        for name in (".", "figures", "runs"):
            files.sweep(files.make_folder(out / name))
        made = provenance.now()
        _check_origins(out, cells, made, **fixed)
        tasks = [
            Task(
                str(cell),
                train_and_test,
                {"cell": cell, "out": out, "made": made} | fixed,
                finished=run_folder.finished(cell.folder(out), key_of(cell, **fixed)) is not None,
            )
            for cell in cells
        ]
        if cells:
            announce(_plan(settings, cells, sum(task.finished for task in tasks)))
        elif earlier:
            announce(compare_earlier.all_of_it(settings.earlier, earlier))
        for sentence in _oddities(out, settings, earlier, made):
            announce(sentence)
        if cells:
            units = sum(_units(cell, **fixed) for cell in cells)
            run_all(tasks, settings.workers, stage("training and test", units))
        tell = stage("tables and report", 1)
        found = finished(out, **fixed)
        results = known | {cell: done["test"] for cell, done in found.items()}
        summary = tables.summary(results)
        write(out / "results.csv", tables.tidy(results), tables.RESULTS)
        write(out / "summary.csv", summary, tables.SUMMARY)
        write(out / "fronts.csv", tables.fronts(results), tables.FRONTS)
        write_manifest(
            out, settings, command, made, found, earlier,
            {arm: fingerprint_of(arm, settings.epochs) for arm in {c.arm for c in results}},
        )  # fmt: skip
        # here, since the processes that train need none of the figures
        from evenhand.experiments.comparison import page

        page.build(out)
        tell(1, {})
    return summary


def training_of(cell: Cell, epochs: int) -> TrainSettings:
    """Settings of a run; for an arm that learns nothing, those of the world it serves in."""
    method = cell.arm if learns(cell.arm) else "service"
    algorithm = cell.algorithm if learns(cell.arm) else "ppo"
    base = settings_of("service", algorithm, method, seed=cell.seed, epochs=epochs)
    return replace(base, scenario=cell.scenario, reflect=False)  # nothing here looks at that


def fingerprint_of(arm: str, epochs: int) -> str:
    """Of an arm's settings, whatever the scenario, the algorithm and the seed."""
    settings = training_of(Cell("even", "ppo", arm, 0), epochs)
    return run_folder.fingerprint(settings)


def key_of(cell: Cell, epochs: int, services: int) -> str:
    """What a finished run was: under another key it does not count, and is done again."""
    training = run_folder.fingerprint(training_of(cell, epochs))
    return f"{epochs} epochs, {services} services, settings {training}"


def train_and_test(
    *, tell: Tell, cell: Cell, out: Path, made: provenance.Origin, epochs: int, services: int
) -> None:
    """One run in its folder: train, or go on training; then serve people it never saw."""
    folder, key = cell.folder(out), key_of(cell, epochs, services)
    if run_folder.finished(folder, key) is not None:
        tell(_units(cell, epochs, services), {"physics_steps": 0})
        return
    set_up_jax()
    began = perf_counter()
    test, steps = learn_and_serve(tell, folder, cell, training_of(cell, epochs), services)
    seconds = round(perf_counter() - began, 1)
    run_folder.finish(folder, key, {"test": test, "seconds": seconds} | made | surroundings(cell))
    tell(services, {"physics_steps": steps})


def learn_and_serve(
    tell: Tell, folder: Path, cell: Cell, settings: TrainSettings, services: int
) -> tuple[dict[str, Any], int]:
    """Train in a folder, or go on training, if the arm learns; then serve people it never saw.

    Args:
        tell: told of the services and physics steps of training.
        folder: of the run; there afterwards.
        cell: the run.
        settings: its own, from ``training_of`` or with changes.
        services: of the test.

    Returns:
        The numbers of the test, and its physics steps.
    """
    seed = TEST_SEED + cell.seed
    method, _ = method_of(cell.arm)
    biased = None
    if learns(cell.arm):
        run_folder.drop_edited(folder, settings)
        judge = train.shipped_detector(settings)
        state = run_folder.execute(
            folder,
            settings,
            judge,
            progress=lambda n: tell(n["services"], {"physics_steps": n["physics_steps"]}),
        )
        table = evaluate.serve_policy(state, settings, services, seed)
        if judge is not None:  # else nobody judged, which is no zero
            biased = sum(line["biased_detector"] for line in epoch_log.read(folder))
    elif method == "reference":
        table = evaluate.serve_reference(settings.world, services, seed)
    else:
        table = evaluate.serve_policy(train.begin(settings), settings, services, seed)
    files.make_folder(folder)
    test = tables.numbers(table, settings.world.scheme) | {"biased_epochs": biased}
    return test, int(table.fact("steps").sum())


def surroundings(cell: Cell) -> provenance.Origin:
    """What a run depends on beside its settings: what its scenario means, and who judges."""
    return {
        "world": worlds.scenario(cell.scenario).described(),
        "detector": provenance.shipped_detector(),
    }


def finished(out: Path, epochs: int, services: int) -> dict[Cell, dict[str, Any]]:
    """What ``done.json`` says of every finished run in a folder, in order."""
    found = {}
    for folder, cell in _folders(out):
        done = None if cell is None else run_folder.finished(folder, key_of(cell, epochs, services))
        if cell is not None and done is not None:
            found.setdefault(checked(cell), done | {"folder": folder})
    return {cell: found[cell] for cell in sorted(found, key=place)}


def _folders(out: Path) -> Iterator[tuple[Path, Cell | None]]:
    for path in sorted((out / "runs").glob("*/*/*/*/done.json")):
        scenario, algorithm, arm, last = path.relative_to(out / "runs").parts[:4]
        seed = re.fullmatch(r"seed-(\d+)", last)
        cell = Cell(scenario, algorithm, arm, int(seed.group(1)) if seed else 0)
        try:
            # one joined scenario may have been written in another order
            known = cell.folder(out) == path.parent and checked(cell).arm == arm
        except InputError:
            known = False
        yield path.parent, cell if known else None


def _check_origins(
    out: Path, cells: Iterable[Cell], made: provenance.Origin, epochs: int, services: int
) -> None:
    """No run that is there was made by something else than what would make it now."""
    begun = {cell: {"folder": cell.folder(out)} for cell in cells}
    for cell, done in (begun | finished(out, epochs, services)).items():
        folder = done["folder"]
        provenance.check(folder, provenance.of_run(folder, done), made | surroundings(cell))


def _oddities(
    out: Path,
    settings: CompareSettings,
    earlier: compare_earlier.Earlier | None,
    made: provenance.Origin,
) -> Iterator[str]:
    for folder, cell in _folders(out):
        if cell is None:
            yield f"{folder} is left out: it has not the name of a run"
    for differs in compare_earlier.other_versions(earlier, made["versions"]):
        yield (
            f"{settings.earlier} was made with other versions ({differs}), and numbers of other "
            "versions may be others: the report says so"
        )


def _units(cell: Cell, epochs: int, services: int) -> int:
    trained = epochs * evaluate.WINDOW if cell.algorithm != NO_ALGORITHM else 0
    return trained + services


def _plan(settings: CompareSettings, cells: list[Cell], done: int) -> str:
    learn = sum(cell.algorithm != NO_ALGORITHM for cell in cells)
    rest = f"{len(cells) - done:,} to do" if done else "none of them done yet"
    return (
        f"{len(cells):,} runs, {rest}: {learn:,} of {settings.epochs:,} epochs and a test of "
        f"{settings.services:,} services, {len(cells) - learn:,} of a test alone, "
        f"{settings.workers} at a time; the bar shows how long they take once the first have served"
    )


def write_manifest(
    out: Path,
    settings: CompareSettings,
    command: str,
    made: provenance.Origin,
    found: Mapping[Cell, dict[str, Any]],
    earlier: compare_earlier.Earlier | None,
    prints: Mapping[str, str],
) -> None:
    """Write ``manifest.json``: what a comparison says of itself."""
    plain = {n: v for n, v in asdict(settings).items() if n not in ("out", "earlier")}
    cells = sorted({*found, *(earlier.results if earlier else ())}, key=place)
    seeds = sorted({cell.seed for cell in cells})
    arms = list(dict.fromkeys(cell.arm for cell in cells))
    places = list(dict.fromkeys(cell.scenario for cell in cells))
    origins = [provenance.of_run(done["folder"], done) for done in found.values()]
    files.write_json(
        out / "manifest.json",
        {
            **provenance.heading(made, command),
            "settings": {n: list(v) if isinstance(v, tuple) else v for n, v in plain.items()},
            "versions": made["versions"],
            "made_with": provenance.distinct(origins),
            "runs": len(found),
            "run_seconds": round(sum(done["seconds"] for done in found.values()), 1),
            "earlier": earlier.manifest if earlier else None,
            "scenarios": places,
            "worlds": {name: worlds.scenario(name).described() for name in places},
            "algorithms": list(dict.fromkeys(cell.algorithm for cell in cells)),
            "arms": arms,
            "fingerprints": {arm: prints[arm] for arm in arms},
            "detector": provenance.shipped_detector(),
            "seeds": seeds,
            "test_seeds": [TEST_SEED + seed for seed in seeds],
            "people": evaluate.WINDOW,
        },
    )
