"""Columns of Arrow as NumPy arrays. Arrow's own way loads pandas: half a second of an audit."""

from __future__ import annotations

import numpy as np
import pyarrow as pa


def floats(column: pa.ChunkedArray) -> np.ndarray:
    """Numbers, or true and false as 1 and 0; NaN for null, float64 [n].

    Args:
        column: numbers or booleans, [n].
    """
    whole = column.combine_chunks()
    if pa.types.is_boolean(whole.type):
        whole = whole.cast(pa.int8())
    whole = whole.cast(pa.float64())
    if not whole.null_count:
        return np.from_dlpack(whole)
    known = np.from_dlpack(whole.is_valid().cast(pa.int8())) == 1
    # what lies in the cells of nulls is not defined
    cells = np.frombuffer(whole.buffers()[1], np.float64, len(whole), 8 * whole.offset)
    return np.where(known, cells, np.nan)


def integers(column: pa.ChunkedArray | pa.Array) -> np.ndarray:
    """Whole numbers without nulls, int64 [n]; booleans as 0 and 1."""
    whole = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if pa.types.is_boolean(whole.type):
        whole = whole.cast(pa.int8())
    return np.from_dlpack(whole.cast(pa.int64()))
