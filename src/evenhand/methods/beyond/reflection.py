"""Self-reflection: every update is examined along the bias gradient.

The direction that raises bias is b = ∇θ Σ_k τ_k I_k, estimated from the decisions of the epoch by
the score function: b = Σ_i w_i ∇ log π(service i), with the influence w_i of ``credit``. There is
one such direction for each identity and issue. Of an update (the step that the actor's weights
took) its cosine with each direction and its projection <step, b> are taken: how many points the
score changes to first order. The gradients are the learner's (``learn.reflection``, or those of
another library); what follows from them is here.

**Alarm.** Is this update abnormal among the updates of this run? The cosines of the last updates
and of this one are standardised together (each identity and issue by the mean and spread over all
of them), and the largest of each update, among those that raise bias, is ranked. The share of
updates at least as extreme as this one is a p-value that supposes no distribution: if updates are
exchangeable, as those of a robot whose learning does not turn more biased, it is at most ``rate``
with a chance of at most ``rate``, whatever the number of identities and issues (full conformal
prediction, Vovk et al. 2005). The rate is one of each update, not of a whole run: 300 updates at
0.02 give up to 6 false alarms on average. Updates with an alarm stay in the history: without them
ever more would look abnormal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError, whole
from evenhand.methods.beyond.influence import Influence

_ROUNDING = 1e-9
"""1 / (1/49) is a bit more than 49."""


@dataclass(frozen=True)
class ReflectionSettings:
    """When an update counts as abnormal."""

    rate: float = 0.02
    """Chance of an alarm at one update when nothing is wrong."""

    history: int = 100
    """Earlier updates that this one is compared with; at least 1 / rate - 1, for with fewer no
    update can be rare enough (none is before so many have happened)."""

    def __post_init__(self) -> None:
        if not 0.0 < self.rate < 1.0:
            raise InputError(
                "range rate", f"rate is {self.rate}: give a chance above 0 and below 1"
            )
        whole("history", self.history, 1, 100_000)
        least = math.ceil(1.0 / self.rate - _ROUNDING) - 1
        if self.history < least:
            raise InputError(
                "range history",
                f"history is {self.history}: with a rate of {self.rate} give at least {least}",
            )


@dataclass(frozen=True)
class Past:
    """Cosines of the last updates.

    Attributes:
        cosines: the newest last, [H, C + 1, K + 1]; the last row is of all groups, the last
            column of all issues; NaN where a direction or a step is missing.
        filled: updates that it holds, 0 to H.
    """

    cosines: np.ndarray
    filled: int = 0

    @classmethod
    def empty(cls, identities: int, issues: int, settings: ReflectionSettings) -> Past:
        """A past without updates."""
        return cls(np.full((settings.history, identities + 1, issues + 1), np.nan))

    @property
    def known(self) -> np.ndarray:
        """Cosines of the updates that happened, [filled, C + 1, K + 1]."""
        return self.cosines[len(self.cosines) - self.filled :]


@dataclass(frozen=True)
class Reflection:
    """What one update was along the bias gradient.

    Tables are [C + 1, K + 1]: identities then all groups, issues then all issues by tau; NaN
    where a direction, the step or the history is missing.

    Attributes:
        identities: names of the C identities.
        issues: names of the K issues.
        cosine: of step and bias gradient; above 0 the update raises bias.
        projection: change of the score to first order, in points of the score.
        z: the cosine in standard deviations above the mean of the earlier updates.
        p_value: share of updates at least as extreme as this one, this one included.
        alarm: whether the update is abnormal and raises bias.
        identity: of the most abnormal direction in which it raises bias; None if there is none,
            or nothing to compare with.
        issue: of the same.
        favoured: groups of this identity whose rate of this issue the update lowers against
            the rest, the most favoured first.
    """

    identities: tuple[str, ...]
    issues: tuple[str, ...]
    cosine: np.ndarray
    projection: np.ndarray
    z: np.ndarray
    p_value: float
    alarm: bool
    identity: str | None
    issue: str | None
    favoured: tuple[str, ...]

    def numbers(self) -> dict[str, float | bool | str | None]:
        """For the record of an epoch: overall, by issue, by identity; names if there is an alarm.

        What is missing is not a number.
        """
        out: dict[str, float | bool | str | None] = {}
        for name, table in (
            ("cosine", self.cosine),
            ("projection", self.projection),
            ("z", self.z),
        ):
            out[f"reflection_{name}"] = float(table[-1, -1])
            for k, issue in enumerate(self.issues):
                out[f"reflection_{name}_{issue}"] = float(table[-1, k])
            for c, identity in enumerate(self.identities):
                out[f"reflection_{name}_{identity}"] = float(table[c, -1])
        out["reflection_p"] = self.p_value
        out["reflection_alarm"] = self.alarm
        out["reflection_identity"] = self.identity if self.alarm else None
        out["reflection_issue"] = self.issue if self.alarm else None
        out["reflection_favoured"] = ", ".join(self.favoured) if self.alarm else None
        return out


@dataclass(frozen=True, eq=False)
class Directions:
    """In which directions of a policy's weights bias rises, as weights of the n services.

    Attributes:
        influence: of the services.
        groups: (identity, category) of each group.
        issues: names of the K issues.
        identities: names of the C identities.
        weights: of every service in every direction, [n, C + 1, K + 1]: the direction is the
            weighted sum of the services' ∇ log π.
    """

    influence: Influence
    groups: tuple[tuple[str, str], ...]
    issues: tuple[str, ...]
    identities: tuple[str, ...]
    weights: np.ndarray

    @classmethod
    def of(
        cls,
        influence: Influence,
        groups: Sequence[tuple[str, str]],
        issues: Sequence[str],
        tau: Sequence[float] | np.ndarray,
    ) -> Directions:
        """One direction for each identity and issue, and for all of them.

        Args:
            influence: of services, by their own counts and without shrinking. Pooled counts
                would let neighbouring updates share their directions, and updates that depend on
                each other raise more false alarms; shrunk ones leave directions missing.
            groups: (identity, category) of each group.
            issues: names of the issues.
            tau: weight of each issue.
        """
        names = [name for name, _ in groups]
        identities = tuple(dict.fromkeys(names))
        parts = [
            influence.over([g for g, other in enumerate(names) if other == identity])
            for identity in identities
        ]
        each = np.stack([*parts, influence.issue], axis=1)
        total = (each @ np.asarray(tau, float))[..., None]
        weights = np.concatenate([each, total], axis=2)
        return cls(influence, tuple(groups), tuple(issues), identities, weights)

    @property
    def flat(self) -> np.ndarray:
        """The weights with all directions in one row, [n, (C + 1) (K + 1)]."""
        return self.weights.reshape(len(self.weights), -1)


def conclude(
    directions: Directions,
    along: np.ndarray,
    lengths: np.ndarray,
    step: float,
    past: Past,
    settings: ReflectionSettings,
) -> tuple[Reflection, Past]:
    """What an update was, from its products with the gradients.

    Args:
        directions: in which bias rises.
        along: <step, ∇ log π(service)> of each service, by the policy before the update, [n].
        lengths: of the directions, in the order of ``directions.flat``.
        step: length of the step that the weights took.
        past: of the earlier updates.
        settings: when an update is abnormal.

    Returns:
        What was found, and the past of the next update.
    """
    shape = directions.weights.shape[1:]
    projection = np.tensordot(directions.weights, along, axes=(0, 0))
    product = np.reshape(lengths, shape) * step
    present = product > 0
    cosine = np.where(present, projection / np.where(present, product, 1.0), np.nan)
    cosine = np.clip(cosine, -1.0, 1.0)
    p_value, where = surprise(past.known[:, :-1, :-1], cosine[:-1, :-1])
    identity = issue = None
    favoured: tuple[str, ...] = ()
    if where is not None:
        c, k = where
        identity, issue = directions.identities[c], directions.issues[k]
        change = np.tensordot(directions.influence.gap[:, :, k], along, axes=(0, 0))
        order = [int(g) for g in np.argsort(change) if change[g] < 0]
        mine = [directions.groups[g] for g in order]
        favoured = tuple(group for name, group in mine if name == identity)
    reflection = Reflection(
        identities=directions.identities,
        issues=directions.issues,
        cosine=cosine,
        projection=np.where(present, projection, np.nan),
        z=standardise(cosine, past.known),
        p_value=p_value,
        alarm=where is not None and p_value <= settings.rate,
        identity=identity,
        issue=issue,
        favoured=favoured,
    )
    cosines = np.concatenate([past.cosines[1:], cosine[None]])
    return reflection, Past(cosines, min(past.filled + 1, len(cosines)))


def standardise(cosines: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Cosines in standard deviations above the mean of others, NaN left out.

    Args:
        cosines: [..., C, K].
        by: those that give mean and standard deviation, [m, C, K].

    Returns:
        The shape of ``cosines``; NaN where fewer than two others are known or all are alike.
    """
    known = ~np.isnan(by)
    n = known.sum(axis=0)
    mean = np.where(known, by, 0.0).sum(axis=0) / np.maximum(n, 1)
    square = np.where(known, (by - mean) ** 2, 0.0).sum(axis=0)
    spread = np.sqrt(square / np.maximum(n - 1, 1))
    usable = spread > 1e-6  # cosines come in single precision
    return np.where(usable, (cosines - mean) / np.where(usable, spread, 1.0), np.nan)


def surprise(past: np.ndarray, now: np.ndarray) -> tuple[float, tuple[int, int] | None]:
    """How rare an update is among the earlier ones and itself, where it raises bias.

    Args:
        past: cosines of earlier updates, [m, C, K].
        now: of this one, [C, K].

    Returns:
        The p-value, a multiple of 1/(m + 1); and where this update is most extreme, None and 1
        when it raises bias nowhere, or nothing is known.
    """
    together = np.concatenate([past, now[None]])
    z = standardise(together, together)
    score = np.where((together > 0) & ~np.isnan(z), z, -np.inf)
    largest = score.max(axis=(1, 2))
    p = float((largest >= largest[-1]).mean())
    if not np.isfinite(largest[-1]):
        return p, None
    c, k = np.unravel_index(score[-1].argmax(), now.shape)
    return p, (int(c), int(k))
