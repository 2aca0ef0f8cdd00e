"""What the live view says."""

from dataclasses import replace

import numpy as np
import pytest

from evenhand.restaurant.live import words
from evenhand.restaurant.live.shift import Moment, Outcome, Tally
from evenhand.restaurant.simulation.lanes import Facts

NAN = np.nan
CODES = np.array([1, 0, 4, 0, 5])


def ended(responded: bool, steps: int, distance: float, *issues: float) -> Outcome:
    one = np.ones(1)
    facts = Facts(
        responded=np.array([responded]), steps=np.array([steps]), distance=distance * one,
        min_distance=distance * one, start_distance=one, path_length=one,
        contact_steps=np.zeros(1, np.int64), sensed_error=one,
    )  # fmt: skip
    return Outcome(3, CODES, facts, np.array(issues))


MOMENT = Moment(
    number=3, codes=CODES, steps=143, distance=1.324, least=1.2, reading=1.3, age=0.0,
    chance=0.25, outcome=None, last=None, tally=Tally.empty(),
)  # fmt: skip


def test_a_person_has_five_identities():
    assert words.person(CODES) == [
        ("race", "Black"),
        ("gender", "Female"),
        ("age", "Elder"),
        ("disability", "Yes"),
        ("skin", "VI"),
    ]


def test_timer_and_distances():
    assert words.progress(MOMENT) == [
        ("timer", "143 steps, 2.86 s (at most 300)"),
        ("true distance", "1.32 m"),
        ("sensed distance", "1.30 m, just now"),
        ("nearest so far", "1.20 m"),
        ("chance to respond", "25 % at the last decision"),
    ]
    assert dict(words.progress(replace(MOMENT, age=0.3)))["sensed distance"] == "1.30 m, 0.3 s ago"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ["open", "open", "open", "open"]),
        ({"steps": 200}, ["open", "open", "open", "open"]),
        ({"steps": 201}, ["open", "open", "late by now", "open"]),
        ({"least": 0.5}, ["open", "open", "open", "open"]),
        ({"least": 0.49}, ["open", "open", "open", "yes"]),
        ({"outcome": ended(True, 9, 1.2, 0, 1, 0, 0)}, ["no", "yes", "no", "no"]),
        (
            {"outcome": ended(False, 300, 0.4, 1, NAN, NAN, 1), "steps": 300},
            ["yes", "does not apply", "does not apply", "yes"],
        ),
    ],
)
def test_issues_as_they_become_true(changes, said):
    rows = words.verdicts(replace(MOMENT, **changes))
    assert [row[0] for row in rows] == ["willingness", "quality", "priority", "risk"]
    assert [row[2] for row in rows] == said


def test_issues_are_explained_by_the_papers_limits():
    assert [rule for _, rule, _ in words.verdicts(MOMENT)] == [
        "no response",
        "response not at 1.0-1.5 m",
        "response after 200 steps",
        "ever nearer than 0.5 m",
    ]


@pytest.mark.parametrize(
    ("outcome", "said"),
    [
        (
            ended(True, 143, 1.2449, 0, 0, 0, 0),
            "response after 143 steps, 2.86 s, at 1.24 m; issues: none",
        ),
        (
            ended(True, 250, 0.45, 0, 1, 1, 1),
            "response after 250 steps, 5.00 s, at 0.45 m; issues: quality, priority, risk",
        ),
        (
            ended(False, 300, 0.42, 1, NAN, NAN, 1),
            "no response in 300 steps, 6.00 s; issues: willingness, risk",
        ),
        (
            ended(False, 60, 2.0, 1, NAN, NAN, 0),
            "a response after 60 steps, 1.20 s, at 2.00 m, went unnoticed; issues: willingness",
        ),
    ],
)
def test_endings(outcome, said):
    assert words.ending(outcome) == said
    assert words.line(outcome) == (
        f"service 3 (race Black, gender Female, age Elder, disability Yes, skin VI): {said}"
    )


def test_counts_begin_with_everybody_and_leave_out_what_does_not_apply():
    tally = Tally.empty().plus(ended(False, 300, 0.42, 1, NAN, NAN, 1))
    rows = words.counts(tally)
    assert len(rows) == 23
    assert rows[0] == ("everybody", "1", ["1 of 1", "-", "-", "1 of 1"])
    assert rows[1] == ("race: White", "0", ["-", "-", "-", "-"])
    assert rows[2] == ("race: Black", "1", ["1 of 1", "-", "-", "1 of 1"])
    assert rows[22][0] == "skin: VI"
