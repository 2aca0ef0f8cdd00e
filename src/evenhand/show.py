"""What a terminal shows: progress bars, tables. Nothing but results when it is no terminal."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table
from rich.text import Text

from evenhand.experiments.pool import Tell

_WIDE = 200
"""Columns of a table where no terminal sets the limit."""


class _Pace(ProgressColumn):
    """Services and physics steps a second, and the time left, of what this process serves.

    What an earlier process had finished is part of the bar, but not of the pace.
    """

    def render(self, task: Task) -> Text:
        seconds, served = task.elapsed or 0.0, task.fields["served"]
        if not seconds or not served:
            return Text("")
        pace = served / seconds
        shown = f"{pace:,.0f} services/s  {task.fields['steps'] / seconds:,.0f} steps/s"
        if task.remaining:
            shown += f"  {timedelta(seconds=round(task.remaining / pace))} left"
        return Text(shown, style="dim")


class Stages:
    """Progress of an experiment, a bar for each stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def __call__(self, name: str, units: int) -> Tell:
        """Begin a stage of so many units; returns where to tell progress."""
        task = self._progress.add_task(name, total=units, steps=0, served=0)
        steps = served = 0

        def tell(done: int, numbers: Mapping[str, Any]) -> None:
            nonlocal steps, served
            new = int(numbers.get("physics_steps", 0))
            steps += new
            served += done if new else 0
            self._progress.update(task, advance=done, steps=steps, served=served)

        return tell


@contextlib.contextmanager
def stages() -> Iterator[Stages]:
    """Show progress on standard error while inside; quiet when that is no terminal."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        _Pace(),
        console=console,
        disable=not console.is_terminal,
    ) as progress:
        yield Stages(progress)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table, numbers to the right; in a file or a pipe it is as wide as it needs."""
    shown = Table()
    for index, name in enumerate(columns):
        numeric = bool(rows) and isinstance(rows[0][index], (int, float))
        shown.add_column(name, justify="right" if numeric else "left", overflow="fold")
    for row in rows:
        shown.add_row(*[_text(cell) for cell in row])
    console = Console(highlight=False, width=None if sys.stdout.isatty() else _WIDE)
    console.print(Text(title, style="bold"), soft_wrap=True)
    console.print(shown)


def _text(cell: Any) -> str:
    if cell is None:
        return "missing"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.3f}" if isinstance(cell, float) else str(cell)
