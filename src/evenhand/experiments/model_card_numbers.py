"""What a model card needs to be measured: a test on new people, an evaluation out of fold."""

from __future__ import annotations

import numpy as np
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.methods.detector_file import Answers
from evenhand.methods.paper import detector, issues
from evenhand.methods.paper.detector import Detector
from evenhand.methods.services import Interactions
from evenhand.report.model_cards.robot import Mean, Trial
from evenhand.statistics import detector_accuracy, verdicts


def trial_of(table: Interactions, seed: int, population: str) -> Trial:
    """All that a card says of a trial.

    Args:
        table: services by the robot to people whom training never saw, at least one window of 30.
        seed: that they were drawn with; also of the permutations.
        population: where they were drawn from.
    """
    from evenhand.training import evaluate

    windows = evaluate.window_scores(table)
    x, who = issues.indicators(table), issues.membership(table)
    good = evaluate.perfect(table)
    responded = table.fact("responded") == 1.0
    return Trial(
        services=len(table),
        seed=seed,
        population=population,
        scores={
            "total": mean_of(windows.total, len(windows.issues)),
            **{name: mean_of(windows.overall[:, k]) for k, name in enumerate(windows.issues)},
        },
        floor=evaluate.summary(table, seed)["floor"],
        perfect=detector_accuracy.wilson(int(good.sum()), len(good)),
        responded=detector_accuracy.wilson(int(responded.sum()), len(responded)),
        groups=tuple(who.groups),
        perfect_of=tuple(
            detector_accuracy.wilson(int(good[inside].sum()), int(inside.sum()))
            for inside in (who.inside == 1.0).T
        ),
        verdicts=verdicts.judge(x, who.inside, np.random.default_rng(seed)),
        issues=tuple(windows.issues),
    )


def mean_of(values: np.ndarray, most: float = 1.0) -> Mean:
    """Mean of windows with Student's 95 % interval, as far as it lies on the scale.

    Args:
        values: one a window, from 0 to ``most``; NaN where a window says nothing.
        most: a score cannot be greater.
    """
    known = values[~np.isnan(values)]
    n = len(known)
    if n == 0:
        return Mean(None, None, None, 0)
    mean = float(known.mean())
    if n == 1:
        return Mean(mean, None, None, 1)
    half = float(stats.t.ppf(0.975, n - 1) * known.std(ddof=1) / np.sqrt(n))
    return Mean(mean, max(mean - half, 0.0), min(mean + half, most), n)


def evaluation_of(
    judge: Detector, answers: Answers, folds: int = 5
) -> detector_accuracy.Evaluation:
    """How good a detector is on the judgements that it was fitted to, out of fold.

    Raises:
        InputError: when it was fitted to others.
    """
    kept = detector.complete(answers.issue_scores)
    scores, biased = answers.issue_scores[kept], answers.biased[kept]
    kinds = [kind for kind, keep in zip(answers.kinds, kept, strict=True) if keep]
    asked = answers.respondents
    seed = 0 if judge.seed is None else judge.seed
    again = detector.fit(scores, biased, kinds, source=judge.source, seed=seed, issues=judge.issues)
    same = again.rows == judge.rows and all(
        np.allclose(getattr(again, name), getattr(judge, name), rtol=1e-3, atol=1e-6)
        for name in ("mean", "scale")
    )
    if not same:
        raise InputError(
            f"the answers are not those that the detector was fitted to ({again.rows} judgements "
            f"here, {judge.rows} there): give its own answers, or none"
        )
    return detector_accuracy.evaluate(
        scores,
        biased,
        kinds,
        source=judge.source,
        seed=seed,
        folds=folds,
        groups=None if asked is None else np.array(asked)[kept],
        issues=judge.issues,
    )
