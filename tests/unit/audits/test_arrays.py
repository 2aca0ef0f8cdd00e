import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from evenhand.audits.count.arrow_arrays import floats, integers

NAN = float("nan")


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ([[True, None], [False]], [1.0, NAN, 0.0]),
        ([[1, None], [3]], [1.0, NAN, 3.0]),
        ([pa.nulls(2)], [NAN, NAN]),
        ([pa.array([0.5, None, 2.0]).slice(1)], [NAN, 2.0]),
        ([pa.array([], pa.int16())], []),
    ],
)
def test_numbers_and_answers_become_floats_with_nan_for_null(column, expected):
    found = floats(pa.chunked_array(column))

    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, expected)


def test_whole_numbers_keep_all_their_digits():
    great = 2**53 + 1

    found = integers(pa.chunked_array([[1], [great]]))

    assert found.dtype == np.int64
    assert found.tolist() == [1, great]
    assert integers(pa.array([True, False])).tolist() == [1, 0]


def test_an_audit_does_without_pandas(tmp_path: Path):
    log = tmp_path / "log.csv"
    rows = "".join(
        f"{'child' if i % 3 else 'adult'},{'yes' if i % 7 else 'no'}\n" for i in range(90)
    )
    log.write_text("age,responded\n" + rows)
    code = (
        "import sys; from evenhand.audits import api; "
        f"found = api.audit({str(log)!r}); found.save({str(tmp_path / 'out.json')!r}); "
        "sys.exit('pandas' in sys.modules)"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
