"""Columns of services: which facts there are, of which type, and how arrays become columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

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
                f"own fact {name!r} holds {kind}, but the fact of that name holds {FACTS[name]}: "
                "give it another name"
            )
        if name not in FACTS and kind not in OWN_TYPES:
            raise InputError(
                f"own fact {name!r} holds {kind}: choose one of {', '.join(map(str, OWN_TYPES))}"
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
        raise InputError(f"fact {name!r}: {error}") from error


def coded(name: str, codes: Any, categories: Sequence[str]) -> pa.Array:
    """An identity from codes; a code of -1 is null.

    Raises:
        InputError: for codes out of range or not whole, or a category that stands there twice.
    """
    codes = np.asarray(codes)
    whole = codes.dtype.kind in "biu" or not codes.size or (codes == np.round(codes)).all()
    if not whole or (codes.size and (codes.min() < -1 or codes.max() >= len(categories))):
        raise InputError(
            f"identity {name!r}: codes must be whole numbers of -1 to {len(categories) - 1}"
        )
    if len(set(categories)) < len(categories):
        raise InputError(f"identity {name!r} has a category twice: {', '.join(categories)}")
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
