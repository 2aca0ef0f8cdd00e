"""The detector on scores without chance, beside the one on raw scores.

The same windows, judgements and folds; only what the detector sees differs. Of every gap the one
expected of an even robot is taken out (``inference.chance``). The simulated respondents judge raw
scores, so the raw detector has the easier task: what the corrected one gains must show in the
windows of even robots, where whatever is called biased is chance.
"""

from dataclasses import dataclass

import numpy as np

from evenhand.experiments.paper.demonstrations import KINDS, Demos, Study
from evenhand.methods.paper.detector import complete
from evenhand.methods.vocabulary import IDENTITIES, MANUAL_THRESHOLD, SIMULATED
from evenhand.statistics import detector_accuracy
from evenhand.statistics.chance import excess_scores
from evenhand.statistics.detector_accuracy import CalibrationBin, Share, wilson
from evenhand.training.evaluate import window_counts

JUDGES = ("raw", "corrected", "threshold", "respondents")
"""Detector on raw and on corrected scores, manual threshold on the raw total, respondents."""


@dataclass(frozen=True)
class Record:
    """How one judge did on windows that it was not fitted to.

    Attributes:
        judge: one of ``JUDGES``.
        accuracy: share judged as the respondents did; None for themselves.
        agreement: share judged as the manual threshold does; None for itself.
        false_alarms: share of the even robot's windows that were called biased.
        brier: mean squared difference of probability and answer; None without probabilities.
        calibration: bins of predicted probability; none without probabilities.
    """

    judge: str
    accuracy: Share | None
    agreement: Share | None
    false_alarms: Share
    brier: float | None = None
    calibration: tuple[CalibrationBin, ...] = ()


def seen_without_chance(demos: Demos, study: Study) -> np.ndarray:
    """Corrected I of the identity that each window was shown about, [W, 4].

    NaN exactly where the raw score is; below 0 where groups differ less than chance makes them.
    """
    by_identity = excess_scores(*window_counts(demos.table)).by_identity
    every = np.stack([by_identity[name] for name in IDENTITIES], axis=1)
    return every[np.arange(len(study.shown)), study.shown]


def side_by_side(demos: Demos, study: Study, seed: int) -> list[Record]:
    """Every judge of ``JUDGES`` on the judged windows."""
    whole = complete(study.seen)
    kinds = [kind for kind, kept in zip(study.said.kinds, whole, strict=True) if kept]
    answers = study.said.biased[whole]
    evaluation = detector_accuracy.evaluate(
        seen_without_chance(demos, study)[whole],
        answers,
        kinds,
        source=SIMULATED,
        seed=seed,
        groups=study.who[whole],
    )
    found = {"raw": study.evaluation, "corrected": evaluation}
    manual = study.seen[whole].sum(axis=1) > MANUAL_THRESHOLD
    said = {
        **{name: one.probability > study.detector.threshold for name, one in found.items()},
        "threshold": manual,
        "respondents": answers,
    }
    even = demos.robot[whole] == KINDS.index("even")
    return [
        Record(
            name,
            None if name == "respondents" else _share(said[name] == answers),
            None if name == "threshold" else _share(said[name] == manual),
            _share(said[name][even]),
            found[name].brier if name in found else None,
            found[name].calibration if name in found else (),
        )
        for name in JUDGES
    ]


def _share(hits: np.ndarray) -> Share:
    return wilson(int(hits.sum()), len(hits))
