"""What published methods share, as pure functions on arrays.

Shapes: n services (one person each) in the order in which they were served, L decisions at most a
service, G groups of any number of identities, K issues. `mask` [n, L] is 1 for decisions that
happened; what stands at masked places changes nothing, and results are 0 there. Membership
`inside` [n, G] is 1, 0 or NaN (unknown: counts in no group); indicators `x` [n, K] are 1, 0 or NaN
(the issue does not apply).

Every method hands an advantage to the same update, so it is given as a change of the advantage of
service quality: a weight a service, or a number added to all decisions of a service. Such a number
is on the scale of an advantage: if c [n] is added, the update climbs the objective whose gradient
is the mean over services of c ∇ log π(service). The critic goes on learning service quality.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.paper.scores import Counts, gaps, issue_score, total

MOST = 1e6
"""Greatest value of a setting."""


def within(name: str, value: float, least: float, most: float = MOST) -> None:
    """Check a setting.

    Raises:
        InputError: when it is not within its limits.
    """
    if not least <= value <= most:
        raise InputError(
            f"range {name}", f"{name} is {value}: give a number from {least:g} to {most:g}"
        )


@dataclass(frozen=True)
class Rival:
    """A published method, to which the guard is offered as it is to Evenhand's own.

    Subclasses give ``lesson``, advantages of the decisions [n, L] and the memory from now on; and
    ``value``, what each answer would have been worth, [n, A].
    """

    guarded: bool = field(default=False, kw_only=True)
    """Whether the method gives way to service alone while service is poor or becomes worse."""

    def teach(self, epoch: Epoch, memory: Any) -> tuple[np.ndarray, Any]:
        """Advantages of the decisions, and the memory from now on."""
        found, memory = self.lesson(epoch, memory)
        if self.guarded:
            found = epoch.advantage + epoch.guard_weight * (found - epoch.advantage)
        return found, memory

    def worth(self, answers: Answers, memory: Any) -> np.ndarray:
        """What each answer would have been worth, [n, A]."""
        found = self.value(answers, memory)
        if self.guarded:
            weight = answers.window.guard_weight
            found = answers.reward + weight * (found - answers.reward)
        return found

    def lesson(self, epoch: Epoch, memory: Any) -> tuple[np.ndarray, Any]:
        """What the method makes of an epoch."""
        raise NotImplementedError

    def value(self, answers: Answers, memory: Any) -> np.ndarray:
        """What the method makes of answers."""
        raise NotImplementedError


@dataclass(frozen=True)
class Past:
    """Counts of the last epochs.

    Attributes:
        counts: inside_n, inside_x, outside_n, outside_x of `scores.Counts`, [W, 4, G, K], oldest
            first; zeros for epochs that there were not.
        services: their numbers of services, [W].
    """

    counts: np.ndarray
    services: np.ndarray

    @property
    def pooled(self) -> Counts:
        """Counts of all of them."""
        return Counts(*self.counts.sum(axis=0))

    @property
    def kept(self) -> Counts:
        """Counts of those that are pooled with the next epoch: all but the oldest."""
        return Counts(*self.counts[1:].sum(axis=0))

    @property
    def before(self) -> Counts:
        """Counts of those that were pooled with the last epoch: all but the newest."""
        return Counts(*self.counts[:-1].sum(axis=0))

    def after(self, now: Counts, services: int) -> Past:
        """With the epoch that just ended in place of the oldest."""
        last = np.stack([now.inside_n, now.inside_x, now.outside_n, now.outside_x])
        return Past(
            np.concatenate([self.counts, last[None]])[1:],
            np.concatenate([self.services, [float(services)]])[1:],
        )

    @staticmethod
    def none(windows: int, groups: int, n_issues: int) -> Past:
        """No epoch yet.

        Args:
            windows: W, epochs that are pooled.
            groups: G.
            n_issues: K.
        """
        return Past(np.zeros((windows, 4, groups, n_issues)), np.zeros(windows))


def per_service(advantage: np.ndarray, mask: np.ndarray, added: np.ndarray) -> np.ndarray:
    """Advantages [n, L] with the number of each service, added [n], at all its decisions."""
    return np.where(mask > 0, advantage + added[:, None], 0.0)


def weighted(advantage: np.ndarray, mask: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Advantages [n, L] times the weight of each service, [n]."""
    return np.where(mask > 0, weight[:, None] * advantage, 0.0)


def running_scores(x: np.ndarray, inside: np.ndarray, earlier: Counts) -> np.ndarray:
    """Δ after every person: the total issue score (Eq. 2) of all services so far.

    Counts of the first t services are cumulative sums, so all scores come at once.

    Args:
        x: indicators, [n, K].
        inside: membership, [n, G].
        earlier: counts of the services before these, [G, K]; zeros for none.

    Returns:
        [n + 1], the first before anybody was served; 0 as long as nothing can be compared.
    """
    return _scored(Counts(*(np.cumsum(side, axis=0) for side in _sides(x, inside, earlier))))


def answer_scores(
    x: np.ndarray, answers: np.ndarray, inside: np.ndarray, earlier: Counts
) -> np.ndarray:
    """Δ after every person if this one service had ended otherwise.

    Args:
        x: indicators of the services as they were, [n, K].
        answers: the same with each answer, [n, A, K].
        inside: membership, [n, G].
        earlier: as for `running_scores`.

    Returns:
        [n, A].
    """
    sides = []
    before = [np.cumsum(side, axis=0)[:-1, None] for side in _sides(x, inside, earlier)]
    n, each, issues = answers.shape
    flat = answers.reshape(n * each, issues)
    others = _sides(flat, np.repeat(inside, each, axis=0), earlier)
    for so_far, own in zip(before, others, strict=True):
        sides.append(so_far + own[1:].reshape(n, each, *own.shape[1:]))
    return _scored(Counts(*sides))


def _sides(x: np.ndarray, inside: np.ndarray, earlier: Counts) -> list[np.ndarray]:
    """The four counts of earlier services, then of every service, [n + 1, G, K] each."""
    applies = (~np.isnan(x)).astype(float)[:, None, :]
    happened = np.nan_to_num(x)[:, None, :]
    is_in = np.nan_to_num(inside)[:, :, None]
    is_out = np.nan_to_num(1.0 - inside)[:, :, None]
    each = (is_in * applies, is_in * happened, is_out * applies, is_out * happened)
    before = (earlier.inside_n, earlier.inside_x, earlier.outside_n, earlier.outside_x)
    return [np.concatenate([b[None], e]) for b, e in zip(before, each, strict=True)]


def _scored(counts: Counts) -> np.ndarray:
    return np.nan_to_num(total(issue_score(gaps(counts))))


def group_means(reward: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J_g, the mean reward of each group, and how many services it had.

    Args:
        reward: [n].
        inside: membership, [n, G].

    Returns:
        Mean (0 for an empty group) and number, both [G].
    """
    belongs = np.nan_to_num(inside)
    n = belongs.sum(axis=0)
    return reward @ belongs / np.maximum(n, 1.0), n


def service_weights(group_weight: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Gradient of Σ_g w_g J_g as a weight of each advantage: n Σ_g w_g 1(i ∈ g) / n_g.

    Weights of the services have the mean Σ w over the groups that are not empty.

    Args:
        group_weight: w, [G].
        inside: membership, [n, G].

    Returns:
        [n]; 0 for a person in no group.
    """
    belongs = np.nan_to_num(inside)
    return len(belongs) * (belongs @ (group_weight / np.maximum(belongs.sum(axis=0), 1.0)))
