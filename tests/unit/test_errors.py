"""What is said of wrong input."""

import pytest

from evenhand.errors import InputError, nearest, unknown


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


def test_wrong_input_is_a_value_error():
    assert issubclass(InputError, ValueError)
