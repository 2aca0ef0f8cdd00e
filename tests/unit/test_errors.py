"""What is said of wrong input."""

import numpy as np
import pytest

from evenhand.core.errors import InputError, nearest, unknown, whole


@pytest.mark.parametrize(
    ("name", "found"),
    [("unifrm", "uniform"), ("US", "us"), ("fair face", "fairface"), ("zzz", None), ("", None)],
)
def test_nearest(name, found):
    assert nearest(name, ["uniform", "us", "fairface"]) == found


def test_unknown_says_kind_name_guess_and_choices():
    assert str(unknown("robot", "racst", ["even", "racist"])) == (
        "unknown robot 'racst': did you mean 'racist'? choose one of even, racist"
    )


def test_unknown_guesses_nothing_where_nothing_comes_close():
    assert str(unknown("robot", "q", ["even", "racist"])) == (
        "unknown robot 'q': choose one of even, racist"
    )


def test_choices_are_taken_from_any_iterable():
    assert "choose one of a, b" in str(unknown("letter", "c", (x for x in "ab")))


@pytest.mark.parametrize("value", [0, 11, 5.0, 5.5, float("nan"), "5"])
def test_a_number_that_is_not_whole_or_out_of_range(value):
    with pytest.raises(InputError, match=f"size is {value}: give a whole number from 1 to 10"):
        whole("size", value, 1, 10)


@pytest.mark.parametrize("value", [1, 10, np.int64(5)])
def test_a_whole_number(value):
    whole("size", value, 1, 10)


def test_wrong_input_is_a_value_error():
    assert issubclass(InputError, ValueError)
