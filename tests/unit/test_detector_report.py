"""The evaluation against scikit-learn's cross-validation and statsmodels' Wilson interval."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.calibration import calibration_curve
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import brier_score_loss, confusion_matrix
from sklearn.model_selection import StratifiedKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from statsmodels.stats.proportion import proportion_confint

from evenhand.statistics.detector_accuracy import evaluate, wilson
from support.refusals import refused

SOURCE = "simulated respondents"


def judged(n: int = 250):
    """Windows of two kinds, told apart by their first two scores, with noisy answers."""
    rng = np.random.default_rng(11)
    scores = rng.uniform(0, 0.3, (n, 4))
    biased = scores.sum(axis=1) + rng.normal(0, 0.08, n) > 0.6
    kinds = ["ageism" if s[0] + rng.normal(0, 0.05) > s[1] else "racism" for s in scores]
    return scores, biased, [k if b else None for k, b in zip(kinds, biased, strict=True)]


def test_out_of_fold_numbers_are_those_of_scikit_learn() -> None:
    scores, biased, kinds = judged()
    result = evaluate(scores, biased, kinds, source=SOURCE, seed=3)
    pipeline = make_pipeline(StandardScaler(), PCA(3), LogisticRegression())
    folds = StratifiedKFold(5, shuffle=True, random_state=3)
    answers = cross_val_predict(pipeline, scores, biased, cv=folds, method="predict_proba")
    expected = np.asarray(answers)[:, 1]
    np.testing.assert_allclose(result.probability, expected, rtol=0, atol=1e-10)
    assert result.accuracy.count == int(((expected > 0.5) == biased).sum())
    assert result.brier == pytest.approx(brier_score_loss(biased, expected), abs=1e-10)
    manual = scores.sum(axis=1) > 0.5
    assert result.agreement.count == int(((expected > 0.5) == manual).sum())
    assert result.manual_accuracy.count == int((manual == biased).sum())
    assert result.baseline == pytest.approx(max(biased.mean(), 1 - biased.mean()))
    assert (result.source, result.n, result.folds) == (SOURCE, 250, 5)


def test_calibration_bins_are_those_of_scikit_learn() -> None:
    scores, biased, _ = judged()
    result = evaluate(scores, biased, source=SOURCE, seed=3)
    observed, predicted = calibration_curve(biased, result.probability, n_bins=10)
    filled = [b for b in result.calibration if b.observed.n]
    np.testing.assert_allclose([b.observed.value for b in filled], observed)
    np.testing.assert_allclose([b.predicted for b in filled], predicted)
    assert sum(b.observed.n for b in result.calibration) == 250
    assert [b.start for b in result.calibration] == pytest.approx(np.arange(10) / 10)
    assert all(np.isnan(b.predicted) for b in result.calibration if not b.observed.n)


def test_confusion_is_that_of_out_of_fold_multinomials() -> None:
    scores, biased, kinds = judged()
    result = evaluate(scores, biased, kinds, source=SOURCE, seed=3)
    named = np.array([k or "" for k in kinds])
    found = np.full(250, "", dtype=named.dtype)
    for fold in range(5):
        train, held = result.fold != fold, result.fold == fold
        reduce = make_pipeline(StandardScaler(), PCA(3)).fit(scores[train])
        model = LogisticRegression().fit(
            reduce.transform(scores[train & biased]), named[train & biased]
        )
        found[held] = model.predict(reduce.transform(scores[held]))
    expected = confusion_matrix(named[biased], found[biased], labels=["ageism", "racism"])
    assert result.kind_names == ("ageism", "racism")
    np.testing.assert_array_equal(result.confusion, expected)


def test_a_kind_named_once_is_still_counted() -> None:
    scores, biased, kinds = judged()
    kinds[kinds.index("ageism")] = "sexism"
    result = evaluate(scores, biased, kinds, source=SOURCE, seed=3)
    assert result.confusion.sum(axis=1)[result.kind_names.index("sexism")] == 1
    # The fold that holds the only one cannot have learned it.
    assert result.confusion[2, 2] == 0


def test_answers_that_follow_nothing_cannot_be_predicted() -> None:
    rng = np.random.default_rng(2)
    result = evaluate(rng.uniform(0, 1, (600, 4)), rng.random(600) < 0.5, source=SOURCE, seed=0)
    assert result.accuracy.low < 0.5 < result.accuracy.high + 0.02
    assert result.brier > 0.24  # 0.25 is the score of always saying one half
    assert result.confusion.shape == (0, 0)


def test_grouped_folds_never_split_a_respondent() -> None:
    scores, biased, kinds = judged()
    who = np.arange(250) % 24
    result = evaluate(scores, biased, kinds, source=SOURCE, seed=3, groups=who)
    assert all(len(np.unique(result.fold[who == w])) == 1 for w in range(24))
    assert set(result.fold) == set(range(5))


def test_folds_follow_the_seed() -> None:
    scores, biased, _ = judged()
    first, again, other = (
        evaluate(scores, biased, source=SOURCE, seed=seed).fold for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_manual_threshold_by_hand() -> None:
    # Totals 0.4 (not biased) and 0.8 (biased); at 0.9 the manual rule calls nothing biased.
    scores = np.repeat([[0.1] * 4, [0.2] * 4], 20, axis=0)
    biased = np.repeat([False, True], 20)
    assert evaluate(scores, biased, source=SOURCE, seed=0).manual_accuracy.value == 1.0
    high = evaluate(scores, biased, source=SOURCE, seed=0, manual_threshold=0.9)
    assert (high.accuracy.value, high.agreement.value, high.manual_accuracy.value) == (1, 0.5, 0.5)


@pytest.mark.parametrize(("count", "n"), [(0, 5), (5, 5), (1, 7), (980, 1000), (12, 24)])
def test_wilson_interval_is_that_of_statsmodels(count, n) -> None:
    share = wilson(count, n)
    assert (share.low, share.high) == pytest.approx(
        proportion_confint(count, n, method="wilson"), abs=1e-12
    )
    assert share.value == count / n
    wide = wilson(count, n, confidence=0.99)
    assert (wide.low, wide.high) == pytest.approx(
        proportion_confint(count, n, alpha=0.01, method="wilson"), abs=1e-12
    )


def test_share_of_nothing_is_missing() -> None:
    share = wilson(0, 0)
    assert np.isnan([share.value, share.low, share.high]).all()


def test_only_one_respondent_ever_said_no() -> None:
    # whoever is left out with that one leaves answers of one kind only
    scores, _, _ = judged()
    who = np.arange(250) % 5
    with refused("range folds", "5", "'biased'"):
        evaluate(scores, who != 3, source=SOURCE, seed=0, groups=who)


def test_evaluation_refuses_too_few_answers() -> None:
    scores, biased, _ = judged()
    few = np.zeros(250, bool)
    few[:4] = True
    with refused("range folds", "4", "5"):
        evaluate(scores, few, source=SOURCE, seed=0)
    with refused("range folds", "2"):
        evaluate(scores, biased, source=SOURCE, seed=0, folds=1)
    with refused("range folds", "3", "5"):
        evaluate(scores, biased, source=SOURCE, seed=0, groups=np.arange(250) % 3)
    with refused("shape groups", "9", "250"):
        evaluate(scores, biased, source=SOURCE, seed=0, groups=np.arange(9))
    with refused("missing scores", "0", "'willingness'"):
        evaluate(np.full((250, 4), np.nan), biased, source=SOURCE, seed=0)
