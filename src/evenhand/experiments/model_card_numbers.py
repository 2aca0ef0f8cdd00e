"""What a model card needs to be measured: a test on new people, an evaluation out of fold."""

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.detector_file import Answers
from evenhand.methods.paper import detector, issues
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import membership
from evenhand.methods.services import Services
from evenhand.report.model_cards.robot import Trial
from evenhand.statistics import detector_accuracy, verdicts
from evenhand.statistics.means import SHARE, mean_interval


def trial_of(table: Services, seed: int, population: str) -> Trial:
    """All that a card says of a trial.

    Args:
        table: services by the robot to people whom training never saw, at least one window of 30.
        seed: that they were drawn with; also of the permutations.
        population: where they were drawn from.
    """
    from evenhand.training import evaluate

    windows = evaluate.window_scores(table)
    x, who = issues.indicators(table), membership(table)
    good = evaluate.perfect(table)
    responded = table.fact("responded") == 1.0
    return Trial(
        services=len(table),
        seed=seed,
        population=population,
        scores={
            "total": mean_interval(windows.total, within=(0.0, len(windows.issues))),
            **{
                name: mean_interval(windows.overall[:, k], within=SHARE)
                for k, name in enumerate(windows.issues)
            },
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


def evaluation_of(
    judge: Detector, answers: Answers, folds: int = 5
) -> detector_accuracy.Evaluation:
    """How good a detector is on the judgements that it was fitted to, out of fold."""
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
            "changed answers",
            f"the answers are not those that the detector was fitted to ({again.rows} judgements "
            f"here, {judge.rows} there): give its own answers, or none",
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
