"""Results as data frames of pandas, for those who have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from evenhand.core.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def data_frame(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Rows as a data frame, a column for each name.

    Raises:
        InputError: where pandas is not installed.
    """
    try:
        import pandas as pd
    except ModuleNotFoundError:
        raise InputError(
            "unavailable pandas",
            "data frames need the package pandas, which is not installed: pip install pandas",
        ) from None
    return pd.DataFrame(list(rows))
