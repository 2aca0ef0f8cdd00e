"""Laws of the detector, its file, and the simulated respondents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.methods.detector_file import load, save
from evenhand.methods.paper.detector import Detector, fit
from evenhand.statistics.detector_accuracy import wilson
from evenhand.study.simulated.respondents import judge, recruit

number = st.floats(-50, 50)
score = st.floats(0, 1)
missing = st.one_of(score, st.just(np.nan))


def row(length: int, elements=number):
    return st.lists(elements, min_size=length, max_size=length).map(tuple)


@st.composite
def detectors(draw, n_issues: int = 4) -> Detector:
    """Any detector: orthogonal components, arbitrary numbers otherwise."""
    kept = min(3, n_issues)
    seed = draw(st.integers(0, 2**32 - 1))
    basis, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((n_issues, n_issues)))
    kinds = draw(st.lists(st.text(min_size=1), max_size=5, unique=True))
    return Detector(
        issues=tuple(f"issue {k}" for k in range(n_issues)),
        identities=tuple(draw(st.lists(st.text(min_size=1), max_size=5))),
        mean=draw(row(n_issues, score)),
        scale=draw(row(n_issues, st.floats(0.01, 10))),
        components=tuple(tuple(r.tolist()) for r in basis[:kept]),
        weights=draw(row(kept)),
        bias=draw(number),
        kinds=tuple(kinds),
        kind_weights=tuple(draw(row(kept)) for _ in kinds),
        kind_bias=draw(row(len(kinds))),
        rows=draw(st.integers(1, 10**9)),
        source=draw(st.sampled_from(["respondents", "simulated respondents"])),
        seed=draw(st.none() | st.integers()),
        threshold=draw(st.floats(0.01, 0.99)),
    )


def judged(seed: int, n: int = 60):
    rng = np.random.default_rng(seed)
    scores = rng.uniform(0, 0.5, (n, 4))
    biased = scores.sum(axis=1) + rng.normal(0, 0.1, n) > 1
    biased[:2] = True, False
    kinds = [("ageism", "racism", "ableism")[i % 3] if b else None for i, b in enumerate(biased)]
    return scores, biased, kinds


def effective(detector: Detector) -> np.ndarray:
    """How the logit grows with each score."""
    return np.array(detector.weights) @ np.array(detector.components) / np.array(detector.scale)


@given(detectors(), hnp.arrays(float, (6, 4), elements=missing))
def test_probabilities_are_probabilities(detector, scores) -> None:
    probability = detector.probability(scores)
    seen = ~np.isnan(scores).all(axis=1)
    np.testing.assert_array_equal(np.isnan(probability), ~seen)
    assert ((probability[seen] >= 0) & (probability[seen] <= 1)).all()
    kinds = detector.looks_like(scores)[seen]
    if detector.kinds:
        np.testing.assert_allclose(kinds.sum(axis=1), 1, atol=1e-12)
        assert (kinds >= 0).all()


@given(detectors(), row(4, score), st.integers(0, 3), score)
def test_probability_moves_with_a_score_as_its_weight_says(detector, scores, issue, higher) -> None:
    before, after = np.array(scores), np.array(scores)
    after[issue] = higher
    step = effective(detector)[issue] * (after[issue] - before[issue])
    change = detector.probability(after) - detector.probability(before)
    assert change * np.sign(step) >= -1e-12


@given(detectors(), row(4, score), st.sets(st.integers(0, 3), max_size=3))
def test_a_missing_score_is_its_training_mean(detector, scores, gone) -> None:
    holes, filled = np.array(scores), np.array(scores)
    for issue in gone:
        holes[issue], filled[issue] = np.nan, detector.mean[issue]
    assert detector.probability(holes) == pytest.approx(detector.probability(filled), abs=1e-12)
    assert set(np.flatnonzero(detector.imputed(holes))) == gone


@given(detectors(), hnp.arrays(float, (5, 4), elements=missing), st.permutations(range(5)))
def test_a_window_is_biased_when_one_of_its_identities_is(detector, scores, order) -> None:
    verdict = detector.judge_window(scores)
    assert bool(verdict.biased) == any(detector.judge(vector) for vector in scores)
    assert (int(verdict.worst) == -1) == (not verdict.biased)
    moved = detector.judge_window(scores[order])
    assert moved.biased == verdict.biased
    if verdict.biased:
        assert moved.probability[moved.worst] == verdict.probability[verdict.worst]
    absent = detector.judge_window(np.vstack([scores, np.full(4, np.nan)]))
    assert (absent.biased, absent.worst) == (verdict.biased, verdict.worst)


@given(detectors(), hnp.arrays(float, (2, 3, 5, 4), elements=missing))
def test_many_windows_are_judged_as_each_alone(detector, scores) -> None:
    together = detector.judge_window(scores)
    for i in range(2):
        for j in range(3):
            alone = detector.judge_window(scores[i, j])
            assert together.biased[i, j] == alone.biased
            np.testing.assert_allclose(
                together.probability[i, j], alone.probability, rtol=0, atol=1e-12
            )


@given(detectors(), st.floats(0.01, 0.99), row(4, score))
def test_a_higher_threshold_never_finds_more(detector, threshold, scores) -> None:
    low, high = sorted((detector.threshold, threshold))
    strict, lenient = replace(detector, threshold=high), replace(detector, threshold=low)
    assert lenient.judge(scores) >= strict.judge(scores)


@given(detectors())
def test_a_file_gives_back_the_same_detector(tmp_path_factory, detector) -> None:
    path = tmp_path_factory.getbasetemp() / "detector.json"
    save(detector, path)
    assert repr(load(path)) == repr(detector)


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.randoms(use_true_random=False))
def test_the_order_of_the_judgements_does_not_matter(seed, random) -> None:
    scores, biased, kinds = judged(seed)
    order = list(range(len(biased)))
    random.shuffle(order)
    first = fit(scores, biased, kinds, source="respondents", seed=None)
    again = fit(
        scores[order], biased[order], [kinds[i] for i in order], source="respondents", seed=None
    )
    new = np.random.default_rng(seed).uniform(0, 1, (20, 4))
    np.testing.assert_allclose(first.probability(new), again.probability(new), atol=1e-3)
    np.testing.assert_allclose(first.looks_like(new), again.looks_like(new), atol=1e-3)


@settings(max_examples=20)
@given(st.integers(0, 10**6), row(4, st.floats(0.1, 1)), row(4, st.floats(-0.5, 0.5)))
def test_the_unit_of_an_issue_does_not_matter(seed, scale, shift) -> None:
    # Standardising comes first, so a score may be stretched and moved without any effect.
    scores, biased, _ = judged(seed)
    moved = scores * scale + shift
    first = fit(scores, biased, source="respondents", seed=None)
    again = fit(moved, biased, source="respondents", seed=None)
    np.testing.assert_allclose(first.probability(scores), again.probability(moved), atol=1e-3)


@given(st.integers(0, 500), st.integers(1, 500), st.floats(0.5, 0.999))
def test_wilson_intervals_hold_the_share_and_mirror(count, n, confidence) -> None:
    count = min(count, n)
    share, other = wilson(count, n, confidence), wilson(n - count, n, confidence)
    assert 0 <= share.low <= share.value + 1e-15
    assert share.value - 1e-15 <= share.high <= 1
    assert share.low == pytest.approx(1 - other.high, abs=1e-12)


@given(st.integers(0, 10**6), hnp.arrays(float, (10, 4, 4), elements=missing), score)
def test_more_evidence_never_makes_a_respondent_see_less(seed, scores, more) -> None:
    respondents = recruit(np.random.default_rng(seed))
    who, shown = np.arange(10), np.arange(10) % 4
    first, worse = (
        judge(respondents, who, s, shown, np.random.default_rng(seed + 1))
        for s in (scores, np.maximum(np.nan_to_num(scores, nan=0.0), more))
    )
    assert (worse.biased >= first.biased).all()
    for said in (first, worse):
        np.testing.assert_array_equal(said.identity >= 0, said.biased)
        np.testing.assert_array_equal(said.issue >= 0, said.biased)
