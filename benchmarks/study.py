"""How long the analysis of a large study takes: from a file of answers to the report."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import pyarrow as pa

from evenhand.core import errors
from evenhand.core import terminal as display
from evenhand.study.analysis import analyse, answers, page
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.design import protocol_file
from evenhand.study.design.protocol import Protocol
from evenhand.study.simulated import participants as simulate

_MADE = 500  # participants that are simulated indeed; the others answer as one of them did


@dataclass(frozen=True)
class Spent:
    """Processor seconds of one analysis.

    Attributes:
        participants: how many answered.
        rows: of the file.
        read: seconds to read and check the file.
        analysed: seconds to analyse.
        written: seconds to draw and write.
    """

    participants: int
    rows: int
    read: float
    analysed: float
    written: float

    @property
    def whole(self) -> float:
        """All of it."""
        return self.read + self.analysed + self.written


def measure(
    participants: int = 10_000, ending: str = ".csv", study: Protocol | None = None
) -> dict[str, Any]:
    """Time the analysis of so many simulated participants, in processor seconds.

    Args:
        participants: how many.
        ending: of the file of answers.
        study: what they take; the paper's study by default.

    Returns:
        ``study_participants``, ``study_rows``, ``study_cpu_seconds`` and its parts
        ``study_read_seconds``, ``study_analyse_seconds`` and ``study_report_seconds``.

    Raises:
        InputError: for fewer than one participant or more than a million.
    """
    errors.whole("participants", participants, 1, 1_000_000)
    study = study or protocol_file.examine(protocol_file.PAPER, look=False)[0]
    assert study is not None
    with tempfile.TemporaryDirectory(prefix="evenhand-") as folder:
        path = Path(folder, f"answers{ending}")
        answers.write(crowd(study, participants), path)
        spent = _timed(study, path, Path(folder, "report"))
    return {
        "study_participants": spent.participants,
        "study_rows": spent.rows,
        "study_cpu_seconds": round(spent.whole, 2),
        "study_read_seconds": round(spent.read, 2),
        "study_analyse_seconds": round(spent.analysed, 2),
        "study_report_seconds": round(spent.written, 2),
    }


def crowd(study: Protocol, participants: int) -> Answers:
    """Answers of many simulated participants, each as one of a few hundred answered."""
    made = simulate.answers(study, min(participants, _MADE), 0)
    table = made.table
    copies = -(-participants // len(made.participants))
    parts = []
    for copy in range(copies):
        wanted = made.participants[: participants - copy * len(made.participants)]
        named = pa.array([f"{name}{copy:04d}" for name in wanted])
        part = table
        if len(wanted) < len(made.participants):
            part = made.where(pc.is_in(table["participant"], pa.array(wanted))).table
        index = pc.index_in(part["participant"], pa.array(wanted))
        parts.append(part.set_column(0, "participant", named.take(index.combine_chunks())))
    return Answers(pa.concat_tables(parts))


def _timed(study: Protocol, path: Path, folder: Path) -> Spent:
    def clock() -> Iterator[float]:
        last = process_time()
        while True:
            now = process_time()
            yield now - last
            last = now

    ticks = clock()
    next(ticks)
    found = answers.read(path)
    read = next(ticks)
    made = analyse.analyse(found, study)
    analysed = next(ticks)
    page.write(made, found, page.Source(path.name, "bench", ""), folder)
    return Spent(len(found.participants), len(found), read, analysed, next(ticks))


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    display.table(
        f"Analysis of {found['study_participants']:,} simulated participants, processor seconds",
        ("answers", "to read", "to analyse", "to draw and write", "together"),
        [
            (
                found["study_rows"],
                found["study_read_seconds"],
                found["study_analyse_seconds"],
                found["study_report_seconds"],
                found["study_cpu_seconds"],
            )
        ],
    )
