"""What a terminal shows: progress bars, tables. Nothing but results when it is no terminal."""

import contextlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.measure import Measurement
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
)
from rich.table import Column, Table
from rich.text import Text

from evenhand.core.processes import Stage, Tell

_WIDE = 200
"""Columns of a table where no terminal sets the limit."""
_ANY_WIDTH = 10_000
"""More than any table has."""


class _Pace(ProgressColumn):
    """Time left, and physics steps and services a second, of what this process serves.

    What an earlier process had finished is part of the bar, but not of the pace.
    """

    def __init__(self) -> None:
        super().__init__(Column(no_wrap=True, overflow="ellipsis"))

    def render(self, task: Task) -> Text:
        seconds = task.finished_time if task.finished else task.elapsed
        served = task.fields["served"]
        time = f"{timedelta(seconds=round(seconds or 0.0))} in all" if task.finished else ""
        if not seconds or not served:
            return Text(time, style="dim")
        steps, services = task.fields["steps"] / seconds, served / seconds
        time = time or f"{timedelta(seconds=round((task.remaining or 0.0) / services))} left"
        return Text(f"{time}  {steps:,.0f} steps/s  {services:,.0f} services/s", style="dim")


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
        BarColumn(bar_width=12),
        TextColumn("{task.percentage:>3.0f} %"),
        _Pace(),
        console=console,
        disable=not console.is_terminal,
    ) as progress:
        yield Stages(progress)


@contextlib.contextmanager
def silent() -> Iterator[Stage]:
    """Show no progress while inside."""
    yield lambda name, units: lambda done, numbers: None


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table, numbers to the right; in a file or a pipe it is as wide as it needs.

    Where a terminal is too narrow for it, every row is a paragraph: what it is of, then the rest.
    """
    shown = Table()
    for index, name in enumerate(columns):
        numeric = bool(rows) and isinstance(rows[0][index], (int, float))
        shown.add_column(name, justify="right" if numeric else "left", overflow="fold")
    cells = [[_text(cell) for cell in row] for row in rows]
    for row in cells:
        shown.add_row(*row)
    console = Console(highlight=False, width=None if sys.stdout.isatty() else _WIDE)
    console.print(Text(title, style="bold"), soft_wrap=True)
    if not sys.stdout.isatty() or _fits(console, shown):
        console.print(shown)
        return
    named = _naming(rows)
    for row in cells:
        console.print(Text.from_markup(" · ".join(row[:named]), style="underline"))
        rest = zip(columns[named:], row[named:], strict=True)
        told = "; ".join(f"{name} {cell}" for name, cell in rest if cell)
        for line in Text.from_markup(told).wrap(console, max(console.width - 2, 1)):
            line.rstrip()
            console.print(Text("  ").append_text(line))


def _fits(console: Console, shown: Table) -> bool:
    free = console.options.update_width(_ANY_WIDTH)
    return Measurement.get(console, free, shown).maximum <= console.width


def _naming(rows: Sequence[Sequence[Any]]) -> int:
    """How many columns say what a row is of: those before the first number, or one."""
    first = rows[0] if rows else ()
    places = (i for i, cell in enumerate(first) if isinstance(cell, (int, float)))
    return max(1, next(places, 1))


def _text(cell: Any) -> str:
    if cell is None:
        return "missing"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:z.3f}" if isinstance(cell, float) else str(cell)
