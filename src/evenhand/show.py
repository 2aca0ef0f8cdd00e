"""What a terminal shows: progress bars, tables. Nothing but results when it is no terminal."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from evenhand.experiments.pool import Tell


class _Speed(ProgressColumn):
    """Services and physics steps a second."""

    def render(self, task: Task) -> Text:
        seconds = task.elapsed or 0.0
        if not seconds or not task.fields.get("steps"):
            return Text("")
        services, steps = task.completed / seconds, task.fields["steps"] / seconds
        return Text(f"{services:,.0f} services/s  {steps:,.0f} steps/s", style="dim")


class Stages:
    """Progress of an experiment, a bar for each stage."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def __call__(self, name: str, units: int) -> Tell:
        """Begin a stage of so many units; returns where to tell progress."""
        task = self._progress.add_task(name, total=units, steps=0)
        steps = 0

        def tell(done: int, numbers: Mapping[str, Any]) -> None:
            nonlocal steps
            steps += int(numbers.get("physics_steps", 0))
            self._progress.update(task, advance=done, steps=steps)

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
        TextColumn("left"),
        TimeRemainingColumn(),
        _Speed(),
        console=console,
        disable=not console.is_terminal,
    ) as progress:
        yield Stages(progress)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table; numbers are set to the right."""
    shown = Table(title=title, title_justify="left", title_style="bold")
    for index, name in enumerate(columns):
        numeric = bool(rows) and isinstance(rows[0][index], (int, float))
        shown.add_column(name, justify="right" if numeric else "left")
    for row in rows:
        shown.add_row(*[_text(cell) for cell in row])
    Console(soft_wrap=True).print(shown)


def _text(cell: Any) -> str:
    if cell is None:
        return "not defined"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.3f}" if isinstance(cell, float) else str(cell)
