"""Who is served: five identities, 22 groups, populations to draw people from.

People are rows of codes, one column an identity, in the order of ``IDENTITIES``. Categories are
the paper's (section "Experiment Setting").
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.restaurant.populations import PRESETS, Preset

# Shares must sum to 1 up to rounding in the last places of a float, no more.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Identity:
    """One sensitive identity and the categories that it takes.

    Attributes:
        name: what it is called in columns and tables.
        categories: in the order of their codes, 0 first.
    """

    name: str
    categories: tuple[str, ...]


IDENTITIES: tuple[Identity, ...] = (
    Identity("race", ("White", "Black", "American Indian", "Asian", "Native Hawaiian", "Other")),
    Identity("gender", ("Female", "Male", "Other")),
    Identity("age", ("Child", "Teenager", "Adult", "Middle Aged", "Elder")),
    Identity("disability", ("Yes", "No")),
    Identity("skin", ("I", "II", "III", "IV", "V", "VI")),
)

GROUPS: tuple[tuple[str, str], ...] = tuple(
    (identity.name, category) for identity in IDENTITIES for category in identity.categories
)

DISCRIMINATION: Mapping[str, str] = {
    "race": "racism",
    "gender": "sexism",
    "age": "ageism",
    "disability": "ableism",
    "skin": "colourism",
}

_NAMES = tuple(identity.name for identity in IDENTITIES)
_SIZES = np.array([len(identity.categories) for identity in IDENTITIES])
_FIRST_GROUP = np.concatenate([[0], np.cumsum(_SIZES)[:-1]])


@dataclass(frozen=True)
class Table:
    """Shares of one identity's categories that depend on another identity.

    Attributes:
        given: the identity depended on; it stands earlier in ``IDENTITIES``.
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

    Raises:
        InputError: for an identity that is unknown, absent or given twice, and for shares that
            are negative, too few, too many, or do not sum to 1.
    """

    name: str
    description: str
    sources: tuple[str, ...]
    shares: Mapping[str, tuple[float, ...]] = field(hash=False)
    tables: Mapping[str, Table] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        where = f"population {self.name!r}"
        for given in (*self.shares, *self.tables):
            if given not in _NAMES:
                raise unknown(f"identity in {where}", given, _NAMES)
        for position, identity in enumerate(IDENTITIES):
            name = identity.name
            if (name in self.shares) == (name in self.tables):
                raise InputError(f"{where} needs shares or a table for {name!r}, one of the two")
            if name in self.shares:
                _check_shares(f"{where}, {name}", self.shares[name], identity)
                continue
            table = self.tables[name]
            if table.given not in _NAMES[:position]:
                raise InputError(
                    f"{where}: {name!r} cannot depend on {table.given!r}, only on an identity "
                    f"before it ({', '.join(_NAMES[:position]) or 'there is none'})"
                )
            parent = IDENTITIES[_NAMES.index(table.given)]
            if len(table.rows) != len(parent.categories):
                raise InputError(
                    f"{where}: the table of {name!r} needs {len(parent.categories)} rows, one for "
                    f"each category of {table.given!r}, and has {len(table.rows)}"
                )
            for category, row in zip(parent.categories, table.rows, strict=True):
                _check_shares(f"{where}, {name} given {category}", row, identity)

    def marginal(self, identity: str) -> tuple[float, ...]:
        """Overall shares of an identity's categories, whatever it depends on.

        Raises:
            InputError: for an unknown identity.
        """
        if identity not in _NAMES:
            raise unknown("identity", identity, _NAMES)
        if identity in self.shares:
            return self.shares[identity]
        table = self.tables[identity]
        return tuple((np.array(self.marginal(table.given)) @ np.array(table.rows)).tolist())

    @cached_property
    def _thresholds(self) -> tuple[tuple[int | None, np.ndarray], ...]:
        """For each identity: the column depended on, and cumulative shares without the last."""
        made = []
        for name in _NAMES:
            table = self.tables.get(name)
            rows = np.array(table.rows if table else [self.shares[name]])
            sums = np.cumsum(rows, axis=1)[:, :-1]
            # Where nothing is left for the later categories, rounding must not reach them.
            sums[sums > 1 - 1e-12] = 1.0
            made.append((_NAMES.index(table.given) if table else None, sums if table else sums[0]))
        return tuple(made)


def _check_shares(where: str, shares: Sequence[float], identity: Identity) -> None:
    if len(shares) != len(identity.categories):
        raise InputError(
            f"{where}: {len(identity.categories)} shares are needed, one for each of "
            f"{', '.join(identity.categories)}, and {len(shares)} are given"
        )
    if not all(math.isfinite(share) and share >= 0 for share in shares):
        raise InputError(f"{where}: shares must be numbers of at least 0, not {list(shares)}")
    if abs(sum(shares) - 1) > TOLERANCE:
        raise InputError(f"{where}: shares must sum to 1, and sum to {sum(shares):.6g}")


def _from_preset(preset: Preset) -> Population:
    """Percentages as printed → shares that sum to 1."""

    def scaled(percent: Sequence[float]) -> tuple[float, ...]:
        return tuple(value / sum(percent) for value in percent)

    tables = {
        name: Table(given, tuple(scaled(row) for row in rows))
        for name, (given, rows) in preset.tables.items()
    }
    shares = {
        identity.name: scaled(preset.percent.get(identity.name, (1.0,) * len(identity.categories)))
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

    Every population uses up the same random numbers (five a person), so that a change of
    population leaves everything drawn afterwards as it was.

    Args:
        population: whom to draw from.
        n: how many people.
        rng: the source of randomness; same state, same people.

    Returns:
        Codes, int64 [n, 5].

    Raises:
        InputError: for n below 1.
    """
    if n < 1:
        raise InputError(f"at least 1 person must be drawn, not {n}")
    draws = rng.random((len(IDENTITIES), n))
    codes = np.empty((n, len(IDENTITIES)), dtype=np.int64)
    for column, (given, thresholds) in enumerate(population._thresholds):
        if given is None:
            codes[:, column] = thresholds.searchsorted(draws[column], side="right")
        else:
            rows = thresholds[codes[:, given]]
            codes[:, column] = (draws[column][:, None] >= rows).sum(axis=1)
    return codes


def check_codes(codes: np.ndarray) -> np.ndarray:
    """People as int64 codes [n, 5], or an error that says which one cannot be.

    Raises:
        InputError: for another shape, other numbers than integers, or a code without a category.
    """
    codes = np.asarray(codes)
    if codes.ndim != 2 or codes.shape[1] != len(IDENTITIES):
        raise InputError(
            f"people must be codes of shape [n, {len(IDENTITIES)}], not {list(codes.shape)}"
        )
    if not np.issubdtype(codes.dtype, np.integer):
        raise InputError(f"people must be integer codes, not {codes.dtype}")
    wrong = (codes < 0) | (codes >= _SIZES)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        identity = IDENTITIES[column]
        raise InputError(
            f"row {row}: {codes[row, column]} is no code of {identity.name}, which takes 0 to "
            f"{len(identity.categories) - 1}"
        )
    return codes.astype(np.int64, copy=False)


def encode(codes: np.ndarray) -> np.ndarray:
    """P of the paper's state: people as one-hot rows over the 22 groups.

    Args:
        codes: int [n, 5].

    Returns:
        float32 [n, 22] in the order of ``GROUPS``; each row holds five ones.

    Raises:
        InputError: as ``check_codes``.
    """
    codes = check_codes(codes)
    onehot = np.zeros((len(codes), len(GROUPS)), dtype=np.float32)
    onehot[np.arange(len(codes))[:, None], codes + _FIRST_GROUP] = 1.0
    return onehot


def labels(codes: np.ndarray) -> dict[str, list[str]]:
    """The categories that codes stand for.

    Args:
        codes: int [n, 5].

    Returns:
        Identity → n category names.

    Raises:
        InputError: as ``check_codes``.
    """
    codes = check_codes(codes)
    return {
        identity.name: [identity.categories[code] for code in codes[:, column].tolist()]
        for column, identity in enumerate(IDENTITIES)
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
            raise InputError(f"identity {name!r} is absent: give its category for every person")
    lengths = {name: len(labels[name]) for name in _NAMES}
    if len(set(lengths.values())) > 1:
        counted = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"identities must be given for the same people: rows are {counted}")
    codes = np.empty((lengths[_NAMES[0]], len(_NAMES)), dtype=np.int64)
    for column, identity in enumerate(IDENTITIES):
        code_of = {category: code for code, category in enumerate(identity.categories)}
        for row, category in enumerate(labels[identity.name]):
            if category not in code_of:
                raise unknown(f"{identity.name} in row {row}", str(category), identity.categories)
            codes[row, column] = code_of[category]
    return codes
