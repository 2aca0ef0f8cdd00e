"""Who is served: identities, their groups, and populations to draw people from.

People are rows of codes, one column per identity. The restaurant knows the paper's five identities
(``IDENTITIES``, section "Experiment Setting"): what is drawn and how people are sensed depends on
them. A population may have other identities, and then ``known`` says which of the five they tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.vocabulary import Identity
from evenhand.restaurant.populations import PRESETS, Preset

# Shares must sum to 1 up to rounding in the last places of a float, no more.
TOLERANCE = 1e-6


IDENTITIES: tuple[Identity, ...] = (
    Identity("race", ("White", "Black", "American Indian", "Asian", "Native Hawaiian", "Other")),
    Identity("gender", ("Female", "Male", "Other")),
    Identity("age", ("Child", "Teenager", "Adult", "Middle Aged", "Elder")),
    Identity("disability", ("Yes", "No")),
    Identity("skin", ("I", "II", "III", "IV", "V", "VI")),
)

Identities = tuple[Identity, ...]


def groups_of(identities: Sequence[Identity]) -> tuple[tuple[str, str], ...]:
    """(identity, group) of each of the G columns of one-hot people."""
    return tuple((one.name, group) for one in identities for group in one.groups)


GROUPS = groups_of(IDENTITIES)
"""The 22 groups of the five identities."""

DISCRIMINATION: Mapping[str, str] = {
    "race": "racism",
    "gender": "sexism",
    "age": "ageism",
    "disability": "ableism",
    "skin": "colourism",
}

_NAMES = tuple(identity.name for identity in IDENTITIES)
_ORDINARY = np.array([0, 0, 2, 1, 0])
"""Codes of the five where nothing is said of them: an adult who walks."""


@dataclass(frozen=True)
class Table:
    """Shares of one identity's categories that depend on another identity.

    Attributes:
        given: the identity depended on; it stands earlier among the identities.
        rows: one row of shares for each category of ``given``, each summing to 1.
    """

    given: str
    rows: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Population:
    """Where people are drawn from: the shares of every category.

    Each identity has either ``shares`` or a table; identities without a table are independent.

    Attributes:
        name: what it is called.
        description: who it stands for and what was assumed.
        sources: where its numbers are from.
        shares: identity → shares in the order of its categories, summing to 1.
        tables: identity → shares that depend on another identity.
        identities: of the people, D of them; the five by default.

    Raises:
        InputError: for an identity that is unknown, absent or given twice, and for shares that
            are negative, too few, too many, or do not sum to 1.
    """

    name: str
    description: str
    sources: tuple[str, ...]
    shares: Mapping[str, tuple[float, ...]] = field(hash=False)
    tables: Mapping[str, Table] = field(default_factory=dict, hash=False)
    identities: Identities = IDENTITIES

    def __post_init__(self) -> None:
        where, names = f"population {self.name!r}", self.names
        for given in (*self.shares, *self.tables):
            if given not in names:
                raise unknown(f"identity in {where}", given, names)
        for position, identity in enumerate(self.identities):
            name = identity.name
            if (name in self.shares) == (name in self.tables):
                raise InputError(
                    f"conflict {name}",
                    f"{where} needs shares or a table for {name!r}, one of the two",
                )
            if name in self.shares:
                _check_shares(f"{where}, {name}", self.shares[name], identity)
                continue
            table = self.tables[name]
            if table.given not in names[:position]:
                raise InputError(
                    f"unknown {name}",
                    f"{where}: {name!r} cannot depend on {table.given!r}, only on an identity "
                    f"before it ({', '.join(names[:position]) or 'there is none'})",
                )
            parent = self.identities[names.index(table.given)]
            if len(table.rows) != len(parent.groups):
                raise InputError(
                    f"shape {name}",
                    f"{where}: the table of {name!r} needs {len(parent.groups)} rows, one for "
                    f"each category of {table.given!r}, and has {len(table.rows)}",
                )
            for category, row in zip(parent.groups, table.rows, strict=True):
                _check_shares(f"{where}, {name} given {category}", row, identity)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the identities."""
        return tuple(identity.name for identity in self.identities)

    @cached_property
    def groups(self) -> tuple[tuple[str, str], ...]:
        """See ``groups_of``."""
        return groups_of(self.identities)

    def altered(
        self, identities: Identities, shares: Mapping[str, tuple[float, ...]]
    ) -> Population:
        """The same people with other identities or other shares.

        Args:
            identities: of the new population. What this one says of an identity with the same
                groups stays; the groups of any other identity are equally common.
            shares: identity → shares that replace both, and no longer depend on anything.
        """
        here, names = dict(zip(self.names, self.identities, strict=True)), []
        rows, tables = dict(shares), {}
        for one in identities:
            same = here.get(one.name)
            if one.name not in shares:
                if same is None or same.groups != one.groups:
                    rows[one.name] = (1.0 / len(one.groups),) * len(one.groups)
                elif one.name in self.tables and self.tables[one.name].given in names:
                    tables[one.name] = self.tables[one.name]
                else:
                    rows[one.name] = self.marginal(one.name)
            if same is not None and same.groups == one.groups:
                names.append(one.name)
        return replace(self, shares=rows, tables=tables, identities=identities)

    def marginal(self, identity: str) -> tuple[float, ...]:
        """Overall shares of an identity's categories, whatever it depends on.

        Raises:
            InputError: for an unknown identity.
        """
        if identity not in self.names:
            raise unknown("identity", identity, self.names)
        if identity in self.shares:
            return self.shares[identity]
        table = self.tables[identity]
        return tuple((np.array(self.marginal(table.given)) @ np.array(table.rows)).tolist())

    @cached_property
    def _thresholds(self) -> tuple[tuple[int | None, np.ndarray], ...]:
        """For each identity: the column depended on, and cumulative shares without the last."""
        made = []
        for name in self.names:
            table = self.tables.get(name)
            rows = np.array(table.rows if table else [self.shares[name]])
            sums = np.cumsum(rows, axis=1)[:, :-1]
            # Where nothing is left for the later categories, rounding must not reach them.
            sums[sums > 1 - 1e-12] = 1.0
            given = self.names.index(table.given) if table else None
            made.append((given, sums if table else sums[0]))
        return tuple(made)


def _check_shares(where: str, shares: Sequence[float], identity: Identity) -> None:
    if len(shares) != len(identity.groups):
        raise InputError(
            "shape shares",
            f"{where}: {len(identity.groups)} shares are needed, one for each of "
            f"{', '.join(identity.groups)}, and {len(shares)} are given",
        )
    if not all(math.isfinite(share) and share >= 0 for share in shares):
        raise InputError(
            "range shares", f"{where}: shares must be numbers of at least 0, not {list(shares)}"
        )
    if abs(sum(shares) - 1) > TOLERANCE:
        raise InputError(
            "range shares", f"{where}: shares must sum to 1, and sum to {sum(shares):.6g}"
        )


def _from_preset(preset: Preset) -> Population:
    """Percentages as printed → shares that sum to 1."""

    def scaled(percent: Sequence[float]) -> tuple[float, ...]:
        return tuple(value / sum(percent) for value in percent)

    tables = {
        name: Table(given, tuple(scaled(row) for row in rows))
        for name, (given, rows) in preset.tables.items()
    }
    shares = {
        identity.name: scaled(preset.percent.get(identity.name, (1.0,) * len(identity.groups)))
        for identity in IDENTITIES
        if identity.name not in tables
    }
    return Population(preset.name, preset.description, preset.sources, shares, tables)


POPULATIONS: Mapping[str, Population] = {preset.name: _from_preset(preset) for preset in PRESETS}


def population(name: str) -> Population:
    """A population by its name: ``uniform``, ``us`` or ``fairface``.

    Raises:
        InputError: for a name that does not exist, with the nearest one that does.
    """
    if name not in POPULATIONS:
        raise unknown("population", name, POPULATIONS)
    return POPULATIONS[name]


def sample(population: Population, n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw people.

    Every population of the same identities uses up the same random numbers (one per person and
    identity), so that a change of shares leaves everything drawn afterwards as it was.

    Args:
        population: whom to draw from.
        n: how many people.
        rng: the source of randomness; same state, same people.

    Returns:
        Codes, int64 [n, D].

    Raises:
        InputError: for n below 1.
    """
    if n < 1:
        raise InputError("range n", f"at least 1 person must be drawn, not {n}")
    draws = rng.random((len(population.identities), n))
    codes = np.empty((n, len(population.identities)), dtype=np.int64)
    for column, (given, thresholds) in enumerate(population._thresholds):
        if given is None:
            codes[:, column] = thresholds.searchsorted(draws[column], side="right")
        else:
            rows = thresholds[codes[:, given]]
            codes[:, column] = (draws[column][:, None] >= rows).sum(axis=1)
    return codes


def known(codes: np.ndarray, identities: Identities) -> np.ndarray:
    """What is known of the five identities of people with identities of their own.

    Args:
        codes: int [..., D].
        identities: D of them. Those named like one of the five tell it by the names of their
            groups; where none does, people are adults who walk.

    Returns:
        Codes of ``IDENTITIES``, int64 [..., 5].
    """
    if identities == IDENTITIES:
        return codes
    out = np.broadcast_to(_ORDINARY, (*codes.shape[:-1], len(IDENTITIES))).copy()
    for column, one in enumerate(IDENTITIES):
        for d, own in enumerate(identities):
            if own.name == one.name:
                same = [one.groups.index(g) if g in one.groups else -1 for g in own.groups]
                told = np.array(same)[codes[..., d]]
                out[..., column] = np.where(told < 0, out[..., column], told)
    return out


def check_codes(codes: np.ndarray, identities: Identities = IDENTITIES) -> np.ndarray:
    """People as int64 codes [n, D], or an error that says which one cannot be.

    Raises:
        InputError: for another shape, other numbers than integers, or a code without a group.
    """
    codes = np.asarray(codes)
    if codes.ndim != 2 or codes.shape[1] != len(identities):
        raise InputError(
            "shape people",
            f"people must be codes of shape [n, {len(identities)}], not {list(codes.shape)}",
        )
    if not np.issubdtype(codes.dtype, np.integer):
        raise InputError("type people", f"people must be integer codes, not {codes.dtype}")
    wrong = (codes < 0) | (codes >= np.array([len(one.groups) for one in identities]))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        identity = identities[column]
        raise InputError(
            f"range {identity.name}",
            f"row {row}: {codes[row, column]} is no code of {identity.name}, which takes 0 to "
            f"{len(identity.groups) - 1}",
        )
    return codes.astype(np.int64, copy=False)


def encode(codes: np.ndarray, identities: Identities = IDENTITIES) -> np.ndarray:
    """P of the paper's state: people as one-hot rows over their groups.

    Args:
        codes: int [n, D].
        identities: D of them, with G groups together; 22 by default.

    Returns:
        float32 [n, G] in the order of ``groups_of``; each row holds D ones.

    Raises:
        InputError: as ``check_codes``.
    """
    codes = check_codes(codes, identities)
    sizes = [len(one.groups) for one in identities]
    onehot = np.zeros((len(codes), sum(sizes)), dtype=np.float32)
    first = np.cumsum([0, *sizes[:-1]])
    onehot[np.arange(len(codes))[:, None], codes + first] = 1.0
    return onehot


def decode(onehot: np.ndarray, identities: Identities = IDENTITIES) -> np.ndarray:
    """Codes of one-hot people, int64 [n, D]: the inverse of ``encode``."""
    ends = np.cumsum([len(one.groups) for one in identities])[:-1]
    return np.stack([part.argmax(axis=1) for part in np.split(onehot, ends, axis=1)], axis=1)


def labels(codes: np.ndarray, identities: Identities = IDENTITIES) -> dict[str, list[str]]:
    """The groups that codes stand for.

    Args:
        codes: int [n, D].
        identities: D of them.

    Returns:
        Identity → n names of groups.

    Raises:
        InputError: as ``check_codes``.
    """
    codes = check_codes(codes, identities)
    return {
        identity.name: [identity.groups[code] for code in codes[:, column].tolist()]
        for column, identity in enumerate(identities)
    }


def codes_of(labels: Mapping[str, Sequence[str]]) -> np.ndarray:
    """The codes of named categories: the inverse of ``labels``.

    Args:
        labels: identity → n category names, all five identities.

    Returns:
        Codes, int64 [n, 5].

    Raises:
        InputError: for an identity that is unknown or absent, columns of unequal length, and an
            unknown category (with its row and the nearest one that exists).
    """
    for name in labels:
        if name not in _NAMES:
            raise unknown("identity", name, _NAMES)
    for name in _NAMES:
        if name not in labels:
            raise InputError(
                f"missing {name}",
                f"identity {name!r} is absent: give its category for every person",
            )
    lengths = {name: len(labels[name]) for name in _NAMES}
    if len(set(lengths.values())) > 1:
        counted = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(
            "shape identities", f"identities must be given for the same people: rows are {counted}"
        )
    codes = np.empty((lengths[_NAMES[0]], len(_NAMES)), dtype=np.int64)
    for column, identity in enumerate(IDENTITIES):
        code_of = {category: code for code, category in enumerate(identity.groups)}
        for row, category in enumerate(labels[identity.name]):
            if category not in code_of:
                raise unknown(f"{identity.name} in row {row}", str(category), identity.groups)
            codes[row, column] = code_of[category]
    return codes
