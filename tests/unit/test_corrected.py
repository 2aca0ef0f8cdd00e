"""The detector on scores without chance: what it sees, its folds, and whom it is set beside."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.stats import hypergeom
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from evenhand.experiments.paper import corrected_detector
from evenhand.experiments.paper.demonstrations import Demos, Study
from evenhand.methods.services import Services
from evenhand.methods.vocabulary import IDENTITIES
from evenhand.restaurant.people import IDENTITIES as PEOPLE
from evenhand.statistics.detector_accuracy import wilson
from evenhand.study.simulated.respondents import Judgements

WINDOWS, SEED = 60, 4
SHOWN = np.arange(WINDOWS) % 4
EVEN = np.arange(WINDOWS) % 3 == 0


def made_demos() -> Demos:
    """Even windows, and windows in which the first category of the shown identity is ignored."""
    rng = np.random.default_rng(8)
    codes = np.column_stack([rng.integers(len(one.groups), size=30 * WINDOWS) for one in PEOPLE])
    about = [[one.name for one in PEOPLE].index(name) for name in IDENTITIES]
    column = np.repeat(np.array(about)[SHOWN], 30)
    uneven = ~np.repeat(EVEN, 30) & (codes[np.arange(len(codes)), column] == 0)
    responded = rng.random(len(codes)) > np.where(uneven, 0.8, 0.2)
    near = rng.random(len(codes)) < 0.3
    table = Services.build(
        {one.name: (codes[:, i], one.groups) for i, one in enumerate(PEOPLE)},
        {
            "responded": responded,
            "response_step": np.ma.array(rng.integers(100, 300, len(codes)), mask=~responded),
            "response_distance": np.ma.array(rng.uniform(0.8, 1.8, len(codes)), mask=~responded),
            "min_distance": np.where(near, 0.4, 0.8),
        },
    )
    return Demos(table, np.where(EVEN, 0, 1), (~EVEN).astype(float))


DEMOS = made_demos()


def excess_by_loops(window: int, identity: str) -> list[float]:
    """|d| less its mean over the hypergeometric distribution, averaged over the groups."""
    codes, categories = DEMOS.table.identity(identity)
    rows = slice(30 * window, 30 * window + 30)
    responded = DEMOS.table.fact("responded")[rows] == 1.0
    distance = DEMOS.table.fact("response_distance")[rows]
    late = DEMOS.table.fact("response_step")[rows] > 200
    risk = DEMOS.table.fact("min_distance")[rows] < 0.5
    everybody = np.ones(30, bool)
    found = []
    for happened, among in (
        (~responded, everybody),
        ((distance < 1.0) | (distance > 1.5), responded),
        (late, responded),
        (risk, everybody),
    ):
        gaps = []
        for category in range(len(categories)):
            inside = (codes[rows] == category) & among
            n, total, cases = inside.sum(), among.sum(), (happened & among).sum()
            if n in (0, total):
                continue
            k = np.arange(n + 1)
            size = np.abs(k / n - (cases - k) / (total - n))
            even = (hypergeom.pmf(k, total, cases, n) * size).sum()
            gaps.append(size[(happened & inside).sum()] - even)
        found.append(np.mean(gaps))
    return found


def made_study() -> Study:
    """Respondents who mostly name the uneven windows, and any probabilities of a raw detector."""
    rng = np.random.default_rng(9)
    biased = np.where(rng.random(WINDOWS) < 0.15, EVEN, ~EVEN)
    said = Judgements(biased, np.where(biased, SHOWN, -1), np.where(biased, 0, -1))
    evaluation = SimpleNamespace(
        probability=rng.random(WINDOWS), brier=0.25, calibration=(), fold=np.zeros(WINDOWS)
    )
    study = SimpleNamespace(
        shown=SHOWN,
        who=np.arange(WINDOWS) % 10,
        said=said,
        seen=rng.uniform(0, 0.25, (WINDOWS, 4)),
        detector=SimpleNamespace(threshold=0.5),
        evaluation=evaluation,
    )
    return cast(Study, study)


def test_the_gap_of_an_even_robot_is_taken_out():
    seen = corrected_detector.seen_without_chance(DEMOS, made_study())
    assert seen.shape == (WINDOWS, 4)
    for window in range(0, WINDOWS, 7):
        expected = excess_by_loops(window, IDENTITIES[SHOWN[window]])
        np.testing.assert_allclose(seen[window], expected, atol=1e-12)


def test_nobody_who_judged_is_in_training_and_test():
    study = made_study()
    record = corrected_detector.side_by_side(DEMOS, study, SEED)[1]
    scores = corrected_detector.seen_without_chance(DEMOS, study)
    pipeline = make_pipeline(StandardScaler(), PCA(3), LogisticRegression(max_iter=1000))
    predicted = cross_val_predict(
        pipeline,
        scores,
        study.said.biased,
        groups=study.who,
        cv=StratifiedGroupKFold(5, shuffle=True, random_state=SEED),
        method="predict_proba",
    )
    probability = np.asarray(predicted)[:, 1]
    hits = (probability > 0.5) == study.said.biased
    assert record.judge == "corrected"
    assert record.accuracy == wilson(int(hits.sum()), WINDOWS)
    manual = study.seen.sum(axis=1) > 0.5  # of the raw scores, for both detectors
    assert record.agreement == wilson(int(((probability > 0.5) == manual).sum()), WINDOWS)
    assert record.false_alarms == wilson(int((probability > 0.5)[EVEN].sum()), int(EVEN.sum()))
    assert record.brier == pytest.approx(np.mean((probability - study.said.biased) ** 2))
    assert sum(part.observed.n for part in record.calibration) == WINDOWS


def test_the_others_are_counted_by_hand():
    study = made_study()
    raw, _, threshold, people = corrected_detector.side_by_side(DEMOS, study, SEED)
    assert [raw.judge, threshold.judge, people.judge] == ["raw", "threshold", "respondents"]
    said, manual, flagged = (
        [bool(x) for x in column]
        for column in (
            study.said.biased,
            study.seen.sum(axis=1) > 0.5,
            study.evaluation.probability > 0.5,
        )
    )

    def alike(one: list[bool], other: list[bool]) -> int:
        return sum(a == b for a, b in zip(one, other, strict=True))

    def on_even(one: list[bool]) -> int:
        return sum(x for x, even in zip(one, EVEN, strict=True) if even)

    assert raw.accuracy == wilson(alike(flagged, said), WINDOWS)
    assert raw.agreement == wilson(alike(flagged, manual), WINDOWS)
    assert raw.brier == 0.25  # as it was: nothing of the raw detector is computed again
    assert threshold.accuracy == people.agreement == wilson(alike(said, manual), WINDOWS)
    assert (threshold.agreement, people.accuracy) == (None, None)
    for record, verdicts in ((raw, flagged), (threshold, manual), (people, said)):
        assert record.false_alarms == wilson(on_even(verdicts), 20)


def test_a_window_that_the_raw_detector_leaves_out_is_left_out():
    study = made_study()
    study.seen[[0, 1]] = np.nan
    study.evaluation.probability = study.evaluation.probability[2:]  # type: ignore[misc]
    records = corrected_detector.side_by_side(DEMOS, study, SEED)
    # of the first two windows one is even
    assert [record.false_alarms.n for record in records] == [19] * 4
    assert records[1].accuracy is not None
    assert records[1].accuracy.n == WINDOWS - 2
