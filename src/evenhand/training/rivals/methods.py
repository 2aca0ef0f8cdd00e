"""The rivals: published ways to learn evenness, in one form that training calls.

A rival is its settings. After every epoch it turns what happened and what it remembers into the
advantages that the update uses:

    rival = rivals.rival("elbert", alpha=3.0)
    state = rival.begin(groups=22, n_issues=4)
    advantage, state = rival.shape(outcome, state)      # after every epoch

The critic goes on learning service quality. What is given and what is kept is in `rival_epoch`;
the formulas, with their sources, are in `rival_formulas`. Unawareness, which changes what the robot
sees instead, is `rival_formulas.unaware`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods.paper.scores import count
from evenhand.training.rivals import formulas
from evenhand.training.rivals.base import EpochOutcome, Past, Rival


def _within(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError(f"{name} is {value}: give a number from {least:g} to {most:g}")


_MOST = 1e6


@dataclass(frozen=True)
class LagrangianState:
    """What PPO-Lagrangian remembers.

    Attributes:
        lam: λ, a scalar array.
    """

    lam: np.ndarray


@dataclass(frozen=True)
class Lagrangian:
    """PPO-Lagrangian: service quality subject to unevenness <= ``limit``."""

    limit: float = 0.2
    """d, the total issue score that is allowed."""

    rate: float = 0.1
    """η, step size of λ."""

    start: float = 0.0
    """λ at the beginning."""

    def __post_init__(self) -> None:
        for name in ("limit", "rate", "start"):
            _within(name, getattr(self, name), 0.0, _MOST)

    def begin(self, groups: int, n_issues: int) -> LagrangianState:
        """λ at the beginning."""
        return LagrangianState(np.asarray(self.start, float))

    def shape(
        self, outcome: EpochOutcome, state: LagrangianState
    ) -> tuple[np.ndarray, LagrangianState]:
        """First λ takes its step, then the advantages are mixed with it."""
        lam = formulas.multiplier(float(state.lam), outcome.score, self.limit, self.rate)
        advantage = formulas.lagrangian_advantage(
            outcome.advantage, outcome.mask, outcome.cost, lam
        )
        return advantage, LagrangianState(np.asarray(lam, float))


@dataclass(frozen=True)
class APPO:
    """A-PPO: advantages are lowered where unevenness is beyond ``omega``, and where it grows."""

    beta: tuple[float, float, float] = (1.0, 0.25, 0.25)
    """Weights of the advantage, of unevenness beyond omega, and of its growth there."""

    omega: float = 0.1
    """Total issue score that is allowed."""

    windows: int = 8
    """Epochs that the running score is pooled over, the running one included."""

    def __post_init__(self) -> None:
        if len(self.beta) != 3:
            raise InputError(f"beta is {self.beta}: give three numbers of at least 0")
        for value in self.beta:
            _within("beta", value, 0.0, _MOST)
        _within("omega", self.omega, 0.0, _MOST)
        whole("windows", self.windows, 1, 1000)

    def begin(self, groups: int, n_issues: int) -> Past:
        """No epoch yet."""
        return Past.none(self.windows, groups, n_issues)

    def shape(self, outcome: EpochOutcome, state: Past) -> tuple[np.ndarray, Past]:
        """All decisions of a service answer for the score after it, and for its change."""
        score = formulas.running_scores(outcome.x, outcome.inside, state.pooled)
        advantage = formulas.a_ppo_advantage(
            outcome.advantage, outcome.mask, score, self.omega, self.beta
        )
        now = count(outcome.x, outcome.inside)
        return advantage, state.after(now, len(outcome.x))


@dataclass(frozen=True)
class RPPO:
    """R-PPO: the running total issue score is a penalty on the reward of each service."""

    zeta: float = 1.0
    """Weight of the penalty."""

    omega: float = 0.0
    """A total issue score below this costs nothing."""

    windows: int = 8
    """Epochs that the running score is pooled over, the running one included."""

    def __post_init__(self) -> None:
        for name in ("zeta", "omega"):
            _within(name, getattr(self, name), 0.0, _MOST)
        whole("windows", self.windows, 1, 1000)

    def begin(self, groups: int, n_issues: int) -> Past:
        """No epoch yet."""
        return Past.none(self.windows, groups, n_issues)

    def shape(self, outcome: EpochOutcome, state: Past) -> tuple[np.ndarray, Past]:
        """The penalty of a service lowers the advantages of all its decisions."""
        score = formulas.running_scores(outcome.x, outcome.inside, state.pooled)
        penalty = formulas.r_ppo_penalty(score, self.omega, self.zeta)
        now = count(outcome.x, outcome.inside)
        advantage = formulas.per_service(outcome.advantage, outcome.mask, penalty)
        return advantage, state.after(now, len(outcome.x))


@dataclass(frozen=True)
class ElbertState(Past):
    """What ELBERT-PO remembers, beside the last epochs.

    Attributes:
        ratio: last known z of each group, [G, K].
        known: 1 where z was ever known, [G, K].
    """

    ratio: np.ndarray
    known: np.ndarray


@dataclass(frozen=True)
class Elbert:
    """ELBERT-PO: service quality minus ``alpha`` times the squared gaps between benefit rates."""

    alpha: float = 1.0
    """Weight of the squared gaps, summed over identities and issues."""

    sharpness: float = 20.0
    """How nearly soft max and min are max and min, for more than two groups."""

    windows: int = 8
    """Epochs that rates are pooled over, the running one included."""

    def __post_init__(self) -> None:
        _within("alpha", self.alpha, 0.0, _MOST)
        _within("sharpness", self.sharpness, 1e-3, _MOST)
        whole("windows", self.windows, 1, 1000)

    def begin(self, groups: int, n_issues: int) -> ElbertState:
        """No epoch and no rate yet."""
        past = Past.none(self.windows, groups, n_issues)
        nothing = np.zeros((groups, n_issues))
        return ElbertState(past.counts, past.services, nothing, nothing)

    def shape(self, outcome: EpochOutcome, state: ElbertState) -> tuple[np.ndarray, ElbertState]:
        """A group without demand in the pooled epochs keeps the last rate that it had.

        One that never had any is left out.
        """
        now = count(outcome.x, outcome.inside)
        pooled = state.pooled + now
        n = len(outcome.x)
        demanded = pooled.inside_n > 0
        rate = pooled.inside_x / np.maximum(pooled.inside_n, 1.0)
        ratio = np.where(demanded, rate, state.ratio)
        known = demanded | (state.known > 0)
        slope = formulas.ratio_slope(ratio, known, outcome.identity, self.sharpness)
        demand = pooled.inside_n / (state.services.sum() + n)
        credit = formulas.elbert_credit(outcome.x, outcome.inside, ratio, demand, slope)
        advantage = formulas.per_service(outcome.advantage, outcome.mask, -self.alpha * credit)
        later = state.after(now, n)
        return advantage, ElbertState(later.counts, later.services, ratio, known.astype(float))


@dataclass(frozen=True)
class GroupDROState:
    """What group DRO remembers.

    Attributes:
        log_q: log of each group's share, [G].
        mean: last known mean reward of each group, [G]; 0 if none.
        seen: services of each group so far, [G].
    """

    log_q: np.ndarray
    mean: np.ndarray
    seen: np.ndarray


@dataclass(frozen=True)
class GroupDRO:
    """Group DRO: an adversary moves weight to the groups that are served worst."""

    rate: float = 0.1
    """η, step size of the adversary."""

    adjustment: float = 0.0
    """C: a small group counts as worse off by C / √n, with n its services in the run so far."""

    def __post_init__(self) -> None:
        for name in ("rate", "adjustment"):
            _within(name, getattr(self, name), 0.0, _MOST)

    def begin(self, groups: int, n_issues: int) -> GroupDROState:
        """All groups weigh the same."""
        nothing = np.zeros(groups)
        return GroupDROState(np.full(groups, -np.log(groups)), nothing, nothing)

    def shape(
        self, outcome: EpochOutcome, state: GroupDROState
    ) -> tuple[np.ndarray, GroupDROState]:
        """First the adversary takes its step, then services weigh by their groups.

        A group that nobody belonged to in this epoch keeps its last mean.
        """
        now, n = formulas.group_means(outcome.reward, outcome.inside)
        mean = np.where(n > 0, now, state.mean)
        seen = state.seen + n
        log_q = formulas.dro_step(state.log_q, -mean, seen, self.rate, self.adjustment)
        weight = formulas.service_weights(np.exp(log_q), outcome.inside)
        return _weighted(outcome, weight), GroupDROState(log_q, mean, seen)


@dataclass(frozen=True)
class GGFState:
    """What GGF remembers.

    Attributes:
        mean: smoothed mean reward of each group, [G]; 0 if none.
        seen: 1 for groups that were served so far, [G].
    """

    mean: np.ndarray
    seen: np.ndarray


@dataclass(frozen=True)
class GGF:
    """GGF: the generalised Gini welfare of the groups, in which the worst-off weigh most."""

    decay: float = 0.5
    """Weight of each group relative to the next worse one; 1 weighs all alike."""

    memory: float = 0.75
    """Share of the earlier estimate in the mean reward by which groups are ranked: one epoch has
    few services of a group. The source ranks by its critic, which remembers too."""

    def __post_init__(self) -> None:
        _within("decay", self.decay, 1e-3, 1.0)
        _within("memory", self.memory, 0.0, 1.0)

    def begin(self, groups: int, n_issues: int) -> GGFState:
        """No group was served yet."""
        return GGFState(np.zeros(groups), np.zeros(groups))

    def shape(self, outcome: EpochOutcome, state: GGFState) -> tuple[np.ndarray, GGFState]:
        """A group that nobody belonged to in this epoch keeps its last mean."""
        now, n = formulas.group_means(outcome.reward, outcome.inside)
        before = np.where(state.seen > 0, state.mean, now)
        mean = np.where(n > 0, self.memory * before + (1.0 - self.memory) * now, state.mean)
        seen = ((state.seen > 0) | (n > 0)).astype(float)
        group_weight = formulas.gini_weights(mean, seen > 0, self.decay)
        weight = formulas.service_weights(group_weight, outcome.inside)
        return _weighted(outcome, weight), GGFState(mean, seen)


def _weighted(outcome: EpochOutcome, weight: np.ndarray) -> np.ndarray:
    return np.where(outcome.mask > 0, weight[:, None] * outcome.advantage, 0.0)


RIVALS: Mapping[str, type[Rival[Any]]] = {
    "lagrangian": Lagrangian,
    "a_ppo": APPO,
    "r_ppo": RPPO,
    "elbert": Elbert,
    "group_dro": GroupDRO,
    "ggf": GGF,
}
"""The rivals by name."""


def rival(name: str, **settings: Any) -> Rival[Any]:
    """A rival by its name.

    Args:
        name: one of `RIVALS`.
        settings: of that rival; its defaults for what is not given.

    Raises:
        InputError: for a name or a setting that does not exist, or a value out of range.
    """
    if name not in RIVALS:
        raise unknown("rival", name, RIVALS)
    kind: Any = RIVALS[name]
    names = [field.name for field in fields(kind)]
    for given in settings:
        if given not in names:
            raise unknown(f"setting of {name}", given, names)
    return kind(**settings)


STRENGTH: Mapping[str, str] = {
    "lagrangian": "limit",
    "a_ppo": "beta",
    "r_ppo": "zeta",
    "elbert": "alpha",
    "group_dro": "rate",
    "ggf": "decay",
}
"""The setting of each rival that trades evenness for service; for A-PPO, both of its weights."""


def strong(name: str, strength: float | None) -> Rival[Any]:
    """A rival by its name and its main setting.

    Raises:
        InputError: for a rival that does not exist, or a strength out of its range.
    """
    if strength is None or name not in STRENGTH:
        return rival(name)
    value: Any = (1.0, strength, strength) if name == "a_ppo" else strength
    return rival(name, **{STRENGTH[name]: value})
