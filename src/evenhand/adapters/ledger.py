"""The ledger: services as they end, windows of them, their scores, and what evenness pays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.adapters.check_facts import checked
from evenhand.adapters.episodes import Ended
from evenhand.adapters.guidance import Guide, JudgeSettings, asked_about, judged
from evenhand.core import tree
from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import Counts, Scores, count, scores_of
from evenhand.methods.printed import Service
from evenhand.methods.scheme import Scheme
from evenhand.methods.services import Services
from evenhand.statistics import chance, verdicts
from evenhand.statistics.verdicts import Verdicts, VerdictSettings

_ROWS = ("codes", "facts", "reward", "paid")


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of services, one after the other.

    Attributes:
        services: in each.
        counts: [W, G, K].
        scores: Eq. 1 and 2 of each, as printed.
        excess: the same without what chance gives, see ``inference.chance.excess_scores``.
        probability: that people would call it biased, for each identity that the detector was
            taught, float64 [W, C]; None without a detector.
        biased: the detector's verdict on each, bool [W]; None without a detector.
        paid: what evenness added to the rewards of its services on average, float64 [W].
    """

    services: int
    counts: Counts
    scores: Scores
    excess: Scores
    probability: np.ndarray | None
    biased: np.ndarray | None
    paid: np.ndarray

    def __len__(self) -> int:
        return len(self.paid)


class Columns:
    """Facts of some services as columns, for rules."""

    def __init__(self, scheme: Scheme, values: np.ndarray) -> None:
        """Name the columns.

        Args:
            scheme: whose facts.
            values: float64 [n, F].
        """
        self._place = {fact.name: f for f, fact in enumerate(scheme.facts)}
        self._values = values

    def __contains__(self, name: str) -> bool:
        return name in self._place

    def fact(self, name: str) -> np.ndarray:
        """A fact, float64 [n], NaN where missing.

        Raises:
            InputError: when there is no such fact.
        """
        if name not in self._place:
            raise unknown("fact", name, self._place)
        return self._values[:, self._place[name]]


class Ledger:
    """Services in the order in which they ended. It knows nothing of environments."""

    def __init__(
        self,
        scheme: Scheme,
        settings: JudgeSettings | None = None,
        detector: Detector | None = None,
    ) -> None:
        """Begin an empty ledger.

        Args:
            scheme: identities, facts and issues.
            settings: of windows and guidance.
            detector: judges windows; may be left out unless the guidance asks for it.

        Raises:
            InputError: for a detector or weights that do not fit the scheme.
        """
        self.scheme, self.settings = scheme, settings or JudgeSettings()
        self.detector = detector
        self._known = asked_about(detector, scheme) if detector is not None else ()
        self.guide = Guide(scheme, self.settings, detector)
        self.guided = not isinstance(self.settings.method, Service)
        self._codes = np.empty((64, len(scheme.identities)), np.int64)
        self._facts = np.empty((64, len(scheme.facts)))
        self._reward = np.zeros(64)
        self._paid = np.zeros(64)
        self._length = 0
        self._found: Windows | None = None

    def __len__(self) -> int:
        return self._length

    def add(
        self, ended: Ended, told: Any, *, afterwards: bool = False, later: bool = False
    ) -> np.ndarray:
        """Write services down.

        Args:
            ended: the episodes.
            told: what the facts function gave for them.
            afterwards: pay when all of these have ended, so that those of a window that is over
                are paid by that window itself; else each is paid by the windows before its own.
            later: pay nothing; the caller teaches the method, and notes it by `pay`.

        Returns:
            What evenness adds to the reward of each, [m].

        Raises:
            InputError: for facts that make no sense; nothing is written then.
        """
        codes, facts = checked(self.scheme, ended, told)
        self._make_room(len(codes))
        paid = np.zeros(len(codes))
        guided, begin = self.guided and not later, 0
        while begin < len(codes):
            # the window that is open takes what it lacks; the next one is paid by it
            left = self.settings.services - self._length % self.settings.services
            part = slice(begin, begin + left)
            n = len(codes[part])
            to = slice(self._length, self._length + n)
            self._codes[to], self._facts[to] = codes[part], facts[part]
            self._reward[to] = ended.reward[part]
            full = slice(to.stop - self.settings.services, to.stop) if n == left else None
            if guided and full and afterwards:
                self.guide.close(*self._earned(full))
            if guided:
                first = to.start if self.guide.looks_ahead else to.stop - self.settings.services
                seen = slice(max(0, min(first, to.start)), to.stop)
                paid[part] = self.guide.pays(*self._earned(seen), n)
            self._paid[to] = paid[part]
            self._length += n
            begin += n
            if guided and full and not afterwards:
                self.guide.close(*self._earned(full))
        return paid

    def pay(self, paid: np.ndarray) -> None:
        """Write down what evenness added to the rewards of the last services, [m]."""
        self._paid[self._length - len(paid) : self._length] = paid

    def state(self) -> dict[str, np.ndarray]:
        """All that `restore` needs, as arrays by name: services, and what the method remembers."""
        n = self._length
        rows = {name: getattr(self, f"_{name}")[:n].copy() for name in _ROWS}
        return rows | tree.leaves(self.guide.past, "past")

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where another ledger of the same scheme and settings stood.

        Args:
            state: what its `state` gave.

        Raises:
            InputError: when it is of another version, scheme, method or other settings.
        """
        rows = {name: np.asarray(state[name]) for name in _ROWS if name in state}
        if len(rows) < len(_ROWS) or any(
            rows[name].shape[1:] != getattr(self, f"_{name}").shape[1:] for name in _ROWS
        ):
            raise InputError(
                "changed state",
                "what was saved is no state of a ledger of this scheme, or of another version of "
                "Evenhand: make it anew",
            )
        n, size = len(rows["paid"]), self.settings.services
        ledger = Ledger(self.scheme, self.settings, self.detector)
        ledger._make_room(n)
        for name, values in rows.items():
            getattr(ledger, f"_{name}")[:n] = values
        ledger._length = n
        over = n // size * size
        window = ledger._earned(slice(over - size, over)) if over else None
        ledger.guide.restore(
            {name: value for name, value in state.items() if name.startswith("past.")}, window
        )
        vars(self).update(vars(ledger))

    def services(self) -> Services:
        """All services; ``epoch`` is the number of the window, also of one that is not over."""
        n, scheme = self._length, self.scheme
        number = np.arange(n)
        facts: dict[str, Any] = {"epoch": number // self.settings.services, "service": number}
        for f, fact in enumerate(scheme.facts):
            values = self._facts[:n, f]
            missing = np.isnan(values)
            kind = {bool: np.bool_, int: np.int64}.get(fact.kind, np.float64)
            facts[fact.name] = np.ma.array(
                np.where(missing, 0.0, values).astype(kind), mask=missing
            )
        people = {
            one.name: (self._codes[:n, d], one.groups) for d, one in enumerate(scheme.identities)
        }
        return Services.build(people, facts, scheme.own)

    def rows(self, first: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Indicators [n, K] and membership [n, G] of all services from the first one wanted."""
        return self._rows(slice(first, self._length))

    def windows(self) -> Windows:
        """Windows that are over, judged."""
        size = self.settings.services
        number = self._length // size
        if self._found is None or len(self._found) != number:
            x, inside = (
                rows.reshape(number, size, rows.shape[1])
                for rows in self._rows(slice(0, number * size))
            )
            paid = self._paid[: number * size].reshape(number, size).mean(axis=1)
            self._found = self._judge(x, inside, paid)
        return self._found

    def verdicts(
        self, rng: np.random.Generator, settings: VerdictSettings | None = None
    ) -> Verdicts:
        """Verdicts of three states on all services, by permutation (max-T).

        Args:
            rng: source of randomness.
            settings: level, relevant difference, power, permutations.

        Raises:
            InputError: before any service has ended.
        """
        if not self._length:
            raise InputError(
                "empty services", "no service has ended yet: there is nothing to judge"
            )
        return verdicts.judge(*self.rows(), rng, settings)

    @property
    def paid(self) -> np.ndarray:
        """What evenness added to the reward of each service, float64 [n]."""
        return self._paid[: self._length].copy()

    def _rows(self, part: slice) -> tuple[np.ndarray, np.ndarray]:
        x = self.scheme.indicators(Columns(self.scheme, self._facts[part]))
        return x, self.scheme.inside(self._codes[part])

    def _earned(self, part: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return *self._rows(part), self._reward[part]

    def _judge(self, x: np.ndarray, inside: np.ndarray, paid: np.ndarray) -> Windows:
        counts, names = count(x, inside), self.scheme.issue_names
        scores = scores_of(counts, self.scheme.groups, names)
        probability: np.ndarray | None = None
        biased: np.ndarray | None = None
        if self.detector is not None:
            probability = judged(self.detector, scores, self._known)
            biased = np.any(probability > self.detector.threshold, axis=-1)
        excess = chance.excess_scores(counts.rounded(), self.scheme.groups, names)
        return Windows(self.settings.services, counts, scores, excess, probability, biased, paid)

    def _make_room(self, more: int) -> None:
        size = len(self._paid)
        while size < self._length + more:
            size *= 2
        if size > len(self._paid):
            for name in _ROWS:
                old = getattr(self, f"_{name}")
                new = np.zeros((size, *old.shape[1:]), old.dtype)
                new[: self._length] = old[: self._length]
                setattr(self, f"_{name}", new)
