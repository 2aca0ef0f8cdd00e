"""Interactions: one row a service, raw facts only. The currency between world and judgement.

Two kinds of columns: identities (any number, named, categorical) and facts: those of the house
(``FACTS``) and own ones, declared with their type. Columns that a log lacks are absent; cells that
a row lacks are null. Issues are never stored, they are derived.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from evenhand.core.errors import InputError, unknown
from evenhand.methods.columns import (
    FACTS,
    categorical,
    coded,
    fact_column,
    kinds_of,
    note_of,
    of_kind,
    own_of,
)

_IDENTITIES_KEY, _OWN_KEY = b"evenhand.identities", b"evenhand.own_facts"
_NONE: Mapping[str, pa.DataType] = {}


class Interactions:
    """An immutable table of services.

    Build one with :meth:`build`, :meth:`from_arrow`, :meth:`read_parquet` or :meth:`read_csv`.
    """

    __slots__ = ("_identities", "_own", "_table")

    def __init__(
        self,
        table: pa.Table,
        identities: Sequence[str],
        own: Mapping[str, pa.DataType] = _NONE,
    ) -> None:
        """Wrap a table whose columns are checked.

        Args:
            table: identity columns of dictionary type, and fact columns.
            identities: names of the identity columns.
            own: types of facts that ``FACTS`` does not hold, see ``OWN_TYPES``.

        Raises:
            InputError: for a missing, unknown, repeated, or wrongly typed column.
        """
        kinds = kinds_of(own)
        schema = table.schema
        types = dict(zip(schema.names, schema.types, strict=True))
        if len(types) < len(schema):
            twice = next(name for name in types if schema.names.count(name) > 1)
            raise InputError(f"column {twice!r} stands there twice: rename or drop one")
        for name in identities:
            if name in kinds:
                raise InputError(f"identity {name!r} has the name of a fact: rename the column")
            if name not in types:
                raise InputError(f"no column {name!r}: the identities named are {list(identities)}")
            if not pa.types.is_dictionary(types.pop(name)):
                raise InputError(f"identity column {name!r} is not categorical")
        for name, kind in types.items():
            if name not in kinds:
                raise unknown("fact", name, kinds)
            if kind != kinds[name]:
                raise InputError(f"column {name!r} holds {kind}, expected {kinds[name]}")
        self._table = table
        self._identities = tuple(identities)
        self._own = {name: kind for name, kind in own.items() if name not in FACTS}

    @classmethod
    def build(
        cls,
        identities: Mapping[str, tuple[np.ndarray, Sequence[str]]],
        facts: Mapping[str, Any],
        own: Mapping[str, pa.DataType] = _NONE,
    ) -> Interactions:
        """Make interactions from arrays.

        Args:
            identities: name -> (codes int [n], categories); a code of -1 stands for a missing
                value and becomes null.
            facts: name -> values [n]; masked entries, None and NaN become null.
            own: types of facts that ``FACTS`` does not hold.

        Raises:
            InputError: for codes out of range or not whole, a category that stands there twice,
                unknown or wrongly typed facts, or columns of unequal length.
        """
        columns: dict[str, pa.Array] = {}
        for name, (codes, categories) in identities.items():
            columns[name] = coded(name, codes, categories)
        kinds = kinds_of(own)
        for name, values in facts.items():
            if name not in kinds:
                raise unknown("fact", name, kinds)
            columns[name] = fact_column(name, values, kinds[name])
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise InputError(f"columns are of unequal length: {lengths}")
        return cls(pa.table(columns), tuple(identities), own)

    @classmethod
    def from_arrow(
        cls,
        table: pa.Table,
        identities: Sequence[str] | None = None,
        own: Mapping[str, pa.DataType] | None = None,
    ) -> Interactions:
        """Take an Arrow table; what is not said of it is as :meth:`to_arrow` noted it.

        Raises:
            InputError: when it is not said which columns are identities, or a column is wrong.
        """
        notes = table.schema.metadata or {}
        own = own_of(notes.get(_OWN_KEY, b"")) if own is None else own
        kinds = kinds_of(own)
        if identities is None:
            noted = notes.get(_IDENTITIES_KEY)
            if noted is None:
                raise InputError("it is not said which columns are identities: name them")
            identities = noted.decode().split("\x1f") if noted else []
        columns = []
        for name, chunks in zip(table.column_names, table.columns, strict=True):
            column = chunks.combine_chunks()
            try:
                if name in identities:
                    columns.append(categorical(column))
                elif name in kinds:
                    columns.append(of_kind(column, kinds[name]))
                else:
                    raise unknown("fact", name, kinds)
            except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
                raise InputError(f"column {name!r}: {error}") from error
        return cls(pa.table(columns, table.column_names), identities, own)

    def to_arrow(self) -> pa.Table:
        """The Arrow table, with a note of which columns are identities and which facts own."""
        notes = {_IDENTITIES_KEY: "\x1f".join(self._identities).encode()}
        if self._own:
            notes[_OWN_KEY] = note_of(self._own)
        return self._table.replace_schema_metadata(notes)

    @classmethod
    def read_parquet(cls, path: str | os.PathLike[str]) -> Interactions:
        """Read what :meth:`write_parquet` wrote.

        Raises:
            InputError: when the file is missing, cut off, or not of interactions.
        """
        try:
            table = pq.read_table(path)
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError(f"{path} cannot be read as Parquet: {error}") from error
        return cls._from_file(path, table, None)

    def write_parquet(self, path: str | os.PathLike[str]) -> None:
        """Write Parquet aside and rename it, so that no half file is ever seen.

        Raises:
            InputError: when it cannot be written.
        """
        _write(path, lambda aside: pq.write_table(self.to_arrow(), aside))

    @classmethod
    def read_csv(
        cls,
        path: str | os.PathLike[str],
        identities: Sequence[str],
        own: Mapping[str, pa.DataType] = _NONE,
    ) -> Interactions:
        """Read a CSV file with a header; an empty cell is null.

        Categories are those that occur, in the order of their first row.

        Raises:
            InputError: when the file cannot be read or a column has the wrong type.
        """
        kinds = kinds_of(own) | {name: pa.string() for name in identities}
        options = pacsv.ConvertOptions(
            column_types=kinds, null_values=[""], strings_can_be_null=True
        )
        try:
            table = pacsv.read_csv(
                path,
                parse_options=pacsv.ParseOptions(newlines_in_values=True),
                convert_options=options,
            )
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError(f"{path} cannot be read as CSV: {error}") from error
        return cls._from_file(path, table, identities, own)

    @classmethod
    def _from_file(
        cls,
        path: str | os.PathLike[str],
        table: pa.Table,
        identities: Sequence[str] | None,
        own: Mapping[str, pa.DataType] | None = None,
    ) -> Interactions:
        try:
            return cls.from_arrow(table, identities, own)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write CSV aside and rename it.

        Raises:
            InputError: when it cannot be written.
        """
        plain = pa.table(
            {
                name: column.cast(pa.string()) if name in self._identities else column
                for name, column in zip(self.column_names, self._table.columns, strict=True)
            }
        )
        _write(path, lambda aside: pacsv.write_csv(plain, aside))

    @property
    def identities(self) -> tuple[str, ...]:
        """Names of the identity columns."""
        return self._identities

    @property
    def column_names(self) -> list[str]:
        """Names of all columns."""
        return self._table.column_names

    def __len__(self) -> int:
        return self._table.num_rows

    def __contains__(self, name: str) -> bool:
        return name in self._table.column_names

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Interactions)
            and self._identities == other._identities
            and self._table.equals(other._table)
        )

    __hash__ = None  # type: ignore[assignment]

    def fact(self, name: str) -> np.ndarray:
        """A fact as numbers: float64 [n] with NaN for null; text as objects with None.

        Whole numbers beyond 2^53 are rounded to the next float.

        Raises:
            InputError: when the column is absent.
        """
        if name not in self._table.column_names or name in self._identities:
            raise unknown("fact of this table", name, set(self.column_names) - {*self._identities})
        column = self._table[name]
        if pa.types.is_string(column.type):
            return column.to_numpy()
        return pc.cast(column, pa.float64(), safe=False).to_numpy()

    def identity(self, name: str) -> tuple[np.ndarray, tuple[str, ...]]:
        """Codes int64 [n] (-1 for missing) and categories of an identity.

        Raises:
            InputError: when there is no such identity.
        """
        if name not in self._identities:
            raise unknown("identity", name, self._identities)
        column = self._table[name].combine_chunks()
        codes = column.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int64)
        return codes, tuple(column.dictionary.to_pylist())

    def take(self, rows: np.ndarray) -> Interactions:
        """The rows at these indices, or where this mask is true."""
        rows = np.asarray(rows) if np.size(rows) else np.empty(0, np.int64)
        picked = self._table.filter(rows) if rows.dtype == bool else self._table.take(rows)
        return Interactions(picked, self._identities, self._own)

    @classmethod
    def concat(cls, parts: Sequence[Interactions]) -> Interactions:
        """One table after the other.

        Raises:
            InputError: for no part, or parts with other columns.
        """
        if not parts:
            raise InputError("nothing to concatenate")
        if any(part.column_names != parts[0].column_names for part in parts):
            raise InputError("tables with other columns cannot be put together")
        tables = pa.concat_tables([part._table for part in parts]).unify_dictionaries()
        return cls(tables.combine_chunks(), parts[0].identities, parts[0]._own)


def _write(path: str | os.PathLike[str], write: Callable[[Path], None]) -> None:
    aside = Path(f"{path}.part")
    try:
        write(aside)
        os.replace(aside, path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else error
        raise InputError(f"{path} cannot be written: {reason}") from error
    finally:
        # also after Ctrl-C; after a success there is nothing left to remove
        with contextlib.suppress(OSError):
            aside.unlink()
