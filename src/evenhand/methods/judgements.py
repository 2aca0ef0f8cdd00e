"""What people judged: scores of windows and answers, checked for fitting and for evaluation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core.errors import InputError


def checked_scores(issue_scores: ArrayLike, issues: tuple[str, ...]) -> NDArray[np.float64]:
    """Issue scores as float64 [..., K]; NaN is allowed.

    Raises:
        InputError: when the last dimension is not K or a score is outside [-1, 1], where every
            difference of two rates lies, corrected for chance or not.
    """
    try:
        scores = np.asarray(issue_scores, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            "type scores", f"issue scores must be an array of numbers: {error}"
        ) from error
    if scores.ndim == 0 or scores.shape[-1] != len(issues):
        raise InputError(
            "shape scores",
            f"issue scores have shape {scores.shape}: the last dimension must be the "
            f"{len(issues)} issues {', '.join(issues)}",
        )
    if (np.abs(scores) > 1 + 1e-9).any():
        raise InputError(
            "range scores",
            f"issue scores lie between -1 and 1, but {np.nanmax(np.abs(scores)):g} was given: "
            "use shares, not percent",
        )
    return scores


def checked_judgements(
    issue_scores: ArrayLike,
    biased: ArrayLike,
    kinds: Sequence[str | None] | None,
    issues: tuple[str, ...],
) -> tuple[NDArray[np.float64], NDArray[np.bool_], list[str | None]]:
    """Judgements as arrays of one length without gaps, for fitting and for evaluation.

    Returns:
        Scores float [n, K], biased bool [n], kinds (n names, None where nobody named one).

    Raises:
        InputError: as ``fit``.
    """
    scores = checked_scores(issue_scores, issues)
    answers = np.asarray(biased)
    if scores.ndim != 2 or answers.shape != scores.shape[:1]:
        raise InputError(
            "shape judgements",
            f"judgements need scores [n, {len(issues)}] and answers [n], but the shapes are "
            f"{scores.shape} and {answers.shape}",
        )
    if answers.dtype.kind not in "biuf" or not np.isin(answers, (0, 1)).all():
        raise InputError("type biased", "the answers 'biased' must be True or False")
    for row, column in np.argwhere(np.isnan(scores))[:1]:
        raise InputError(
            "missing scores",
            f"row {row} has no score for issue {issues[column]!r}: leave out judgements of "
            "windows with a missing score",
        )
    y = answers.astype(bool)
    if y.all() or not y.any():
        raise InputError(
            "empty biased",
            f"all {len(y)} judgements are {'biased' if y.any() else 'not biased'}: "
            "the detector needs examples of both",
        )
    names: list[str | None] = (
        [None] * len(y) if kinds is None else [str(k) if k else None for k in kinds]
    )
    if len(names) != len(y):
        raise InputError("shape kinds", f"there are {len(names)} kinds for {len(y)} judgements")
    for row, name in enumerate(names):
        if name is not None and not y[row]:
            raise InputError(
                "conflict kinds", f"row {row} names {name!r} but was judged not biased"
            )
    return scores, y, names
