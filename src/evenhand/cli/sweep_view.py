"""All runs of a sweep in one view: how many have ended, and how far those at work are."""

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.table import Column
from rich.text import Text

from evenhand.core.processes import RETRIES, Event
from evenhand.experiments.sweep.settings import Job

_SHOWN = 20
"""Bars of runs at most; a cluster may have more at work than a terminal has lines."""


class _Left(ProgressColumn):
    def render(self, task: Task) -> Text:
        if task.finished:
            return Text(f"{timedelta(seconds=round(task.finished_time or 0.0))} in all", "dim")
        pace = task.completed / task.elapsed if task.elapsed else 0.0
        if not pace or not task.fields.get("whole"):
            return Text("")
        return Text(f"{timedelta(seconds=round((task.remaining or 0.0) / pace))} left", "dim")


class View:
    """Tells of runs: bars in a terminal; elsewhere only what went wrong, line by line."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def __call__(self, jobs: Sequence[Job], done: int) -> Callable[[Event], None]:
        """Begin.

        Returns:
            Where to tell what happens to them.
        """
        bars: dict[int, object] = {}
        counts = {"ended": 0, "failed": 0}
        whole = self._progress.add_task("", total=sum(job.units for job in jobs), whole=True)
        told = dict.fromkeys(range(len(jobs)), 0)

        def headline() -> str:
            ended, failed = done + counts["ended"], counts["failed"]
            text = f"{ended:,} of {done + len(jobs):,} runs"
            return text + (f", {failed:,} failed" if failed else "")

        def tell(event: Event) -> None:
            index = event.index
            name = str(jobs[index])
            if event.kind == "began" and len(bars) < _SHOWN:
                text = name + (f" on {event.place}" if event.place else "")
                bars[index] = self._progress.add_task(escape(text), total=jobs[index].units)
                self._count(bars[index], told[index])
            elif event.kind == "progress":
                # an attempt that goes on tells again of what was told before
                told[index] += event.units
                self._progress.update(whole, advance=event.units)  # type: ignore[arg-type]
                self._count(bars.get(index), told[index])
            elif event.kind == "lost":
                self._gone(bars, index)
                self._progress.update(whole, advance=-told[index])
                told[index] = 0
                self._say(f"{name}: {event.reason}; tried again, {RETRIES} times at most")
            elif event.kind in counts:
                self._gone(bars, index)
                counts[event.kind] += 1
                missing = jobs[index].units - told[index]
                self._progress.update(whole, advance=missing)
                if event.kind == "failed":
                    reason = event.reason.strip().rpartition("\n")[2]
                    self._say(f"{name} failed: {reason}")
            self._progress.update(whole, description=headline())

        self._progress.update(whole, description=headline())
        return tell

    def _count(self, bar: object, units: int) -> None:
        if bar is not None:
            self._progress.update(bar, completed=units)  # type: ignore[arg-type]

    def _gone(self, bars: dict[int, object], index: int) -> None:
        bar = bars.pop(index, None)
        if bar is not None:
            self._progress.remove_task(bar)  # type: ignore[arg-type]

    def _say(self, sentence: str) -> None:
        if self._progress.disable:
            print("evenhand:", sentence, file=sys.stderr, flush=True)
        else:
            self._progress.console.print(Text(sentence), soft_wrap=True)


@contextlib.contextmanager
def view() -> Iterator[View]:
    """Show runs on standard error while inside."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis")),
        BarColumn(bar_width=12),
        TextColumn("{task.percentage:>3.0f} %"),
        _Left(),
        console=console,
        disable=not console.is_terminal,
    ) as progress:
        yield View(progress)
