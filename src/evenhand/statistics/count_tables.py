"""The permutation test of a log of any size, from counts instead of rows.

Services that agree in who was served and in what happened are one row with a number. Shuffling
outcomes against people then means drawing a table, kinds of people × kinds of outcomes, with
both margins as they are: among all tables that have them, each as likely as shuffled rows would
make it (the multivariate hypergeometric law; Patefield, Applied Statistics 1981). What a
permutation costs depends on the kinds of people and outcomes, not on how many services there are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.sparse import csr_array

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts
from evenhand.statistics.permutation import CELLS, PermutationTest, against_parts

MOST_SERVICES = 999_999_999
"""Services of a stratum: so far SciPy's tables were checked against the law."""

CHEAPER = 4  # A cell of a random table takes as long as shuffling so many services.


@dataclass(frozen=True, eq=False)
class Stratum:
    """The services that are exchanged with one another: I kinds of people, J of outcomes.

    Attributes:
        groups: G.
        here: who is in each group, [G, I].
        there: who is known to be outside of it, [G, I]; None where every side is known.
        outcome: for each kind of outcome which issues apply, then which happened, bool [J, 2 K].
        services: int64 [J, I].
    """

    groups: int
    here: csr_array
    there: csr_array | None
    outcome: np.ndarray
    services: np.ndarray

    def counts(self, tables: Iterable[np.ndarray], b: int) -> Counts:
        """Counts [b, G, K] of tables that come one kind of outcome at a time, [I, b] each."""
        here = np.zeros((b, self.groups, self.outcome.shape[1]))
        there = np.zeros_like(here)
        amounts = self.services.sum(axis=1)
        for outcome, amount, column in zip(self.outcome, amounts, tables, strict=True):
            inside = (self.here @ column).T
            outside = amount - inside if self.there is None else (self.there @ column).T
            for k in np.flatnonzero(outcome):
                here[..., k] += inside
                there[..., k] += outside
        (here_n, here_x), (there_n, there_x) = (np.split(s, 2, axis=-1) for s in (here, there))
        return Counts(here_n, here_x, there_n, there_x)

    def observed(self) -> Counts:
        """Counts as they are, [G, K]."""
        c = self.counts(self.services[:, :, None], 1)
        return Counts(c.inside_n[0], c.inside_x[0], c.outside_n[0], c.outside_x[0])

    def cells(self) -> int:
        """Numbers that a permutation holds in memory, about."""
        kinds, services = self.services.shape[1], int(self.services.sum())
        drawing = 3 * services if services <= CHEAPER * self.services.size else 2 * kinds
        return drawing + self.services.size + 3 * self.groups


@dataclass(frozen=True, eq=False)
class Table:
    """A log as tables of kinds of people × kinds of outcomes, one a stratum.

    Attributes:
        strata: at least one.
    """

    strata: tuple[Stratum, ...]

    @classmethod
    def of(
        cls,
        x: np.ndarray,
        inside: np.ndarray,
        n: np.ndarray,
        strata: np.ndarray | None = None,
        who: np.ndarray | None = None,
    ) -> Table:
        """Bring weighted rows together.

        Args:
            x: indicators, [C, K], NaN where an issue does not apply.
            inside: membership, [C, G], NaN where unknown; or of I kinds of people, [I, G], if
                ``who`` is given.
            n: services that each row stands for, [C], whole numbers of at least 0.
            strata: whole numbers [C]; services are only exchanged within one.
            who: row of ``inside`` for each row of ``x``, [C]; saves memory when groups are many.

        Raises:
            InputError: for rows that do not match, other values than 0, 1 and NaN, or services
                that are not whole numbers or too many of them.
        """
        x, inside, n = np.asarray(x, float), np.asarray(inside), np.asarray(n)
        who = np.arange(len(inside)) if who is None else np.asarray(who)
        stratum = np.zeros(len(n), int) if strata is None else np.asarray(strata)
        _check(x, inside, n, stratum, who)
        x, n, stratum, who = x[n > 0], n[n > 0].astype(np.int64), stratum[n > 0], who[n > 0]
        kind_rows, kind = _distinct(inside)
        outcome_rows, pattern = _distinct(x)
        return cls(
            tuple(
                _stratum(
                    inside[kind_rows], x[outcome_rows], kind[who[rows]], pattern[rows], n[rows]
                )
                for rows in _parts(stratum)
            )
        )

    def counts(self) -> Counts:
        """Counts of the whole log, [G, K]."""
        parts = [one.observed() for one in self.strata]
        return sum(parts[1:], parts[0])

    def test(
        self, rng: np.random.Generator, permutations: int, totalled: int | None = None
    ) -> PermutationTest:
        """Test every group and issue of the log.

        The null is that of :func:`evenhand.statistics.permutation.permutation_test` on a row for
        each service, and so is every result but for the numbers that were drawn.

        Args:
            rng: source of randomness.
            permutations: how many to draw, at least 99.
            totalled: the total issue score is that of the first so many groups; of all by default.

        Raises:
            InputError: for too few permutations.
        """
        errors.whole("permutations", permutations, 99, 10_000_000)
        groups, twice = self.strata[0].groups, self.strata[0].outcome.shape[1]
        kept = 3 * groups * twice * len(self.strata)
        size = max(1, CELLS // (kept + max(one.cells() for one in self.strata)))
        sizes = [min(size, permutations - start) for start in range(0, permutations, size)]
        chunks = (
            [one.counts(random_tables(one.services, b, rng), b) for one in self.strata]
            for b in sizes
        )
        return against_parts([one.observed() for one in self.strata], chunks, totalled)


def _stratum(
    inside: np.ndarray, x: np.ndarray, kind: np.ndarray, pattern: np.ndarray, n: np.ndarray
) -> Stratum:
    """One stratum from kinds of people and of outcomes, and which of them its rows are."""
    kinds, i = np.unique(kind, return_inverse=True)
    patterns, j = np.unique(pattern, return_inverse=True)
    services = np.zeros((len(patterns), len(kinds)), np.int64)
    np.add.at(services, (j, i), n)
    if services.sum() > MOST_SERVICES:
        raise InputError(
            "range services",
            f"{services.sum()} services are to be exchanged with one another, and "
            f"{MOST_SERVICES} is the most: name strata, or audit a part of the log",
        )
    member, seen = inside[kinds].astype(float), x[patterns]
    known = not np.isnan(member).any()
    return Stratum(
        groups=member.shape[1],
        here=csr_array(np.nan_to_num(member).T),
        there=None if known else csr_array(np.nan_to_num(1.0 - member).T),
        outcome=np.concatenate([~np.isnan(seen), seen == 1], axis=1),
        services=services,
    )


def random_tables(
    table: np.ndarray, permutations: int, rng: np.random.Generator
) -> Iterator[np.ndarray]:
    """Tables as shuffling makes them, with the margins of the one that is given.

    Small tables with few services are shuffled indeed; others come from SciPy.

    Args:
        table: services, whole numbers, [J, I].
        permutations: how many tables, b.
        rng: source of randomness.

    Yields:
        For each of the J rows in order, services of each column, int64 [I, b].
    """
    if int(table.sum()) <= CHEAPER * table.size:
        return _shuffled(table, permutations, rng)
    margins = table.sum(axis=1), table.sum(axis=0)
    if min(np.count_nonzero(margin) for margin in margins) < 2:
        # there is one such table only, of which SciPy 1.17 draws negative numbers
        drawn = np.broadcast_to(table, (permutations, *table.shape))
    else:
        drawn = stats.random_table(*margins).rvs(permutations, random_state=rng)
    return (np.ascontiguousarray(row.T) for row in drawn.transpose(1, 0, 2))


def _shuffled(table: np.ndarray, b: int, rng: np.random.Generator) -> Iterator[np.ndarray]:
    rows, columns = table.shape
    what = np.repeat(np.arange(rows), table.sum(axis=1)) * columns
    who = np.repeat(np.arange(columns), table.sum(axis=0))
    orders = rng.permuted(np.tile(what, (b, 1)), axis=1)
    cell = orders + who + table.size * np.arange(b)[:, None]
    drawn = np.bincount(cell.ravel(), minlength=b * table.size).reshape(b, rows, columns)
    return iter(np.ascontiguousarray(drawn.transpose(1, 2, 0)))


def _distinct(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row of each distinct row of 0, 1 and NaN, and which of them every row is."""
    digits = np.where(np.isnan(values), 2, values).astype(np.uint8)
    whole = np.ascontiguousarray(digits).view(np.dtype((np.void, digits.shape[1]))).ravel()
    _, first, which = np.unique(whole, return_index=True, return_inverse=True)
    return first, which


def _parts(stratum: np.ndarray) -> list[np.ndarray]:
    order = np.argsort(stratum, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(stratum[order])) + 1)


def _check(
    x: np.ndarray, inside: np.ndarray, n: np.ndarray, stratum: np.ndarray, who: np.ndarray
) -> None:
    if x.ndim != 2 or inside.ndim != 2 or not n.shape == who.shape == stratum.shape == x.shape[:1]:
        raise InputError(
            "shape indicators",
            f"indicators {x.shape}, membership {inside.shape}, services {n.shape} and strata "
            f"{stratum.shape} do not match: give one row to each",
        )
    if len(who) and not (who.min() >= 0 and who.max() < len(inside)):
        raise InputError(
            "range who", f"who names kinds of people outside of the {len(inside)} that are given"
        )
    if 0 in x.shape or 0 in inside.shape:
        raise InputError(
            "empty log", "the log has no services, no groups or no issues: nothing to test"
        )
    if n.dtype.kind not in "iu" or (n < 0).any() or not n.any():
        raise InputError(
            "range services", "services are not whole numbers of at least 0, or there are none"
        )
    for name, values in (("indicators", x), ("membership", inside)):
        if not ((values == 0) | (values == 1) | np.isnan(values)).all():
            raise InputError(f"range {name}", f"{name} hold other values than 0, 1 and missing")
