"""Tables of the demonstrations and the study: what the report shows of robots, answers, detector.

They need nothing of training, so they are made beside it, in one of its processes.
"""

from __future__ import annotations

from pathlib import Path

from evenhand.core import files
from evenhand.core.processes import Task, Tell
from evenhand.experiments.paper import corrected_detector, demonstrations, tables


def task(data: Path, windows: int, seed: int) -> Task:
    """The task that writes them into ``data``, whose demonstrations have been served."""
    return Task("tables of the study", write, {"data": data, "windows": windows, "seed": seed})


def write(*, tell: Tell, data: Path, windows: int, seed: int) -> None:
    """Write every table of the study."""
    shown = demonstrations.load(windows, seed, data / "demonstrations")
    study = demonstrations.study(shown, seed)
    named, worst = tables.questionnaire(study)
    performance, calibration, confusion = tables.detector(study)
    for name, rows in (
        ("questionnaire", named),
        ("questionnaire_issue", worst),
        ("judgements", tables.judgements(shown, study)),
        ("signatures", tables.signatures(shown)),
        ("behaviour", tables.behaviour(shown)),
        ("detector", performance),
        ("calibration", calibration),
        ("confusion", confusion),
        ("tsne", tables.tsne(shown, study, seed)),
    ):
        files.write_table(data / f"{name}.csv", rows)
    compared = corrected_detector.side_by_side(shown, study, seed)
    files.write_table(data / "judges.csv", tables.judges(compared), tables.JUDGES_COLUMNS)
    tell(0, {})
