"""All figures of the report of the paper's experiment, in the order of the page."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from evenhand.experiments.paper.report import (
    figures_biased,
    figures_detector,
    figures_learning,
    figures_scores,
    figures_study,
)
from evenhand.report import reflection_figure
from evenhand.report.figure import Drawn, Plate, draw
from evenhand.report.read_tables import Results

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
        reflection_figure.reflection_data,
        reflection_figure.reflection_draw,
        reflection_figure.reflection_caption,
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
