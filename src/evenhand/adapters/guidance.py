"""Guidance while services go on: what a method adds to the reward of one that has just ended.

In training, an epoch is scored when it is over, and its own services are paid by that. A wrapper
has to pay at once, before the window is over. A method that can (``pay``) is asked with the windows
before, whose gaps steer: what is paid for an issue is known at once, since the issue is; only the
gaps are as old as a window. Every other method is taught the last services, this one included, each
as one decision whose advantage is its return; what it makes of the advantage of this one is added.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evenhand.core import tree
from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods import guidance, registry
from evenhand.methods.epoch import Epoch, judge_of
from evenhand.methods.guard import GUARD, Guard, Held, Watch
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.rewards import check_tau
from evenhand.methods.paper.scores import Counts, Scores
from evenhand.methods.scheme import Scheme
from evenhand.statistics import chance

_REFUSED = {
    registry.DIRECTION: "works on the gradients of a learner, which no wrapper sees",
    registry.PREPROCESSING: "changes what the policy sees, and no wrapper knows how identity shows",
    registry.BLINDNESS: "hides people from the policy, and no wrapper knows where an environment "
    "shows them",
}


@dataclass(frozen=True)
class JudgeSettings:
    """How services are judged, and what evenness is worth.

    Attributes:
        services: in a window.
        method: what evenness adds to rewards: NAME, NAME@STRENGTH or an object, see
            ``methods.registry``; nothing by default.
        tau: weight of each issue by its name; 1 each by default.
    """

    services: int = 30
    method: Any = "service"
    tau: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        whole("services", self.services, 2, 1_000_000)
        object.__setattr__(self, "method", registry.as_method(self.method))
        for need, why in _REFUSED.items():
            if need in registry.needs_of(self.method):
                name = registry.name_of(self.method)
                raise InputError(
                    "unsupported method", f"method {name!r} {why}: choose another, such as levelup"
                )

    def weights(self, scheme: Scheme) -> np.ndarray:
        """Weight of each issue of a scheme, [K].

        Raises:
            InputError: for weights that do not fit its issues.
        """
        names = scheme.issue_names
        if self.tau is None:
            return np.ones(len(names))
        for name in (*self.tau, *names):
            if name not in names:
                raise unknown("issue in tau", name, names, "tau")
            if name not in self.tau:
                raise InputError(
                    "missing tau", f"tau has no weight for issue {name!r}: give one for each"
                )
        return check_tau([self.tau[name] for name in names], len(names))


def asked_about(detector: Detector, scheme: Scheme) -> tuple[str, ...]:
    """Identities that a detector is asked about: those of the scheme that it was taught.

    Each identity more would raise the false alarms.

    Raises:
        InputError: when it judges other issues, or knows none of the identities.
    """
    if detector.issues != scheme.issue_names:
        raise InputError(
            "conflict detector",
            f"the detector judges {', '.join(detector.issues)}, and the scheme has "
            f"{', '.join(scheme.issue_names)}: fit a detector to judgements of these issues",
        )
    known = tuple(name for name in scheme.names if name in detector.identities)
    if not known:
        raise InputError(
            "conflict detector",
            f"the detector was taught with {', '.join(detector.identities)}, and the scheme has "
            f"{', '.join(scheme.names)}: fit a detector to judgements of these identities",
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
        memory: of the method.
        guard: whether service became worse for a group; its last group is everybody.
        windows: that are over.
    """

    memory: Any
    guard: Guard
    windows: int = 0


class Guide:
    """A method beside a learner that is not ours."""

    def __init__(self, scheme: Scheme, settings: JudgeSettings, detector: Detector | None) -> None:
        """Begin with no past.

        Args:
            scheme: what is compared.
            settings: what evenness is worth.
            detector: judges windows; a must where the method asks for its verdict.

        Raises:
            InputError: for weights or a detector that do not fit.
        """
        self.method = settings.method
        if detector is None and registry.VERDICT in registry.needs_of(self.method):
            name = registry.name_of(self.method)
            raise InputError(
                "missing detector", f"method {name!r} asks for a verdict: give a detector"
            )
        known = asked_about(detector, scheme) if detector is not None else ()
        self._judge = judge_of(detector, known) if detector is not None else None
        self._scheme, self._size = scheme, settings.services
        self._tau = settings.weights(scheme)
        groups = len(scheme.groups)
        self.past = Past(guidance.begin(self.method, scheme), Guard.new(groups + 1, 1, GUARD))
        self._window: Epoch | None = None

    @property
    def looks_ahead(self) -> bool:
        """Whether the method itself pays before a window is over."""
        return hasattr(self.method, "pay")

    def epoch(
        self,
        x: np.ndarray,
        inside: np.ndarray,
        reward: np.ndarray,
        mask: np.ndarray | None = None,
        advantage: np.ndarray | None = None,
    ) -> tuple[Epoch, Watch]:
        """Services as an epoch, and what becomes of the guard.

        Args:
            x: indicators, [n, K].
            inside: membership, [n, G].
            reward: what each earned, [n].
            mask: 1 for decisions that happened, [n, L]; by default each service is one decision.
            advantage: of the decisions, [n, L]; by default the return of the service.
        """
        happened = np.ones((len(x), 1)) if mask is None else mask
        watch = Watch(self.past.guard, x, inside)

        def advantages_of(rewards: np.ndarray) -> np.ndarray:
            if advantage is None:
                return np.asarray(rewards, float)[:, None]
            return advantage + np.where(happened, (rewards - reward)[:, None], 0.0)

        found = Epoch(
            x=x,
            inside=inside,
            reward=np.asarray(reward, float),
            mask=happened,
            groups=self._scheme.groups,
            issues=self._scheme.issue_names,
            tau=self._tau,
            advantages_of=advantages_of,
            corrected_of=self._corrected,
            judge=self._judge,
            guard=watch,
            number=self.past.windows,
        )
        return found, watch

    def pays(self, x: np.ndarray, inside: np.ndarray, reward: np.ndarray, last: int) -> np.ndarray:
        """What evenness adds to the reward of services that have just ended, [last].

        Args:
            x: indicators of these, and of at most a window's services before them, [n, K].
            inside: membership, [n, G].
            reward: what each earned, [n].
            last: how many have just ended.
        """
        if self._window is None:
            return np.zeros(last)
        if not self.looks_ahead:
            given, _ = guidance.teach(
                self.method, self.epoch(x, inside, reward)[0], self.past.memory
            )
            return self._added(given, np.asarray(reward, float))[-last:]
        ended, _ = self.epoch(x[-last:], inside[-last:], reward[-last:])
        held = replace(ended, guard=Held(self.past.guard))
        return self.method.pay(held, self._window, self.past.memory)

    def close(self, x: np.ndarray, inside: np.ndarray, reward: np.ndarray) -> None:
        """Remember a window that is over.

        Args:
            x: indicators of its services, [n, K].
            inside: membership, [n, G].
            reward: what each earned, [n].
        """
        self.teach(*self.epoch(x, inside, reward))

    def teach(self, epoch: Epoch, watch: Watch) -> guidance.Guidance:
        """Teach an epoch that is over, and remember it.

        Raises:
            InputError: as `methods.guidance.teach`, or for a second direction.
        """
        given, memory = guidance.teach(self.method, epoch, self.past.memory)
        if given.fair is not None:
            name = registry.name_of(self.method)
            raise InputError(
                "unsupported method",
                f"method {name!r} {_REFUSED[registry.DIRECTION]}: choose another",
            )
        self.past = Past(memory, watch.after, self.past.windows + 1)
        self._window = epoch
        return given

    def restore(
        self, saved: Mapping[str, np.ndarray], window: tuple[np.ndarray, ...] | None
    ) -> None:
        """Go on where another guide stood.

        Args:
            saved: leaves of its ``past``.
            window: x, inside and reward of the last window that was over; None before any.

        Raises:
            InputError: when it was of another method, or other settings.
        """
        want = tree.leaves(self.past, "past")
        if want.keys() != saved.keys() or any(
            want[name].shape != np.shape(value) for name, value in saved.items()
        ):
            raise InputError(
                "changed state",
                "what was saved is of another method or other settings: make the same ones",
            )
        past = tree.fill(self.past, saved, "past")
        if window is not None:
            self._window = self.epoch(*window)[0]
        self.past = past

    def _added(self, given: guidance.Guidance, reward: np.ndarray) -> np.ndarray:
        if given.advantages is not None:
            return given.advantages[:, 0] - reward
        return given.added(reward)

    def _corrected(self, counts: Counts) -> float:
        groups, names = self._scheme.groups, self._scheme.issue_names
        return float(chance.corrected_scores(counts, groups, names).total)
