"""What the wrappers share: who is served, the facts function, and the ledger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evenhand.adapters.episodes import Ended, FactsOf, Info
from evenhand.adapters.guidance import JudgeSettings
from evenhand.adapters.ledger import Ledger, Windows
from evenhand.adapters.sampler import Queue, Sampler
from evenhand.core.errors import InputError
from evenhand.methods.paper.detector import Detector
from evenhand.methods.scheme import Scheme
from evenhand.methods.services import Services


class Judging:
    """The way of ended episodes into a ledger."""

    def __init__(
        self,
        lanes: int,
        scheme: Scheme,
        facts: FactsOf,
        sampler: Sampler | None,
        rng: np.random.Generator | None,
        settings: JudgeSettings | None,
        detector: Detector | None,
    ) -> None:
        """Begin with an empty ledger.

        Args:
            lanes: environments, n.
            scheme: identities, facts and issues.
            facts: tells the facts of ended episodes.
            sampler: who is served; None where the facts tell.
            rng: source of randomness of the sampler.
            settings: of windows and guidance.
            detector: judges windows.

        Raises:
            InputError: for a sampler without ``rng``, or what does not fit the scheme.
        """
        if (sampler is None) != (rng is None):
            has, lacks = ("sampler", "rng") if rng is None else ("rng", "sampler")
            raise InputError(
                f"missing {lacks}", f"{has} is given without {lacks}: to draw people, give both"
            )
        self.ledger = Ledger(scheme, settings, detector)
        self.queue = None
        if sampler is not None and rng is not None:
            self.queue = Queue(sampler, rng, lanes, scheme)
        self._facts = facts

    def write(
        self,
        lane: np.ndarray,
        rank: np.ndarray,
        reward: np.ndarray,
        steps: np.ndarray,
        terminated: np.ndarray,
        truncated: np.ndarray,
        observation: Any,
        raw: Sequence[tuple[Info, Info, int]],
        *,
        afterwards: bool = False,
        later: bool = False,
    ) -> np.ndarray:
        """Ask for the facts of episodes that have ended, and write them into the ledger.

        Arguments are the fields of ``Ended`` and ``track.Cut``, and ``Ledger.add`` 's own.

        Returns:
            What evenness adds to their rewards, [m].

        Raises:
            InputError: for facts that make no sense; these episodes are then left out.
        """
        ended = Ended(
            episode=len(self.ledger) + np.arange(len(lane)),
            lane=lane,
            reward=reward,
            steps=steps,
            terminated=terminated,
            truncated=truncated,
            observation=observation,
            people=None if self.queue is None else self.queue.serve(lane, rank),
            raw=raw,
        )
        return self.ledger.add(ended, self._facts(ended), afterwards=afterwards, later=later)

    def state(self) -> dict[str, np.ndarray]:
        """Services, what the method remembers, and who is served next, as arrays by name."""
        return self.ledger.state() | ({} if self.queue is None else self.queue.state())

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where another one stood.

        Raises:
            InputError: when it was of another scheme, method, settings or version.
        """
        if self.queue is not None:
            self.queue.restore(state)
        self.ledger.restore(state)


class Judged:
    """What a wrapper tells: services, windows, people. Asking writes down what still waits."""

    _judging: Judging

    def write(self) -> None:
        """Ask for the facts of the episodes that wait.

        Raises:
            InputError: for facts that make no sense.
        """
        raise NotImplementedError

    @property
    def ledger(self) -> Ledger:
        """All services that have ended, with verdicts, rows and what was paid."""
        self.write()
        return self._judging.ledger

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint of guided training needs, as arrays by name, for ``np.savez``.

        Services that have ended, what the method remembers, and who is served next. Episodes that
        are under way are not in it: take it between episodes, or pickle wrapper and environment.
        """
        self.write()
        return self._judging.state()

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where another wrapper of the same settings stood; then reset.

        Args:
            state: what its `state` gave; an opened ``.npz`` file will do.

        Raises:
            InputError: when it was of another scheme, method, settings or version.
        """
        self._judging.restore(state)

    @property
    def services(self) -> Services:
        """All services that have ended, in that order."""
        return self.ledger.services()

    @property
    def windows(self) -> Windows:
        """Windows that are over, judged."""
        return self.ledger.windows()
