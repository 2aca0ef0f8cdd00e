"""Services: one row a service, raw facts only. The currency between world and judgement.

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

FACTS: dict[str, pa.DataType] = {
    "epoch": pa.int32(),
    "service": pa.int64(),
    "scenario": pa.string(),
    "robot": pa.string(),
    "responded": pa.bool_(),
    "response_step": pa.int32(),
    "response_distance": pa.float64(),
    "min_distance": pa.float64(),
    "steps": pa.int32(),
    "start_distance": pa.float64(),
    "path_length": pa.float64(),
    "contact_steps": pa.int32(),
    "sensed_error": pa.float64(),
}
"""Facts and their types; distances in metres, times in physics steps of 0.02 s."""

OWN_TYPES = (pa.bool_(), pa.int64(), pa.float64(), pa.string())
"""What own facts can be."""

_BETWEEN = "\x1f"


def kinds_of(own: Mapping[str, pa.DataType]) -> dict[str, pa.DataType]:
    """Types of all facts that can stand in a table.

    Args:
        own: facts beside those of ``FACTS``, and their types.

    Raises:
        InputError: for a type that no fact can have, or a fact of the house with another type.
    """
    for name, kind in own.items():
        if name in FACTS and kind != FACTS[name]:
            raise InputError(
                f"conflict {name}",
                f"own fact {name!r} holds {kind}, but the fact of that name holds {FACTS[name]}: "
                "give it another name",
            )
        if name not in FACTS and kind not in OWN_TYPES:
            raise InputError(
                f"type {name}",
                f"own fact {name!r} holds {kind}: choose one of {', '.join(map(str, OWN_TYPES))}",
            )
    return FACTS | dict(own)


def note_of(own: Mapping[str, pa.DataType]) -> bytes:
    """Own facts and their types as a note that goes with a file."""
    return _BETWEEN.join(part for name, kind in own.items() for part in (name, str(kind))).encode()


def own_of(note: bytes) -> dict[str, pa.DataType]:
    """Own facts from a note; the inverse of :func:`note_of`.

    Raises:
        InputError: for a note that names another type.
    """
    words = note.decode().split(_BETWEEN) if note else []
    kinds = {str(kind): kind for kind in OWN_TYPES}
    for name, kind in zip(words[::2], words[1::2], strict=True):
        if kind not in kinds:
            raise unknown(f"type of the fact {name!r}", kind, kinds)
    return {name: kinds[kind] for name, kind in zip(words[::2], words[1::2], strict=True)}


def fact_column(name: str, values: Any, kind: pa.DataType) -> pa.Array:
    """A fact of any array or sequence; what is masked, None or NaN is null.

    Raises:
        InputError: for values that are not of its type.
    """
    mask = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    # a copy, so that the table does not change with the caller's array
    if isinstance(values, np.ndarray):
        values = np.array(values)
        if values.dtype.kind == "i" and kind == pa.int32():
            short = values.astype(np.int32)
            # Arrow is slow to narrow numbers, but says which does not fit
            values = short if (short == values).all() else values
    try:
        return of_kind(pa.array(values, mask=mask, from_pandas=True), kind)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError) as error:
        raise InputError(f"format {name}", f"fact {name!r}: {error}") from error


def coded(name: str, codes: Any, categories: Sequence[str]) -> pa.Array:
    """An identity from codes; a code of -1 is null.

    Raises:
        InputError: for codes out of range or not whole, or a category that stands there twice.
    """
    codes = np.asarray(codes)
    whole = codes.dtype.kind in "biu" or not codes.size or (codes == np.round(codes)).all()
    if not whole or (codes.size and (codes.min() < -1 or codes.max() >= len(categories))):
        raise InputError(
            f"range {name}",
            f"identity {name!r}: codes must be whole numbers of -1 to {len(categories) - 1}",
        )
    if len(set(categories)) < len(categories):
        raise InputError(
            f"duplicate {name}", f"identity {name!r} has a category twice: {', '.join(categories)}"
        )
    index = pa.array(codes.astype(np.int32), mask=codes < 0)
    return pa.DictionaryArray.from_arrays(index, pa.array(list(categories)))


def of_kind(column: pa.Array, kind: pa.DataType) -> pa.Array:
    """A column of a fact's type, with null where a number was NaN.

    Raises:
        pyarrow.ArrowInvalid: for values that are not of this type; of a fact that is yes or no, for
            other numbers than 1 and 0.
        pyarrow.ArrowNotImplementedError: for a type that cannot become this one.
    """
    column = without_nan(column)  # Arrow takes NaN for true, and for no whole number
    if kind == pa.bool_() and (
        pa.types.is_integer(column.type) or pa.types.is_floating(column.type)
    ):
        for value in column.drop_null().unique()[:3].to_pylist():
            if value not in (0, 1):
                raise pa.ArrowInvalid(f"{value:g} is neither 1 (yes) nor 0 (no)")
    return column if column.type == kind else without_nan(column.cast(kind))


def categorical(column: pa.Array) -> pa.Array:
    """Text categories under int32 codes, none of them null or twice there."""
    kind = pa.dictionary(pa.int32(), pa.string())
    if pa.types.is_dictionary(column.type):
        coded = column.cast(kind)
        categories = coded.dictionary
        if not categories.null_count and len(categories.unique()) == len(categories):
            return coded
    return column.cast(pa.string()).dictionary_encode()


def without_nan(column: pa.Array) -> pa.Array:
    """Numbers with null where they were NaN."""
    if not pa.types.is_floating(column.type):
        return column
    return pa.array(column.to_numpy(zero_copy_only=False), from_pandas=True)


_IDENTITIES_KEY, _OWN_KEY = b"evenhand.identities", b"evenhand.own_facts"
_NONE: Mapping[str, pa.DataType] = {}


class Services:
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
            raise InputError(
                f"duplicate {twice}", f"column {twice!r} stands there twice: rename or drop one"
            )
        for name in identities:
            if name in kinds:
                raise InputError(
                    f"duplicate {name}",
                    f"identity {name!r} has the name of a fact: rename the column",
                )
            if name not in types:
                raise InputError(
                    f"missing {name}",
                    f"no column {name!r}: the identities named are {list(identities)}",
                )
            if not pa.types.is_dictionary(types.pop(name)):
                raise InputError(f"type {name}", f"identity column {name!r} is not categorical")
        for name, kind in types.items():
            if name not in kinds:
                raise unknown("fact", name, kinds)
            if kind != kinds[name]:
                raise InputError(
                    f"type {name}", f"column {name!r} holds {kind}, expected {kinds[name]}"
                )
        self._table = table
        self._identities = tuple(identities)
        self._own = {name: kind for name, kind in own.items() if name not in FACTS}

    @classmethod
    def build(
        cls,
        identities: Mapping[str, tuple[np.ndarray, Sequence[str]]],
        facts: Mapping[str, Any],
        own: Mapping[str, pa.DataType] = _NONE,
    ) -> Services:
        """Make a table of services from arrays.

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
            raise InputError("shape columns", f"columns are of unequal length: {lengths}")
        return cls(pa.table(columns), tuple(identities), own)

    @classmethod
    def from_arrow(
        cls,
        table: pa.Table,
        identities: Sequence[str] | None = None,
        own: Mapping[str, pa.DataType] | None = None,
    ) -> Services:
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
                raise InputError(
                    "missing identities", "it is not said which columns are identities: name them"
                )
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
                raise InputError(f"format {name}", f"column {name!r}: {error}") from error
        return cls(pa.table(columns, table.column_names), identities, own)

    def to_arrow(self) -> pa.Table:
        """The Arrow table, with a note of which columns are identities and which facts own."""
        notes = {_IDENTITIES_KEY: "\x1f".join(self._identities).encode()}
        if self._own:
            notes[_OWN_KEY] = note_of(self._own)
        return self._table.replace_schema_metadata(notes)

    @classmethod
    def read_parquet(cls, path: str | os.PathLike[str]) -> Services:
        """Read what :meth:`write_parquet` wrote.

        Raises:
            InputError: when the file is missing, cut off, or not a table of services.
        """
        try:
            table = pq.read_table(path)
        except (OSError, pa.ArrowInvalid) as error:
            raise InputError("format file", f"{path} cannot be read as Parquet: {error}") from error
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
    ) -> Services:
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
            raise InputError("format file", f"{path} cannot be read as CSV: {error}") from error
        return cls._from_file(path, table, identities, own)

    @classmethod
    def _from_file(
        cls,
        path: str | os.PathLike[str],
        table: pa.Table,
        identities: Sequence[str] | None,
        own: Mapping[str, pa.DataType] | None = None,
    ) -> Services:
        try:
            return cls.from_arrow(table, identities, own)
        except InputError as error:
            raise error.at(path) from error

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
            isinstance(other, Services)
            and self._identities == other._identities
            and self._table.equals(other._table)
        )

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        """The table for any library that speaks Arrow: ``polars.from_arrow(services)``."""
        return self._table.__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        facts = [name for name in self.column_names if name not in self._identities]
        return (
            f"{type(self).__name__} with {len(self):,} rows; "
            f"identities: {', '.join(self._identities)}; facts: {', '.join(facts)}"
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

    def take(self, rows: np.ndarray) -> Services:
        """The rows at these indices, or where this mask is true."""
        rows = np.asarray(rows) if np.size(rows) else np.empty(0, np.int64)
        picked = self._table.filter(rows) if rows.dtype == bool else self._table.take(rows)
        return Services(picked, self._identities, self._own)

    @classmethod
    def concat(cls, parts: Sequence[Services]) -> Services:
        """One table after the other.

        Raises:
            InputError: for no part, or parts with other columns.
        """
        if not parts:
            raise InputError("empty tables", "nothing to concatenate")
        if any(part.column_names != parts[0].column_names for part in parts):
            raise InputError("conflict tables", "tables with other columns cannot be put together")
        tables = pa.concat_tables([part._table for part in parts]).unify_dictionaries()
        return cls(tables.combine_chunks(), parts[0].identities, parts[0]._own)


def _write(path: str | os.PathLike[str], write: Callable[[Path], None]) -> None:
    aside = Path(f"{path}.part")
    try:
        write(aside)
        os.replace(aside, path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else error
        raise InputError("unavailable file", f"{path} cannot be written: {reason}") from error
    finally:
        # also after Ctrl-C; after a success there is nothing left to remove
        with contextlib.suppress(OSError):
            aside.unlink()
