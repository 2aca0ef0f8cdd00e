"""The detector of Eq. 3: PCA to three components, then logistic regression.

It learns from human judgements of windows of services. A window is described by the four
numbers I of Eq. 2 for one identity; people say whether the robot was biased and which
discrimination it was. The fitted detector is a record of plain numbers: judging needs numpy
only, scikit-learn is used inside ``fit``.

What the paper leaves open and is chosen here: the four scores are standardised before the PCA;
the logistic regression has scikit-learn's default L2 penalty (C = 1), without which separable
judgements have no finite solution; an answer is "biased" above a probability of 0.5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core.errors import InputError, unknown
from evenhand.methods.judgements import checked_judgements, checked_scores
from evenhand.methods.vocabulary import IDENTITIES, ISSUES, SOURCES

COMPONENTS = 3
"""Components that the PCA keeps, as in the paper (fewer when there are fewer issues)."""

# Beyond these a product of a detector's numbers could overflow; no fit comes near them.
LARGEST, SMALLEST_SCALE = 1e12, 1e-12


@dataclass(frozen=True, eq=False)
class WindowVerdict:
    """What the detector says about one window, or about an array of windows.

    Attributes:
        biased: bool [...], whether any identity was judged biased.
        probability: float [..., C], probability of "biased" for each identity; NaN for an
            identity without any score, which is not judged.
        imputed: bool [..., C, K], scores that were missing and taken as their training mean,
            in the identities that were judged.
        worst: int64 [...], position of the identity with the highest probability; -1 where
            the window is not biased.
    """

    biased: NDArray[np.bool_]
    probability: NDArray[np.float64]
    imputed: NDArray[np.bool_]
    worst: NDArray[np.int64]


@dataclass(frozen=True)
class Detector:
    """A fitted detector (Eq. 3), all of it plain numbers.

    Attributes:
        issues: names of the K issues, in the order of the columns.
        identities: names of the identities that the judgements were about.
        mean: K training means.
        scale: K training standard deviations (1 for an issue that never varied).
        components: rows of the PCA on standardised scores, at most 3, each of K numbers.
        weights: logistic weights, one a component.
        bias: logistic intercept.
        kinds: names of the discriminations that people named, sorted; may be empty.
        kind_weights: for each kind, the weights of a multinomial logistic regression on the
            same components, fitted to the judgements "biased".
        kind_bias: its intercepts.
        rows: number of judgements it was fitted to.
        source: "simulated respondents" or "respondents".
        seed: seed that the judgements were drawn with; None for real respondents.
        threshold: probability above which a vector is judged biased.

    Raises:
        InputError: when the numbers do not fit together; the sentence names the field.
    """

    issues: tuple[str, ...]
    identities: tuple[str, ...]
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    components: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    bias: float
    kinds: tuple[str, ...]
    kind_weights: tuple[tuple[float, ...], ...]
    kind_bias: tuple[float, ...]
    rows: int
    source: str
    seed: int | None
    threshold: float = 0.5

    def __post_init__(self) -> None:
        n_issues, n_kept = len(self.issues), len(self.components)
        if n_issues == 0:
            raise InputError("empty issues", "field 'issues' is empty: name at least one issue")
        for field, names in (("issues", self.issues), ("kinds", self.kinds)):
            if len(set(names)) != len(names) or "" in names:
                raise InputError(
                    f"duplicate {field}",
                    f"field {field!r} holds a name twice or an empty one: {names}",
                )
        if not 1 <= n_kept <= n_issues:
            raise InputError(
                "range components",
                f"field 'components' has {n_kept} rows: between 1 and {n_issues} are possible",
            )
        _check("mean", self.mean, n_issues)
        _check("scale", self.scale, n_issues)
        _check("weights", self.weights, n_kept)
        _check("bias", (self.bias,), 1)
        _check("threshold", (self.threshold,), 1)
        _check("kind_bias", self.kind_bias, len(self.kinds))
        if len(self.kind_weights) != len(self.kinds):
            raise InputError(
                "shape kind_weights",
                f"field 'kind_weights' has {len(self.kind_weights)} rows for "
                f"{len(self.kinds)} kinds: give one row a kind",
            )
        for field, rows, length in (
            ("components", self.components, n_issues),
            ("kind_weights", self.kind_weights, n_kept),
        ):
            for i, row in enumerate(rows):
                _check(f"{field}[{i}]", row, length)
        if min(self.scale) < SMALLEST_SCALE:
            raise InputError("range scale", "field 'scale' holds a number that is not positive")
        if not 0 < self.threshold < 1:
            raise InputError(
                "range threshold",
                f"field 'threshold' is {self.threshold}: it must lie between 0 and 1",
            )
        kept = np.array(self.components)
        if np.abs(kept @ kept.T - np.eye(n_kept)).max() > 1e-6:
            raise InputError(
                "format components",
                "field 'components' does not hold rows of length 1 at right angles, "
                "as a PCA gives them: a number is wrong",
            )
        if self.rows < 1:
            raise InputError(
                "range rows", f"field 'rows' is {self.rows}: a detector is fitted to judgements"
            )
        if self.source not in SOURCES:
            raise unknown("source of judgements", self.source, SOURCES)

    def project(self, issue_scores: ArrayLike) -> NDArray[np.float64]:
        """PCA(I) of Eq. 3: standardised scores on the kept components.

        Args:
            issue_scores: float [..., K], I of Eq. 2. A missing score (NaN) counts as its
                training mean.

        Returns:
            float [..., 3] (fewer with fewer issues); NaN where a vector has no score at all.

        Raises:
            InputError: wrong number of issues, or a score outside [-1, 1].
        """
        scores = checked_scores(issue_scores, self.issues)
        standard = (scores - np.array(self.mean)) / np.array(self.scale)
        missing = np.isnan(scores)
        projected = np.where(missing, 0.0, standard) @ np.array(self.components).T
        return np.where(missing.all(axis=-1, keepdims=True), np.nan, projected)

    def probability(self, issue_scores: ArrayLike) -> NDArray[np.float64]:
        """Probability that people would call the vector biased (y' of Eq. 3).

        Args:
            issue_scores: float [..., K]; a missing score (NaN) counts as its training mean.

        Returns:
            float [...]; NaN for a vector without any score: nothing was seen, so nothing is
            judged.

        Raises:
            InputError: as ``project``.
        """
        logit = self.project(issue_scores) @ np.array(self.weights) + self.bias
        # The logistic function, in a form that cannot overflow.
        return 0.5 * (1.0 + np.tanh(0.5 * logit))

    def judge(self, issue_scores: ArrayLike) -> NDArray[np.bool_]:
        """Whether the vector is judged biased: its probability is above the threshold.

        Args:
            issue_scores: float [..., K]; missing scores as in ``probability``, and
                ``imputed`` tells which they were.

        Returns:
            bool [...]; False for a vector without any score.
        """
        return self.probability(issue_scores) > self.threshold

    def imputed(self, issue_scores: ArrayLike) -> NDArray[np.bool_]:
        """Scores that are missing and are taken as their training mean, bool [..., K].

        A vector without any score is not judged, so nothing in it counts as imputed.
        """
        missing = np.isnan(checked_scores(issue_scores, self.issues))
        return missing & ~missing.all(axis=-1, keepdims=True)

    def looks_like(self, issue_scores: ArrayLike) -> NDArray[np.float64]:
        """Which discrimination a biased vector looks like.

        Args:
            issue_scores: float [..., K]; missing scores as in ``probability``.

        Returns:
            float [..., number of kinds], probabilities in the order of ``kinds``, given that
            the vector is biased. NaN for a vector without any score.
        """
        projected = self.project(issue_scores)
        if not self.kinds:
            return np.empty((*projected.shape[:-1], 0))
        logit = projected @ np.array(self.kind_weights).T + np.array(self.kind_bias)
        odds = np.exp(logit - logit.max(axis=-1, keepdims=True))
        return odds / odds.sum(axis=-1, keepdims=True)

    def judge_window(self, by_identity: Mapping[str, ArrayLike] | ArrayLike) -> WindowVerdict:
        """The verdict on a whole window: biased when any of its identities is judged biased.

        With more identities an even robot is called biased by chance more often.

        Args:
            by_identity: float [..., C, K], I for each identity, or a mapping from identity to
                float [..., K] whose order gives the positions. An identity whose K scores are
                all missing is left out.

        Returns:
            The verdict, vectorised over the leading dimensions.

        Raises:
            InputError: as ``project``, or no identity at all.
        """
        if isinstance(by_identity, Mapping):
            vectors = [checked_scores(v, self.issues) for v in by_identity.values()]
            if len({v.shape for v in vectors}) > 1:
                raise InputError(
                    "shape scores", "the identities of a window have scores of different shapes"
                )
            scores = np.stack(vectors, axis=-2) if vectors else np.empty((0, len(self.issues)))
        else:
            scores = checked_scores(by_identity, self.issues)
        if scores.ndim < 2 or scores.shape[-2] == 0:
            raise InputError(
                "empty window", "a window needs the issue scores of at least one identity"
            )
        probability = self.probability(scores)
        biased = np.asarray((probability > self.threshold).any(axis=-1))
        highest = np.where(np.isnan(probability), -1.0, probability).argmax(axis=-1)
        return WindowVerdict(
            biased=biased,
            probability=probability,
            imputed=self.imputed(scores),
            worst=np.where(biased, highest, -1).astype(np.int64),
        )


def complete(scores: np.ndarray) -> np.ndarray:
    """Windows without a score that Eq. 1 cannot say, [W, 4] -> bool [W]; only these are fitted."""
    return np.isnan(scores).sum(axis=1) == 0


def fit(
    issue_scores: ArrayLike,
    biased: ArrayLike,
    kinds: Sequence[str | None] | None = None,
    *,
    source: str,
    seed: int | None,
    issues: Sequence[str] = ISSUES,
    identities: Sequence[str] = IDENTITIES,
) -> Detector:
    """Fit the detector to judgements (Eq. 3). The same input gives the same detector.

    Args:
        issue_scores: float [n, K], I of the judged identity in the judged window.
        biased: bool [n], y: whether the respondent called the robot biased.
        kinds: n names of the discrimination it was judged to be; None or "" where not biased
            or not said. None when nobody was asked.
        source: "simulated respondents" or "respondents".
        seed: seed that the judgements were drawn with, kept as a record.
        issues: names of the K issues; the paper's four by default.
        identities: names of the identities that the judgements were about.

    Returns:
        The detector.

    Raises:
        InputError: a missing score, lengths that differ, only one answer, scores that never
            vary, or a kind given for a vector that was not judged biased.
    """
    from sklearn.decomposition import PCA
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

    scores, y, names = checked_judgements(issue_scores, biased, kinds, tuple(issues))
    if np.ptp(scores, axis=0).max() == 0:
        raise InputError(
            "empty scores", "all judged windows have the same issue scores: nothing can be learned"
        )
    for issue, spread in zip(issues, scores.std(axis=0), strict=True):
        if 0 < spread < SMALLEST_SCALE:
            raise InputError(
                "empty scores",
                f"the scores of {issue!r} hardly differ in the judged windows (standard deviation "
                f"{spread:.0e}): round them, or leave the issue out",
            )
    n_kept = min(COMPONENTS, scores.shape[1])
    if len(scores) < n_kept:
        raise InputError(
            "range judgements", f"{len(scores)} judgements are too few: give at least {n_kept}"
        )
    scaler = StandardScaler().fit(scores)
    pca = PCA(n_kept, svd_solver="full").fit(scaler.transform(scores))
    projected = pca.transform(scaler.transform(scores))
    logistic = LogisticRegression(max_iter=1000).fit(projected, y)

    named = np.array([name is not None for name in names])
    kind_names = tuple(sorted({name for name in names if name is not None}))
    kind_weights, kind_bias = np.zeros((len(kind_names), n_kept)), np.zeros(len(kind_names))
    if len(kind_names) > 1:
        labels = [name for name in names if name is not None]
        multinomial = LogisticRegression(max_iter=1000).fit(projected[named], labels)
        # With two kinds scikit-learn keeps one row, for the second: the first is the zero row.
        first = len(kind_names) - len(multinomial.coef_)
        kind_weights[first:], kind_bias[first:] = multinomial.coef_, multinomial.intercept_
    return Detector(
        issues=tuple(issues),
        identities=tuple(identities),
        mean=_numbers(np.asarray(scaler.mean_)),
        scale=_numbers(np.asarray(scaler.scale_)),
        components=tuple(_numbers(row) for row in np.asarray(pca.components_)),
        weights=_numbers(logistic.coef_[0]),
        bias=float(logistic.intercept_[0]),
        kinds=kind_names,
        kind_weights=tuple(_numbers(row) for row in kind_weights),
        kind_bias=_numbers(kind_bias),
        rows=len(scores),
        source=source,
        seed=None if seed is None else int(seed),
    )


def _check(field: str, numbers: tuple[float, ...], length: int) -> None:
    if len(numbers) != length:
        raise InputError(
            f"shape {field}",
            f"field {field!r} has {len(numbers)} numbers where {length} are needed",
        )
    if not all(abs(number) <= LARGEST for number in numbers):
        raise InputError(
            f"range {field}", f"field {field!r} holds a number that is not finite or far too large"
        )


def _numbers(row: ArrayLike) -> tuple[float, ...]:
    return tuple(np.asarray(row, dtype=np.float64).tolist())
