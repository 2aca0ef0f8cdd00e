"""What is asked of the infos of ended episodes, and what is kept of them."""

from collections.abc import Mapping
from threading import Lock
from typing import Any

import numpy as np
import pytest

from evenhand.adapters import Ended
from evenhand.adapters.episodes import Info, kept, together

NAN = np.nan


def ended(*infos: Info, first: Info | None = None) -> Ended:
    n = len(infos)
    return Ended(
        episode=np.arange(n),
        lane=np.zeros(n, np.int64),
        reward=np.zeros(n),
        steps=np.ones(n, np.int64),
        terminated=np.ones(n, bool),
        truncated=np.zeros(n, bool),
        observation=np.zeros(n),
        people=None,
        raw=[(info, first or {}, -1) for info in infos],
    )


class TestValues:
    def test_numbers_are_numbers_and_nan_where_missing(self):
        found = ended({"x": 1}, {}, {"x": np.float32(2.5)}).info("x")
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found, [1.0, NAN, 2.5])
        assert ended({"x": 1}, {"x": 2}).info("x").dtype.kind == "i"
        assert ended({"x": 1}, {}).info("x", missing=-1).tolist() == [1, -1]

    def test_text_stays_text_and_what_is_missing_is_none(self):
        assert ended({"who": "a"}, {}, {"who": "bcd"}).info("who").tolist() == ["a", None, "bcd"]
        found = ended({"who": "a"}, {"who": "b"}).info("who")
        assert (found.dtype, found.tolist()) == (np.dtype(object), ["a", "b"])
        assert ended({"who": "a"}, {}).info("who", missing="b").tolist() == ["a", "b"]

    def test_arrays(self):
        one, two = np.array([1.0, 2.0]), np.array([3.0, 4.0])
        np.testing.assert_array_equal(ended({"at": one}, {"at": two}).info("at"), [one, two])
        found = ended({"at": one}, {}, {"at": np.ones(3)}).info("at")
        assert (found.shape, found[1]) == ((3,), None)
        np.testing.assert_array_equal(found[0], one)
        np.testing.assert_array_equal(found[2], np.ones(3))

    def test_names_in_nested_infos_and_names_with_dots(self):
        info = {"TimeLimit.truncated": True, "end": {"delay": 0.5, "a.b": 3, "a": {"b": 4}}}
        assert ended(info).info("TimeLimit.truncated").tolist() == [True]
        assert ended(info).info("end.delay").tolist() == [0.5]
        assert ended(info).info("end.a.b").tolist() == [3]
        for name in ("end.delay.x", "end.lack", "lack.delay", "TimeLimit"):
            np.testing.assert_array_equal(ended(info).info(name), [NAN])
        assert ended({}, first=info).first_info("TimeLimit.truncated").tolist() == [True]


class TestCopies:
    def test_what_an_environment_writes_later_is_not_seen(self):
        rows: list[Any] = [1, [2]]
        info = {"number": 1, "array": np.zeros(2), "inner": {"text": "a", "rows": rows}}
        copy = kept(info)
        info["number"], info["inner"]["text"] = 2, "b"
        info["array"] += 1
        rows[1].append(3)
        np.testing.assert_array_equal(copy.pop("array"), [0, 0])
        assert copy == {"number": 1, "inner": {"text": "a", "rows": [1, [2]]}}

    def test_what_has_no_copy_stays(self):
        lock, numbers = Lock(), (number for number in [1])
        copy = kept({"lock": lock, "inner": {"numbers": numbers, "x": 1}})
        assert copy["lock"] is lock
        assert isinstance(copy["inner"], Mapping)
        assert copy["inner"]["numbers"] is numbers


@pytest.mark.parametrize(
    ("observations", "shape"),
    [
        ([np.ones(2), np.zeros(2)], (2, 2)),
        ([1, np.int64(2), 0.5], (3,)),
        ([np.ones(2), np.ones(3)], None),
        ([np.ones((1, 2)), np.ones((2, 2))], None),
        ([np.ones(2), 1.0], None),
        ([{"a": 1}, {"a": 2}], None),
        ([np.ones(2), None], None),
    ],
)
def test_observations_stand_in_one_array_where_that_can_be(observations, shape):
    found = together(observations)
    if shape is None:
        assert isinstance(found, list)
        assert all(a is b for a, b in zip(found, observations, strict=True))
    else:
        assert found.shape == shape
        np.testing.assert_array_equal(found, np.array(observations))
