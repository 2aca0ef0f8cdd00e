"""What is refused: the kind and the field of the error, not its English."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from evenhand.core.errors import InputError


@contextmanager
def refused(code: str, *named: str) -> Iterator[pytest.ExceptionInfo[InputError]]:
    """The block must raise an error of this kind and field.

    Args:
        code: kind, a space, field.
        named: values, names and places that its sentence must hold.
    """
    with pytest.raises(InputError) as caught:
        yield caught
    error = caught.value
    assert f"{error.kind} {error.field}" == code, error
    lacking = [text for text in named if text not in str(error)]
    assert not lacking, f"{error} does not name {', '.join(lacking)}"
