"""Tables of a study's report, as text."""

import pytest

from evenhand.report.table import table
from evenhand.study.analysis.listing import listing

NAN = float("nan")


@pytest.mark.parametrize(("excluded", "way"), [(True, "with"), (False, "without")])
def test_ratings_say_what_their_columns_are(excluded, way):
    names = ("set", "kind", "n", "mean", "low", "high", "biased", "biased_low", "biased_high",
             "other_n", "other_mean")  # fmt: skip
    row = ("late", "scenario", 23, 2.5, 2.25, 2.75, 0.913, 0.732, 0.0077, 22, 2.75)
    found = listing("ratings", table(names, [row]), excluded)
    assert found.heads[6:] == [
        "judged biased", "from", "to", f"n, {way} the flagged", f"mean, {way} the flagged",
    ]  # fmt: skip
    assert found.rows == [
        ["late", "scenario", "23", "2.5", "2.25", "2.75",
         "91.3\xa0%", "73.2\xa0%", "0.8\xa0%", "22", "2.75"],
    ]  # fmt: skip
    assert found.note == ""


def test_why_a_rating_has_no_interval_is_said():
    found = listing("ratings", table(("set", "mean", "low"), [("late", 1.0, NAN)]), False)
    assert found.rows == [["late", "1", "not defined"]]
    assert found.note.startswith("Where all ratings are the same they have no interval")


def test_numbers_that_are_no_shares_stay():
    rows = [(f"set-{k}", 0.25) for k in range(70)]
    found = listing("controls", table(("set", "low"), rows), False)
    assert found.rows[0] == ["set-0", "0.25"]
    shares = listing("early", table(("set", "low"), rows), False)
    assert shares.rows[0] == ["set-0", "25.0\xa0%"]
    assert len(shares.rows) == 60
    assert shares.note == "The first 60 of 70 rows; all are in the CSV file."
