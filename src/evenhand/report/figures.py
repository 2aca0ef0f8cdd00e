"""Room: all figures of a report. Takes: results. Gives: SVG, PDF, CSV and words of each figure.

May touch: matplotlib. The order here is the order of the page.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from matplotlib.figure import Figure

from evenhand import files
from evenhand.report import (
    figures_biased,
    figures_detector,
    figures_learning,
    figures_reflection,
    figures_scores,
    figures_study,
    style,
)
from evenhand.report.inputs import Results
from evenhand.report.tables import Table, csv_text


@dataclass(frozen=True)
class Plate:
    """One figure: what is drawn, how, and its words.

    Attributes:
        name: of the files, and the anchor in the page.
        title: heading.
        paper: the figure of the paper that it corresponds to, or nothing.
        section: where it stands in the page.
        alt: what a reader who does not see it is told.
        data: the table drawn, from the results.
        draw: the figure, from that table alone; the flag asks for the wide layout.
        caption: the words under it: n, seeds, intervals.
        half: whether it needs only half the width of a laptop page.
    """

    name: str
    title: str
    paper: str
    section: Literal["learning", "detector", "study", "robots"]
    alt: str
    data: Callable[[Results], Table]
    draw: Callable[[Table, bool], Figure]
    caption: Callable[[Results, Table], str]
    half: bool = False


PLATES = (
    Plate(
        "total_score",
        "Total issue score while learning",
        "Fig. 7",
        "learning",
        "Line chart, one panel a preset, one line an arm: total issue score against epoch.",
        figures_learning.score_data,
        figures_learning.score_draw,
        figures_learning.score_caption,
    ),
    Plate(
        "service_quality",
        "Quality of service while learning",
        "",
        "learning",
        "Line chart, one panel a preset, one line an arm: share of perfect services against epoch.",
        figures_learning.quality_data,
        figures_learning.quality_draw,
        figures_learning.quality_caption,
    ),
    Plate(
        "test_scores",
        "Scores in the test, beside the quality of service",
        "Fig. 8",
        "learning",
        "Dot chart by preset and arm: total and chance floor, four issues, perfect services.",
        figures_scores.scores_data,
        figures_scores.scores_draw,
        figures_scores.scores_caption,
    ),
    Plate(
        "biased_epochs",
        "Epochs judged as biased",
        "Fig. 9",
        "learning",
        "Dot chart by preset and arm: epochs judged as biased by the detector and by a threshold.",
        figures_biased.biased_data,
        figures_biased.biased_draw,
        figures_biased.biased_caption,
    ),
    Plate(
        "zoom",
        "Detection and correction, close up",
        "Fig. 10",
        "learning",
        "Line charts of the total score in some epochs; epochs detected as biased are shaded.",
        figures_biased.zoom_data,
        figures_biased.zoom_draw,
        figures_biased.zoom_caption,
    ),
    Plate(
        "reflection",
        "Self-reflection: updates along the bias gradient",
        "",
        "learning",
        "Dot charts by arm: change of the score and rarity of each update; abnormal ones marked.",
        figures_reflection.reflection_data,
        figures_reflection.reflection_draw,
        figures_reflection.reflection_caption,
    ),
    Plate(
        "signatures",
        "Signature of each discrimination",
        "Fig. 6",
        "detector",
        "Dot chart, one panel a discrimination: four issue scores beside the printed ones.",
        figures_study.signatures_data,
        figures_study.signatures_draw,
        figures_study.signatures_caption,
    ),
    Plate(
        "calibration",
        "Calibration of the detector",
        "",
        "detector",
        "Dots near a diagonal: share judged as biased against the probability given.",
        figures_detector.calibration_data,
        figures_detector.calibration_draw,
        figures_detector.calibration_caption,
        half=True,
    ),
    Plate(
        "confusion",
        "Which discrimination it looks like",
        "",
        "detector",
        "Matrix of counts: judged by respondents in rows, said by the detector in columns.",
        figures_detector.confusion_data,
        figures_detector.confusion_draw,
        figures_detector.confusion_caption,
        half=True,
    ),
    Plate(
        "judges",
        "The detector on raw scores and on scores without chance",
        "",
        "detector",
        "Dot charts by judge: accuracy, agreement with the threshold, false alarms, calibration.",
        figures_detector.judges_data,
        figures_detector.judges_draw,
        figures_detector.judges_caption,
    ),
    Plate(
        "tsne",
        "Judged windows on three planes",
        "Fig. 12",
        "detector",
        "Scatter charts of an embedding of judged windows, marked by discrimination.",
        figures_detector.tsne_data,
        figures_detector.tsne_draw,
        figures_detector.tsne_caption,
    ),
    Plate(
        "questionnaire",
        "Answers to the questionnaire",
        "Fig. 5",
        "study",
        "Bar charts, one column a scenario: identities named, and the worst issue.",
        figures_study.questionnaire_data,
        figures_study.questionnaire_draw,
        figures_study.questionnaire_caption,
    ),
    Plate(
        "behaviour",
        "Behaviour of the biased robots",
        "Fig. 11",
        "robots",
        "Dot chart by robot: mean response distance, mean response time, ignore rate.",
        figures_study.behaviour_data,
        figures_study.behaviour_draw,
        figures_study.behaviour_caption,
    ),
)


@dataclass(frozen=True)
class Drawn:
    """A figure that was drawn.

    Attributes:
        plate: which one.
        data: the table drawn.
        caption: the words under it.
        svg: the wide layout as a file.
        narrow_svg: the layout for a phone; None where one layout serves both.
        pdf: the wide layout as a file.
        csv: the table drawn as a file.
    """

    plate: Plate
    data: Table
    caption: str
    svg: str
    narrow_svg: str | None
    pdf: bytes
    csv: str


def draw(plate: Plate, results: Results) -> Drawn:
    """Draw one figure in both layouts; the same results give the same bytes."""
    data = plate.data(results)
    with style.drawing():
        wide = plate.draw(data, True)
        svg, pdf = style.svg_text(wide, plate.name), style.pdf_bytes(wide)
        narrow = None
        if not plate.half:
            narrow = style.svg_text(plate.draw(data, False), f"{plate.name}-narrow")
    return Drawn(plate, data, plate.caption(results, data), svg, narrow, pdf, csv_text(data))


def draw_all(results: Results, workers: int = 1) -> list[Drawn]:
    """Every figure that the results have data for, in the order of the page.

    Args:
        results: of an experiment.
        workers: processes that draw; with 1 everything is drawn in this one.
    """
    chosen = [plate for plate in PLATES if len(plate.data(results))]
    if workers == 1:
        return [draw(plate, results) for plate in chosen]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(chosen)), context) as pool:
        return list(pool.map(draw, chosen, [results] * len(chosen)))


def write(folder: Path, drawn: Sequence[Drawn]) -> list[Path]:
    """Write figures as SVG (wide and for a phone), PDF and CSV.

    Args:
        folder: exists.
        drawn: the figures.

    Returns:
        The files.

    Raises:
        InputError: when the folder cannot be written.
    """
    written = []
    for figure in drawn:
        base = folder / figure.plate.name
        contents = {
            base.with_suffix(".svg"): figure.svg.encode(),
            base.with_suffix(".pdf"): figure.pdf,
            base.with_suffix(".csv"): figure.csv.encode(),
        }
        if figure.narrow_svg is not None:
            contents[base.with_name(f"{base.name}-narrow.svg")] = figure.narrow_svg.encode()
        for path, content in contents.items():
            files.write_bytes(path, content)
        written += list(contents)
    return written
