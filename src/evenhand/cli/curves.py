"""``evenhand curves``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from evenhand.core.errors import InputError


@dataclass(frozen=True)
class Curves:
    """Write the epochs of runs as events of TensorBoard, or as offline runs of Weights & Biases.

    Of one run, or of all runs below a folder of `evenhand reproduce`, `compare` or `sweep`. What
    is written lies in each run's folder and replaces what was written there before. Nothing is
    sent; `wandb sync` sends it, if you like.

    For instance: evenhand curves out/reproduce --to tensorboard, then:
    tensorboard --logdir out/reproduce/runs
    """

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of a run, or one with runs below it."""

    to: Annotated[
        tuple[Literal["tensorboard", "wandb"], ...], arg(metavar="tensorboard|wandb ...")
    ] = ("tensorboard",)
    """Where to.
    tensorboard: events in tensorboard/ of each run.
    wandb: an offline run in wandb/ of each run."""

    def run(self, command: str) -> int:
        """Find the runs, write, print."""
        if not self.to:
            raise InputError("empty to", "--to names no sink: give tensorboard, wandb or both")
        from evenhand.core import terminal
        from evenhand.training import loggers

        loggers.check(self.to)
        found = sorted(path.parent for path in self.folder.rglob("epochs.jsonl"))
        if not found:
            raise InputError(
                "missing folder",
                f"{self.folder} holds no run: there is no epochs.jsonl in it or below it",
            )
        with terminal.stages() as stage:
            tell = stage("curves", len(found))
            for run_folder in found:
                loggers.write(self.to, run_folder)
                tell(1, {})
        print(f"{len(found)} {'run' if len(found) == 1 else 'runs'} in {self.folder}")
        return 0
