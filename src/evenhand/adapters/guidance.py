"""Guidance while services go on: what evenness adds to the reward of one that has just ended.

In training, an epoch is scored when it is over, and its own services are paid by that (Eq. 4). A
wrapper has to pay at once, before the window is over. So the gaps of the windows before steer:
Eq. 4 and 5 pay by the last window, influence and level-up by the last ``windows`` pooled. What is
paid for an issue is known at once, since the issue is; only the gaps are as old as a window.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods import guidance
from evenhand.methods.beyond import guard, levelup
from evenhand.methods.beyond.levelup import CreditSettings, Memory
from evenhand.methods.guidance import GuidanceSettings
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import Counts, Scores, count, scores_of
from evenhand.methods.scheme import Scheme

_GUARD = guard.GuardSettings()


def _none() -> GuidanceSettings:
    return GuidanceSettings("none")


@dataclass(frozen=True)
class JudgeSettings:
    """How services are judged, and what evenness is worth.

    Attributes:
        services: in a window.
        guidance: what evenness adds to rewards; nothing by default.
        tau: weight of each issue by its name. By default those of ``guidance`` where there are
            four issues, and 1 each where there is another number.
        evenness_weight: greatest reward of Eq. 4; the other kinds have a strength of their own.
    """

    services: int = 30
    guidance: GuidanceSettings = field(default_factory=_none)
    tau: Mapping[str, float] | None = None
    evenness_weight: float = 1.0

    def __post_init__(self) -> None:
        whole("services", self.services, 2, 1_000_000)
        if self.guidance.kind == "surgery":
            raise InputError(
                "guidance 'surgery' works on the gradients of a learner, which no wrapper sees: "
                "choose one of none, score, penalty, influence, levelup"
            )
        if not 0.0 <= self.evenness_weight < np.inf:
            raise InputError(f"evenness_weight is {self.evenness_weight}: give 0 or more")

    def weights(self, scheme: Scheme) -> np.ndarray:
        """Weight of each issue of a scheme, [K].

        Raises:
            InputError: for weights that do not fit its issues.
        """
        names = scheme.issue_names
        if self.tau is not None:
            for name in (*self.tau, *names):
                if name not in names:
                    raise unknown("issue in tau", name, names)
                if name not in self.tau:
                    raise InputError(f"tau has no weight for issue {name!r}: give one for each")
            return guidance.check_tau([self.tau[name] for name in names], len(names))
        if len(names) == len(self.guidance.tau):
            return guidance.check_tau(self.guidance.tau, len(names))
        if self.guidance.tau != guidance.TAU["equal"]:
            raise InputError(
                f"guidance.tau weighs four issues, and there are {len(names)}: give tau by name"
            )
        return np.ones(len(names))


def asked_about(detector: Detector, scheme: Scheme) -> tuple[str, ...]:
    """Identities that a detector is asked about: those of the scheme that it was taught.

    Each identity more would raise the false alarms.

    Raises:
        InputError: when it judges other issues, or knows none of the identities.
    """
    if detector.issues != scheme.issue_names:
        raise InputError(
            f"the detector judges {', '.join(detector.issues)}, and the scheme has "
            f"{', '.join(scheme.issue_names)}: fit a detector to judgements of these issues"
        )
    known = tuple(name for name in scheme.names if name in detector.identities)
    if not known:
        raise InputError(
            f"the detector was taught with {', '.join(detector.identities)}, and the scheme has "
            f"{', '.join(scheme.names)}: fit a detector to judgements of these identities"
        )
    return known


def judged(detector: Detector, scores: Scores, known: tuple[str, ...]) -> np.ndarray:
    """Probability that people would call windows biased, for each identity, [..., C].

    Args:
        detector: that judges.
        scores: of a window or of many.
        known: identities to ask about.
    """
    return detector.probability(np.stack([scores.by_identity[name] for name in known], axis=-2))


@dataclass(frozen=True)
class Past:
    """What the windows before leave behind.

    Attributes:
        memory: counts of the last windows.
        guard: whether service became worse for a group; its last group is everybody.
        scores: of the last window; None before any.
        biased: what the detector says of it.
    """

    memory: Memory
    guard: guard.Guard
    scores: Scores | None = None
    biased: bool = False


class Guide:
    """Pays services by what is known when they end."""

    def __init__(self, scheme: Scheme, settings: JudgeSettings, detector: Detector | None) -> None:
        """Begin with no past.

        Args:
            scheme: what is compared.
            settings: what evenness is worth.
            detector: judges windows; a must where the guidance asks for its verdict.

        Raises:
            InputError: for weights or a detector that do not fit.
        """
        chosen = settings.guidance
        service = chosen.kind in guidance.SERVICE_KINDS
        if detector is None and (chosen.kind == "penalty" or (service and chosen.when == "biased")):
            wants = "penalty" if chosen.kind == "penalty" else "when='biased'"
            raise InputError(f"guidance with {wants} asks for a verdict: give a detector")
        self._known = asked_about(detector, scheme) if detector is not None else ()
        self._scheme, self._settings, self._detector = scheme, settings, detector
        self._tau = settings.weights(scheme)
        groups, issues = len(scheme.groups), len(scheme.issues)
        self.past = Past(
            Memory.empty(chosen.weigh.windows, groups, issues),
            guard.Guard.new(groups + 1, 1, _GUARD),
        )

    def pays(self, x: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """What evenness adds to the reward of services that have just ended, [m].

        Args:
            x: indicators, [m, K].
            inside: membership, [m, G].
        """
        chosen, past = self._settings.guidance, self.past
        if past.scores is None or chosen.kind == "none":
            return np.zeros(len(x))
        if chosen.kind in ("score", "penalty"):
            paid = guidance.person_rewards(past.scores, inside, past.biased, chosen, self._tau)
            return self._settings.evenness_weight * paid / self._tau.sum()
        if chosen.when == "biased" and not past.biased:
            return np.zeros(len(x))
        share = guard.weight(past.guard) if chosen.guarded else 1.0
        weigh = replace(chosen.weigh, strength=chosen.weigh.strength * share)
        return reward_ahead(
            chosen.kind, x, inside, self._tau, past.memory, self._settings.services, weigh
        )

    def close(self, x: np.ndarray, inside: np.ndarray) -> None:
        """Remember a window that is over.

        Args:
            x: indicators of its services, [n, K].
            inside: membership, [n, G].
        """
        counts = count(x, inside)
        scores = scores_of(counts, self._scheme.groups, self._scheme.issue_names)
        biased = False
        if self._detector is not None:
            probability = judged(self._detector, scores, self._known)
            biased = bool((probability > self._detector.threshold).any())
        imperfect = (x == 1.0).any(axis=1, keepdims=True).astype(float)
        everybody = np.concatenate([inside, np.ones((len(x), 1))], axis=1)
        watched, _ = guard.watch(self.past.guard, count(imperfect, everybody), _GUARD)
        memory = levelup.remember(self.past.memory, counts)
        self.past = Past(memory, watched, scores, biased)


def reward_ahead(
    kind: str,
    x: np.ndarray,
    inside: np.ndarray,
    tau: np.ndarray,
    past: Memory,
    services: int,
    settings: CreditSettings,
) -> np.ndarray:
    """Influence or level-up of services whose window is not over yet, [m].

    As ``credit.influence_reward`` and ``credit.levelup_reward``, with gaps and rates of the
    windows before. How many services of each side the current window will have is not known, so
    their mean over these windows stands in. A service does not move the gaps that it is paid by.

    Args:
        kind: influence or levelup.
        x: indicators, [m, K].
        inside: membership, [m, G].
        tau: weight of each issue, [K].
        past: counts of the windows before; without any, nothing is paid.
        services: of a window.
        settings: strength, shrinking, objective.
    """
    if not past.filled:
        return np.zeros(len(x))
    counts = levelup.pooled(past)
    if kind == "levelup":
        return levelup.levelup_pays(x, inside, tau, counts, settings)
    mean = Counts(*np.moveaxis(past.windows.sum(axis=0) / past.filled, -1, 0))
    return levelup.influence_pays(x, inside, tau, counts, mean, services, settings)
