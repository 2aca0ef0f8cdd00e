"""Roles of columns: found by their names, written down, shown."""

import pytest

from evenhand.audits.read.guess_columns import guess
from evenhand.audits.read.mapping import Mapping, describe, limits
from evenhand.audits.read.mapping_file import from_toml
from evenhand.core.errors import InputError
from evenhand.methods.paper.issues import Thresholds
from support.refusals import refused


def columns(*names: str) -> tuple[str, ...]:
    return names


@pytest.mark.parametrize(
    ("column", "role"),
    [
        ("Responded", "responded"),
        ("served", "responded"),
        ("response-time", "response_time"),
        ("waitingTime", "response_time"),
        ("WAIT", "response_time"),
        ("distance", "response_distance"),
        ("Min Distance", "min_distance"),
        ("closest", "min_distance"),
        ("timeout", "waited"),
    ],
)
def test_columns_are_found_by_their_usual_names(column, role):
    assert getattr(guess(columns("race", column)), role) == column


def test_identities_are_found_and_nothing_else_is_taken_for_one():
    found = guess(columns("id", "Age-Group", "skin_tone", "notes", "sex", "answered"))
    assert found.identities == ("Age-Group", "skin_tone", "sex")
    assert found.responded == "answered"


@pytest.mark.parametrize(
    "name",
    ["mobility", "Language", "mobility_aid", "ageGroup", "native-language", "Wheelchair user"],
)
def test_further_identities_are_found_by_their_usual_names(name):
    assert guess(columns("place", name, "responded")).identities == (name,)


def test_units_are_read_off_the_names():
    found = guess(columns("race", "response_time_ms", "distance_cm", "min_distance_cm"))
    assert (found.time_unit, found.distance_unit) == ("ms", "cm")
    # 4 s in milliseconds, 1.5 m in centimetres
    assert (found.limit("late"), found.limit("farthest")) == (4000.0, 150.0)


def test_two_units_are_refused():
    with refused("conflict columns", "'distance_cm'", "'closest_m'"):
        guess(columns("race", "distance_cm", "closest_m"))


def test_what_is_given_is_kept():
    given = Mapping(identities=("notes",), response_time="t", time_unit="min", depth=2)
    found = guess(columns("notes", "race", "t", "wait", "answered_at", "asked_at"), given)
    assert found.identities == ("notes",)
    assert (found.response_time, found.asked_at, found.time_unit) == ("t", None, "min")
    assert found.depth == 2


def test_two_moments_are_found_only_together():
    both = guess(columns("race", "asked_at", "answered_at"))
    assert (both.asked_at, both.answered_at) == ("asked_at", "answered_at")
    assert both.missing == ("willingness", "quality", "risk")
    assert guess(columns("race", "asked_at")).asked_at is None


def test_a_table_of_interactions_is_known():
    found = guess(
        columns("race", "hat", "epoch", "responded", "response_step", "steps", "min_distance")
    )
    assert found.identities == ("race", "hat")
    assert (found.response_time, found.waited, found.time_unit) == (
        "response_step",
        "steps",
        "steps",
    )
    assert found.missing == ("quality",)
    assert found.limit("late") == 200


def test_a_column_that_does_not_exist_is_named_with_the_nearest():
    with refused("unknown column", "'gender'"):
        guess(columns("race", "gender"), Mapping(identities=("gendr",)))


def test_issues_without_a_column_are_missing():
    assert Mapping().missing == ("willingness", "quality", "priority", "risk")
    assert Mapping(responded="a", asked_at="b").missing == ("quality", "priority", "risk")


def test_limits_are_in_metres_and_seconds():
    assert limits() == Thresholds()
    assert limits(late=30).late == 1500
    assert Mapping(thresholds=limits(late=30)).late == 30


def test_a_mapping_is_shown_with_its_units():
    mapping = Mapping(
        identities=("race", "age"),
        bins={"age": (18.0, 65.0)},
        responded="ok",
        response_time="t",
        min_distance="d",
        time_unit="ms",
        measures=("t",),
        within=("site",),
    )
    assert describe(mapping) == [
        ("identity", "race", ""),
        ("identity", "age", "cut at 18, 65"),
        ("responded", "ok", ""),
        ("response time", "t", "ms"),
        ("min distance", "d", "m"),
        ("measure", "t", ""),
        ("stratum", "site", ""),
    ]


@pytest.mark.parametrize(
    ("roles", "sentence"),
    [
        ({"time_unit": "h"}, "unknown unit of time 'h'"),
        ({"distance_unit": "km"}, "unknown unit of distance 'km': did you mean 'm'"),
        ({"depth": 4}, "depth is 4"),
        ({"identities": ("a", "a")}, "'a' is named twice"),
        ({"identities": ("a",), "responded": "a"}, "as identity and as responded"),
        ({"response_time": "t", "asked_at": "f"}, "waiting is given twice"),
        ({"identities": ("a",), "bins": {"b": (1.0,)}}, "unknown identity to bin 'b'"),
        ({"bins": {"b": (2.0, 1.0)}}, "rising numbers"),
        ({"bins": {"b": ()}}, "rising numbers"),
        ({"thresholds": Thresholds(late=0)}, "always late"),
    ],
)
def test_a_mapping_that_contradicts_itself_is_refused(roles, sentence):
    with pytest.raises(InputError) as caught:
        Mapping(**roles)
    assert sentence in str(caught.value)


WRITTEN = """
identities = ["race", "age"]
responded = "ok"
response_time = "t"
time_unit = "ms"
within = ["site"]
depth = 2

[bins]
age = [18, 40.5]

[thresholds]
late = 10.0
risk = 0.3
"""


def test_a_mapping_is_read_from_a_file(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(WRITTEN)
    assert from_toml(path) == Mapping(
        identities=("race", "age"),
        bins={"age": (18.0, 40.5)},
        responded="ok",
        response_time="t",
        time_unit="ms",
        within=("site",),
        depth=2,
        thresholds=Thresholds(late=500.0, risk=0.3),
    )


@pytest.mark.parametrize(
    ("before", "after", "place", "sentence"),
    [
        ("responded =", "respondet =", "line 3, respondet", "did you mean 'responded'"),
        ('"ok"', "3", "line 3, responded", "must be text"),
        ('["site"]', '"site"', "line 6, within", "must be a list of columns"),
        ("depth = 2", "depth = true", "line 7, depth", "whole number"),
        ("[18, 40.5]", '["x"]', "line 10, bins.age", "rising numbers"),
        ("[18, 40.5]", "[40, 18]", "line 10, bins.age", "rising numbers"),
        ("late = 10.0", 'late = "x"', "line 13, thresholds.late", "must be a number"),
        ("late =", "latte =", "line 13, thresholds.latte", "did you mean 'late'"),
        ("depth = 2", "depth = ", "", "no TOML"),
        ("depth = 2", "depth = 9", "", "depth is 9"),
    ],
)
def test_a_mistake_in_the_file_is_named_with_its_place(tmp_path, before, after, place, sentence):
    path = tmp_path / "map.toml"
    path.write_text(WRITTEN.replace(before, after))
    with pytest.raises(InputError) as caught:
        from_toml(path)
    assert str(caught.value).startswith(f"{path}, {place}: " if place else f"{path}")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_of_a_mapping_that_cannot_be_read(tmp_path):
    with refused("unavailable file"):
        from_toml(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    with refused("format file", "8"):
        from_toml(tmp_path / "a.toml")
