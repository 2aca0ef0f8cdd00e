"""A log as counts: everything that the statistics of an audit need, whatever engine counted it.

Services that agree in identities, stratum and issues are one row. Ten million services with five
identities are a few thousand rows; who they were in detail never leaves the engine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evenhand.core.errors import InputError

UNKNOWN = "unknown"
"""Group of the services that say nothing of an identity."""


@dataclass(frozen=True)
class Identity:
    """An identity and its groups, in order.

    Attributes:
        name: column of the log.
        groups: its values as text; ``UNKNOWN`` last if any are missing.
    """

    name: str
    groups: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Waits:
    """How long people waited, as counts.

    Attributes:
        codes: group of each identity, int64 [W, D]; -1 in rows that do not count for it, where
            each identity was counted by itself.
        stratum: int64 [W].
        step: waiting in whole steps, rounded up, int64 [W].
        responded: whether it ended with a response; else it is censored there, bool [W].
        n: services, int64 [W].
        seconds: length of a step.
        late: step after which a response is late.
    """

    codes: np.ndarray
    stratum: np.ndarray
    step: np.ndarray
    responded: np.ndarray
    n: np.ndarray
    seconds: float
    late: int

    @property
    def services(self) -> int:
        """Those whose waiting is known."""
        return int(self.n[self.codes[:, 0] >= 0].sum())

    def only(self, rows: np.ndarray) -> Waits:
        """Some of the rows."""
        return replace(
            self,
            codes=self.codes[rows],
            stratum=self.stratum[rows],
            step=self.step[rows],
            responded=self.responded[rows],
            n=self.n[rows],
        )


@dataclass(frozen=True, eq=False)
class Values:
    """A continuous measure as counts.

    Attributes:
        name: column of the log.
        codes: group of each identity, int64 [V, D].
        stratum: int64 [V].
        value: of the measure, float64 [V]; finite. Where it is counted in steps, the mean of all
            services in the step.
        mean: of the services of the row alone, float64 [V]; ``value`` where that is exact.
        n: services, int64 [V].
    """

    name: str
    codes: np.ndarray
    stratum: np.ndarray
    value: np.ndarray
    mean: np.ndarray
    n: np.ndarray


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts of a log. Shapes: C rows, D identities, K issues.

    Attributes:
        identities: in the order of the columns of ``codes``.
        issues: names of those that the log can tell, in order.
        strata: names; one empty name without strata.
        codes: group of each identity, an index of its ``groups``, int64 [C, D].
        stratum: index of ``strata``, int64 [C].
        x: 1 where the services have the issue, 0 where not, NaN where it does not apply or is not
            known, float64 [C, K].
        n: services, int64 [C]; above 0.
        waits: None where the log says nothing of waiting.
        values: continuous measures.
    """

    identities: tuple[Identity, ...]
    issues: tuple[str, ...]
    strata: tuple[str, ...]
    codes: np.ndarray
    stratum: np.ndarray
    x: np.ndarray
    n: np.ndarray
    waits: Waits | None = None
    values: tuple[Values, ...] = ()

    def __post_init__(self) -> None:
        if not self.identities:
            raise InputError(
                "missing identities",
                "the log names no identity: say which columns tell who was served",
            )
        if not self.issues:
            raise InputError(
                "missing responded",
                "the log tells no issue: say which column tells whether it responded",
            )
        if not len(self.n):
            raise InputError("empty log", "the log has no services: there is nothing to audit")

    @property
    def services(self) -> int:
        """How many the log has."""
        return int(self.n.sum())

    def names(self) -> tuple[tuple[str, str], ...]:
        """(identity, group) of each column of ``inside``."""
        return tuple((one.name, group) for one in self.identities for group in one.groups)

    def inside(self) -> np.ndarray:
        """Who belongs to which group, float64 [C, G]."""
        return membership(self.codes, self.identities)


def membership(codes: np.ndarray, identities: tuple[Identity, ...]) -> np.ndarray:
    """1 in the group and 0 outside, for every group of every identity, float64 [C, G].

    Args:
        codes: int64 [C, D].
        identities: D.
    """
    columns = [codes[:, d, None] == np.arange(len(one.groups)) for d, one in enumerate(identities)]
    return np.concatenate(columns, axis=1).astype(float)
