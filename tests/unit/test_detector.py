"""The detector against scikit-learn's own pipeline, hand arithmetic, and input it must refuse."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from evenhand.core.errors import InputError
from evenhand.methods.paper.detector import Detector, fit
from support.refusals import refused as input_refused

SIMULATED = "simulated respondents"
SIGNATURES = {
    "racism": (0.49, 0.25, 0.38, 0.43),
    "ageism": (0.42, 0.68, 0.54, 0.49),
    "ableism": (0.05, 0.66, 0.0, 0.0),
}


def judged(n: int = 300, kinds: tuple[str, ...] = tuple(SIGNATURES)):
    """Windows around the paper's signatures at strengths 0-1, biased when the total is high."""
    rng = np.random.default_rng(5)
    which = rng.integers(len(kinds), size=n)
    signatures = np.array([SIGNATURES[kind] for kind in kinds])[which]
    scores = rng.uniform(0, 1, (n, 1)) * signatures + np.abs(rng.normal(0, 0.06, (n, 4)))
    scores = scores.clip(0, 1)
    biased = scores.sum(axis=1) + rng.normal(0, 0.1, n) > 0.7
    names = [kinds[k] if b else None for k, b in zip(which, biased, strict=True)]
    return scores, biased, names


def tiny(**changes) -> Detector:
    """Two issues, components along the axes: everything can be done by hand."""
    detector = Detector(
        issues=("slow", "far"),
        identities=("age",),
        mean=(0.2, 0.4),
        scale=(0.1, 0.2),
        components=((1.0, 0.0), (0.0, 1.0)),
        weights=(2.0, -1.0),
        bias=0.5,
        kinds=("a", "b"),
        kind_weights=((0.0, 0.0), (1.0, 2.0)),
        kind_bias=(0.0, -1.0),
        rows=10,
        source="respondents",
        seed=None,
    )
    return replace(detector, **changes)


def test_probability_is_that_of_the_scikit_learn_pipeline() -> None:
    scores, biased, names = judged()
    pipeline = make_pipeline(StandardScaler(), PCA(3), LogisticRegression()).fit(scores, biased)
    new = np.random.default_rng(8).uniform(0, 1, (200, 4))
    detector = fit(scores, biased, names, source=SIMULATED, seed=5)
    for rows in (scores, new):
        expected = pipeline.predict_proba(rows)[:, 1]
        np.testing.assert_allclose(detector.probability(rows), expected, rtol=0, atol=1e-10)
        np.testing.assert_array_equal(detector.judge(rows), pipeline.predict(rows))


@pytest.mark.parametrize("kinds", [("ageism", "racism"), ("racism", "ageism", "ableism")])
def test_kinds_are_those_of_a_multinomial_on_the_same_components(kinds) -> None:
    scores, biased, names = judged(kinds=kinds)
    reduce = make_pipeline(StandardScaler(), PCA(3)).fit(scores)
    labels = np.array([name or "" for name in names])[biased]
    oracle = LogisticRegression().fit(reduce.transform(scores[biased]), labels)
    new = np.random.default_rng(9).uniform(0, 1, (50, 4))
    detector = fit(scores, biased, names, source=SIMULATED, seed=5)
    assert detector.kinds == tuple(sorted(kinds)) == tuple(oracle.classes_)
    expected = oracle.predict_proba(reduce.transform(new))
    np.testing.assert_allclose(detector.looks_like(new), expected, rtol=0, atol=1e-10)


def test_each_signature_of_the_paper_looks_like_its_discrimination() -> None:
    detector = fit(*judged(), source=SIMULATED, seed=5)
    for kind, signature in SIGNATURES.items():
        assert detector.judge(signature) or kind == "ableism"  # its total of 0.71 is at the limit
        assert detector.kinds[detector.looks_like(signature).argmax()] == kind
    assert not detector.judge((0, 0, 0, 0))


def test_tiny_detector_by_hand() -> None:
    # (0.3, 0.8) is standardised to (1, 2): logit 2*1 - 1*2 + 0.5 = 0.5.
    # Kinds: logits 0 and 1 + 4 - 1 = 4.
    detector = tiny()
    np.testing.assert_allclose(detector.project([0.3, 0.8]), [1, 2], atol=1e-14)
    assert detector.probability([0.3, 0.8]) == pytest.approx(1 / (1 + math.exp(-0.5)), abs=1e-14)
    kinds = [1 / (1 + math.exp(4)), 1 / (1 + math.exp(-4))]
    np.testing.assert_allclose(detector.looks_like([0.3, 0.8]), kinds, atol=1e-14)
    assert detector.judge([0.3, 0.8])
    assert not replace(detector, threshold=0.63).judge([0.3, 0.8])  # the probability is 0.6225


def test_components_mix_the_issues_by_hand() -> None:
    # One component (3, 4)/5 of two issues: (1, 2) projects to 11/5, logit 2*2.2 + 0.5 = 4.9.
    detector = tiny(components=((0.6, 0.8),), weights=(2.0,), kind_weights=((0.0,), (1.0,)))
    assert detector.probability([0.3, 0.8]) == pytest.approx(1 / (1 + math.exp(-4.9)), abs=1e-14)


def test_a_missing_score_counts_as_its_training_mean_and_is_told() -> None:
    detector = tiny()
    # Standardised (1, 0): logit 2 + 0.5.
    expected = 1 / (1 + math.exp(-2.5))
    assert detector.probability([0.3, np.nan]) == pytest.approx(expected, abs=1e-14)
    assert detector.imputed([[0.3, np.nan], [0.3, 0.8]]).tolist() == [[False, True], [False] * 2]


def test_a_vector_without_scores_is_not_judged() -> None:
    detector = tiny(bias=100.0)  # at the training mean everything would be biased
    empty = [np.nan, np.nan]
    assert np.isnan(detector.probability(empty))
    assert not detector.judge(empty)
    assert np.isnan(detector.looks_like(empty)).all()
    assert not detector.imputed(empty).any()


def test_window_is_biased_when_any_identity_is() -> None:
    detector = tiny()
    # Logits by hand: (0.2, 0.4) -> 0.5; (0.1, 0.4) -> -1.5; (0.3, 0.4) -> 2.5.
    low, middle, high = [0.1, 0.4], [0.2, 0.4], [0.3, 0.4]
    verdict = detector.judge_window([[low, low], [middle, high], [low, [np.nan, np.nan]]])
    assert verdict.biased.tolist() == [False, True, False]
    assert verdict.worst.tolist() == [-1, 1, -1]
    np.testing.assert_allclose(verdict.probability[1], [0.6224593312, 0.9241418200], atol=1e-9)
    assert np.isnan(verdict.probability).tolist() == [[False] * 2, [False] * 2, [False, True]]
    nothing_first = detector.judge_window([[np.nan, np.nan], high])
    assert (bool(nothing_first.biased), int(nothing_first.worst)) == (True, 1)
    strict = replace(detector, threshold=0.93)  # above the 0.924 of the highest
    assert not strict.judge_window([middle, high]).biased


def test_window_as_a_mapping_keeps_its_order() -> None:
    detector = tiny()
    verdict = detector.judge_window({"age": [0.1, 0.4], "race": [0.3, np.nan]})
    assert bool(verdict.biased)
    assert int(verdict.worst) == 1
    assert verdict.imputed.tolist() == [[False, False], [False, True]]


def test_window_with_nothing_seen_is_not_biased() -> None:
    verdict = tiny(bias=100.0).judge_window(np.full((3, 2), np.nan))
    assert not verdict.biased
    assert verdict.worst == -1
    assert not verdict.imputed.any()


@pytest.mark.parametrize(("n_issues", "n_kept"), [(1, 1), (2, 2), (3, 3), (6, 3)])
def test_any_number_of_issues(n_issues, n_kept) -> None:
    rng = np.random.default_rng(1)
    scores = rng.uniform(0, 1, (60, n_issues))
    biased = scores[:, 0] > 0.5
    names = tuple(f"issue {k}" for k in range(n_issues))
    detector = fit(scores, biased, source="respondents", seed=None, issues=names)
    pipeline = make_pipeline(StandardScaler(), PCA(n_kept), LogisticRegression())
    expected = pipeline.fit(scores, biased).predict_proba(scores)[:, 1]
    assert len(detector.components) == n_kept
    np.testing.assert_allclose(detector.probability(scores), expected, rtol=0, atol=1e-10)
    assert detector.kinds == ()
    assert detector.looks_like(scores).shape == (60, 0)


def test_one_kind_is_always_that_kind() -> None:
    scores, biased, _ = judged()
    names = ["ageism" if b else "" for b in biased]
    detector = fit(scores, biased, names, source=SIMULATED, seed=5)
    np.testing.assert_array_equal(detector.looks_like(scores), np.ones((300, 1)))


def test_an_issue_that_never_varies_is_no_obstacle() -> None:
    scores, biased, names = judged()
    scores[:, 3] = 0.0
    detector = fit(scores, biased, names, source=SIMULATED, seed=5)
    assert detector.scale[3] == 1.0
    assert np.isfinite(detector.probability(scores)).all()


def test_the_record_tells_where_it_comes_from() -> None:
    detector = fit(*judged(120), source=SIMULATED, seed=7)
    assert (detector.rows, detector.source, detector.seed) == (120, SIMULATED, 7)
    assert detector.issues == ("willingness", "quality", "priority", "risk")
    assert detector.identities == ("race", "gender", "age", "disability")
    assert detector == fit(*judged(120), source=SIMULATED, seed=7)


def refused(match: str, scores=None, biased=None, names=None, **settings) -> None:
    good = judged(60)
    scores, biased = good[0] if scores is None else scores, good[1] if biased is None else biased
    settings = {"source": SIMULATED, "seed": 0} | settings
    with pytest.raises(InputError, match=match):
        fit(scores, biased, names, **settings)


def test_fit_refuses_what_cannot_be_learned_from() -> None:
    scores, biased, _ = judged(60)
    gap = scores.copy()
    gap[4, 1] = np.nan
    refused("row 4 has no score for issue 'quality'", scores=gap)
    refused("between -1 and 1, but 49 was given", scores=np.full((60, 4), 49.0))
    refused("between -1 and 1, but inf", scores=np.full((60, 4), np.inf))
    refused("last dimension must be the 4 issues", scores=scores[:, :3])
    refused("array of numbers", scores=[["a"] * 4] * 60)
    refused(r"shapes are \(60, 4\) and \(59,\)", biased=biased[:-1])
    refused("must be True or False", biased=np.full(60, 2))
    refused("must be True or False", biased=np.full(60, "yes"))
    refused("all 60 judgements are biased", biased=np.ones(60, bool))
    still = scores.copy()
    still[:, 2] = 0.5 + np.linspace(0, 1e-13, 60)
    refused("scores of 'priority' hardly differ", scores=still)
    refused("all 60 judgements are not biased", biased=np.zeros(60, bool))
    refused("59 kinds for 60 judgements", names=[None] * 59)
    unbiased = int(np.flatnonzero(~biased)[0])
    named = [None] * unbiased + ["ageism"] + [None] * (59 - unbiased)
    refused(f"row {unbiased} names 'ageism' but was judged not biased", names=named)
    refused("same issue scores", scores=np.full((60, 4), 0.3))
    refused("2 judgements are too few", scores=scores[:2], biased=[True, False])
    refused("did you mean 'respondents'", source="respondent")


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"issues": ()}, "'issues' is empty"),
        ({"issues": ("slow", "slow")}, "'issues' holds a name twice"),
        ({"kinds": ("a", "")}, "'kinds' holds a name twice or an empty one"),
        ({"mean": (0.1,)}, "'mean' has 1 numbers where 2 are needed"),
        ({"scale": (0.1, 0.0)}, "'scale' holds a number that is not positive"),
        ({"scale": (0.1, -1.0)}, "'scale' holds a number that is not positive"),
        ({"weights": (1.0, 2.0, 3.0)}, "'weights' has 3 numbers where 2 are needed"),
        ({"bias": math.nan}, "'bias' holds a number that is not finite"),
        ({"bias": 1e300}, "'bias' holds a number that is not finite or far too large"),
        ({"components": ()}, "'components' has 0 rows"),
        ({"components": ((1.0, 0.0),) * 3}, "'components' has 3 rows"),
        ({"components": ((1.0, 0.0), (1.0,))}, r"'components\[1\]' has 1 numbers"),
        ({"components": ((1.0, 0.0), (0.1, 1.0))}, "right angles"),
        ({"kind_weights": ((0.0, 0.0),)}, "'kind_weights' has 1 rows for 2 kinds"),
        ({"kind_bias": (0.0,)}, "'kind_bias' has 1 numbers where 2"),
        ({"threshold": 1.0}, "'threshold' is 1.0"),
        ({"rows": 0}, "'rows' is 0"),
        ({"source": "somebody"}, "unknown source of judgements 'somebody'"),
    ],
)
def test_numbers_that_do_not_fit_together_are_refused(changes, match) -> None:
    with pytest.raises(InputError, match=match):
        tiny(**changes)


def test_judging_refuses_wrong_shapes() -> None:
    with input_refused("shape scores", "2"):
        tiny().probability([0.1, 0.2, 0.3])
    with input_refused("empty window"):
        tiny().judge_window({})
    with input_refused("empty window"):
        tiny().judge_window([0.1, 0.2])
    with input_refused("shape scores"):
        tiny().judge_window({"age": [0.1, 0.4], "race": [[0.1, 0.4]]})


def test_judging_does_not_load_scikit_learn() -> None:
    code = (
        "import sys, evenhand.methods.paper.detector, evenhand.methods.detector_file\n"
        "import evenhand.statistics.detector_accuracy\n"
        "import evenhand.study.simulated.respondents\n"
        "sys.exit('sklearn' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
