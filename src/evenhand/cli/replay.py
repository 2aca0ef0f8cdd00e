"""``evenhand replay``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL, Plugin
from evenhand.core.errors import InputError

if TYPE_CHECKING:
    from evenhand.methods.services import Services


@dataclass(frozen=True)
class Replay:
    """Write services of a run as one page on which they can be watched beside their numbers.

    The page is one HTML file that needs no network: it plays in any browser, on a phone too. Each
    service can be played and sought, from four cameras, beside its distance, zone and issues.

    For instance: evenhand replay out/run --out replay.html
    """

    run_folder: Annotated[Positional[Path], arg(metavar="RUN")]
    """Folder of a run of `evenhand train` that keeps states."""

    out: Annotated[Path, arg(metavar="FILE")]
    """The page to write, *.html; one that is there is replaced."""

    services: Annotated[
        str | None, arg(metavar="N,N,...", help_behavior_hint="(default: 30 of the latest)")
    ] = None
    """Numbers of the services, at most 300.
    By default 30 of the latest: five with each issue, as far as there are such, and others."""

    epoch: Annotated[int | None, arg(metavar="N", help_behavior_hint=OPTIONAL)] = None
    """Instead, the first 30 services of this epoch: these are a sample."""

    title: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="(the run)")] = None
    """Title of the page."""

    plugin: Plugin = ()

    def run(self, command: str) -> int:
        """Read, choose, write."""
        if self.services is not None and self.epoch is not None:
            raise InputError(
                "conflict services",
                "--services and --epoch both say which services: give one of them",
            )
        wanted = None if self.services is None else _numbers(self.services)
        inputs.check_target(self.out, (".html", ".htm"))
        inputs.load_physics("train")
        from evenhand.restaurant import replay
        from evenhand.restaurant.replay.page import read_script
        from evenhand.training import recordings
        from evenhand.training import run_folder as run

        read_script()
        if wanted is not None and len(wanted) > replay.MOST:
            raise InputError(
                "range services",
                f"--services names {len(wanted)} services: a page holds at most {replay.MOST}",
            )
        recording = recordings.read(self.run_folder)
        table = run.read_services(self.run_folder)
        named = run.world_of(self.run_folder).issues
        if wanted is None:
            wanted = replay.choose(table, self.epoch, named)
        some = recording[[recording.row(number) for number in wanted]]
        title = self.title if self.title is not None else f"Services of {self.run_folder.name}"
        note = self._note(table)
        replay.write(some, table, self.out, title=title, note=note, named=named)
        print(self.out)
        return 0

    def _note(self, table: Services) -> str:
        whole = f"The run has {len(table):,} services."
        if self.services is not None:
            return f"{whole} These were chosen by hand."
        if self.epoch is not None:
            return f"{whole} These are of epoch {self.epoch}."
        return (
            f"{whole} These are of the latest, chosen so that every issue there is can be seen: "
            "they are no sample."
        )


def _numbers(text: str) -> list[int]:
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            "format services",
            f"--services is {text!r}: give numbers of services with commas between, as 3,17",
        ) from None
    twice = [number for number in numbers if numbers.count(number) > 1]
    if twice:
        raise InputError(
            "duplicate services",
            f"--services names service {twice[0]} more than once: name it once",
        )
    return numbers
