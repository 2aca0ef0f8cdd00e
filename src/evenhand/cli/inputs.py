"""What several commands read and write."""

from __future__ import annotations

import importlib
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from evenhand.core import extras, files
from evenhand.core.errors import InputError, unknown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evenhand.methods.paper.detector import Detector
    from evenhand.methods.services import Services
    from evenhand.training.settings import TrainSettings
    from evenhand.training.update import LearnerState

OPTIONAL = "(optional)"
RunFolder = Annotated[Path | None, arg(metavar="RUN", help_behavior_hint=OPTIONAL)]
Robot = Annotated[str | None, arg(metavar="NAME", help_behavior_hint=OPTIONAL)]
Strength = Annotated[float | None, arg(metavar="FLOAT", help_behavior_hint="(default: 1)")]
Plugin = Annotated[
    tuple[Path, ...],
    arg(
        metavar="FILE ...",
        help="Python files of your own that add methods, scenarios or policies.",
        help_behavior_hint=OPTIONAL,
    ),
]
Population = Annotated[str | None, arg(metavar="uniform|us|fairface", help_behavior_hint=OPTIONAL)]
ENDINGS = (".parquet", ".csv")
SCENARIOS = "even, prejudiced, perception, minority, tips, everyday, hidden, hurry, what-if-skin"


def registered(module: str, names: str) -> str:
    """Names of what can be chosen, with those that plugins have registered.

    Args:
        module: that holds the registry; imported only by plugins, since a help need not wait.
        names: that Evenhand brings.
    """
    loaded = sys.modules.get(module)
    return names if loaded is None else ", ".join(loaded.names())


def scenario_help(otherwise: str = "") -> str:
    """Help of an option that names a scenario."""
    names = registered("evenhand.restaurant.worlds", SCENARIOS)
    text = f"Where people are served: {names}.\nSeveral are joined by a plus: perception+tips."
    return f"{text} {otherwise}".rstrip()


def load_physics(extra: str = "sim") -> None:
    """Import MuJoCo with Ctrl-C held back: it starts a helper, which would end with a traceback.

    Raises:
        InputError: when the extra that the command needs, with MuJoCo in it, is not installed.
    """
    extras.require(extra, "this command")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        importlib.import_module("mujoco")
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def load_detector(path: Path | None) -> Detector:
    """A detector from a file, or the one that comes with Evenhand."""
    from evenhand.methods import detector_file

    return detector_file.load(path if path is not None else detector_file.SHIPPED)


def load_policy(folder: Path) -> tuple[TrainSettings, LearnerState]:
    """What a run learned, with the settings of its training."""
    extras.require("train", "a trained policy")
    from evenhand.training import run_folder as run
    from evenhand.training.jax_setup import set_up_jax

    set_up_jax()
    return run.load_policy(folder)


def check_server(run_folder: Path | None, robot: str | None, strength: float | None) -> None:
    """Who serves: a run's policy, or a scripted robot with its strength.

    Raises:
        InputError: when both are named, or neither, or a strength without its robot.
    """
    if (run_folder is None) == (robot is None):
        raise InputError(
            "conflict folder", "name either the folder of a run or a scripted robot with --robot"
        )
    if run_folder is not None and strength is not None:
        raise InputError(
            "conflict strength",
            "--strength belongs to a scripted robot: leave it out, or name --robot",
        )


def method(text: str, settings: Sequence[str]) -> Any:
    """A method by NAME[@STRENGTH], with settings as SETTING=VALUE.

    Raises:
        InputError: for an unknown name or setting, or a value that it cannot take.
    """
    from evenhand.methods import registry

    pairs = [word.partition("=") for word in settings]
    for name, mark, _ in pairs:
        if not mark:
            raise InputError("format set", f"--set {name} has no value: give SETTING=VALUE")
    return registry.changed(registry.create(text), {name: value for name, _, value in pairs})


def parse_tau(text: str) -> tuple[float, float, float, float]:
    """Weights of the issues from a preset's name or four numbers.

    Raises:
        InputError: for an unknown preset or numbers that are no weights.
    """
    from evenhand.methods.paper import rewards

    if text in rewards.TAU:
        return rewards.TAU[text]
    try:
        a, b, c, d = (float(part) for part in text.split(","))
    except ValueError:
        raise unknown("tau", text, [*rewards.TAU, "four numbers as 1,1,1,2"]) from None
    rewards.check_tau((a, b, c, d))
    return (a, b, c, d)


def read_services(path: Path, identities: tuple[str, ...]) -> Services:
    """Services from a Parquet or CSV file.

    Raises:
        InputError: when the file is missing, of another kind, or holds no services.
    """
    from evenhand.methods.services import Services
    from evenhand.restaurant.people import DISCRIMINATION

    check_ending(path, ENDINGS)
    if not path.is_file():
        raise InputError("missing file", f"{path} does not exist: give a file of services")
    if path.suffix == ".parquet":
        table = Services.read_parquet(path)
    else:
        table = Services.read_csv(path, identities or tuple(DISCRIMINATION))
    if not len(table):
        raise InputError(
            "empty file", f"{path} holds no services: give a file with at least one row"
        )
    return table


def check_target(path: Path, endings: tuple[str, ...] = ()) -> None:
    """Before long work: can a file be written here?

    Raises:
        InputError: when the ending is wrong or the folder cannot be written.
    """
    if endings:
        check_ending(path, endings)
    if path.is_dir():
        raise InputError("conflict file", f"{path} is a folder: give the name of a file")
    files.make_folder(path.parent)


def write_services(table: Services, path: Path) -> None:
    """Services to a Parquet or CSV file."""
    if path.suffix == ".parquet":
        table.write_parquet(path)
    else:
        table.write_csv(path)


def check_ending(path: Path, endings: tuple[str, ...]) -> None:
    """Check how the name of a file ends.

    Raises:
        InputError: when it ends in none of ``endings``.
    """
    if path.suffix not in endings:
        raise InputError(
            "unknown file", f"{path} does not end in {' or '.join(endings)}: give such a file"
        )
