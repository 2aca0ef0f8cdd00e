"""Detector files and answer files: exact round trips, and one sentence for every mistake."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.detector_file import load, read_answers, save
from evenhand.methods.paper.detector import Detector
from support.refusals import refused

DETECTOR = Detector(
    issues=("willingness", "quality"),
    identities=("race", "age"),
    mean=(0.1, 1 / 3),
    scale=(0.1 + 0.2, 5e-7),
    components=((0.6, 0.8), (-0.8, 0.6)),
    weights=(3.0000000000000004, -0.0),
    bias=-1e-17,
    kinds=("ageism", "Rassismus: weiß"),
    kind_weights=((0.0, 0.0), (1.1, -2.2)),
    kind_bias=(0.0, 0.7),
    rows=1000,
    source="simulated respondents",
    seed=12,
)


def changed(tmp_path: Path, **changes: object) -> Path:
    """A saved detector with some fields replaced; None as a type removes the field."""
    path = tmp_path / "detector.json"
    save(DETECTOR, path)
    content = json.loads(path.read_text()) | changes
    content = {k: v for k, v in content.items() if v is not NotImplemented}
    path.write_text(json.dumps(content))
    return path


def test_round_trip_keeps_every_bit(tmp_path) -> None:
    save(DETECTOR, tmp_path / "a.json")
    again = load(tmp_path / "a.json")
    assert again == DETECTOR
    assert repr(again) == repr(DETECTOR)  # tells -0.0 from 0.0
    save(again, tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_real_respondents_have_no_seed(tmp_path) -> None:
    path = changed(tmp_path, seed=None, source="respondents")
    assert (load(path).seed, load(path).source) == (None, "respondents")


def test_the_file_is_readable_and_says_what_it_is(tmp_path) -> None:
    save(DETECTOR, tmp_path / "a.json")
    lines = (tmp_path / "a.json").read_text().splitlines()
    assert lines[:4] == [
        "{",
        '  "format": "evenhand-detector",',
        '  "version": 1,',
        '  "issues": ["willingness", "quality"],',
    ]
    assert '  "source": "simulated respondents",' in lines


def test_a_file_cut_off_anywhere_is_refused(tmp_path) -> None:
    path = tmp_path / "detector.json"
    save(DETECTOR, path)
    whole = path.read_bytes()
    assert whole.endswith(b"}\n")
    for length in range(len(whole) - 1):
        path.write_bytes(whole[:length])
        with refused("format file", "detector.json"):
            load(path)
    path.write_bytes(whole[:-1])  # only the last line break is missing
    assert load(path) == DETECTOR


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch) -> None:
    path = tmp_path / "detector.json"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with refused("unavailable file", "detector.json"):
        save(DETECTOR, path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["detector.json"]


def test_places_that_do_not_exist(tmp_path) -> None:
    with refused("unavailable file"):
        save(DETECTOR, tmp_path / "nowhere" / "detector.json")
    with refused("unavailable file"):
        load(tmp_path / "detector.json")
    with refused("unavailable file"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "cut off or is not JSON"),
        (b"[1, 2]", "'format' must be 'evenhand-detector'"),
        (b"{}", "'format' must be 'evenhand-detector'"),
        (b"\x80\x04\x95pickle", r"not text in UTF-8 \(byte 0\)"),
        (b"[" * 100_000, "not a detector"),
        (b'{"rows": ' + b"9" * 5000 + b"}", "not a detector"),
    ],
)
def test_files_of_another_kind(tmp_path, content, match) -> None:
    path = tmp_path / "detector.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=match):
        load(path)


@pytest.mark.parametrize("field", list(DETECTOR.__dataclass_fields__))
def test_every_missing_field_is_named(tmp_path, field) -> None:
    with pytest.raises(InputError, match=rf"detector\.json lacks field '{field}'"):
        load(changed(tmp_path, **{field: NotImplemented}))


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"format": "evenhand-run"}, "'format' must be 'evenhand-detector'"),
        ({"version": 2}, "has version 2, but this Evenhand reads version 1"),
        ({"version": True}, "has version True"),
        ({"version": NotImplemented}, "has version None"),
        ({"wieghts": [1]}, "unknown field 'wieghts': did you mean 'weights'"),
        ({"mean": [0.1]}, "'mean' has 1 numbers where 2 are needed"),
        ({"mean": 0.1}, "'mean' must be a list"),
        ({"mean": [0.1, "0.2"]}, r"'mean\[1\]' must be a number"),
        ({"mean": [0.1, None]}, r"'mean\[1\]' must be a number"),
        ({"mean": [0.1, True]}, r"'mean\[1\]' must be a number"),
        ({"mean": [0.1, float("nan")]}, "'mean' holds a number that is not finite"),
        ({"mean": [0.1, float("inf")]}, "'mean' holds a number that is not finite"),
        ({"bias": 10**400}, "'bias' holds a number that is far too large"),
        ({"components": [[0.6, 0.8]]}, "'weights' has 2 numbers where 1 are needed"),
        ({"components": [[0.6, 0.8], [0.8, 0.6]]}, "'components' does not hold rows"),
        ({"components": [0.6, 0.8]}, r"'components\[0\]' must be a list"),
        ({"kind_weights": [[1, 2]]}, "'kind_weights' has 1 rows for 2 kinds"),
        ({"kinds": ["ageism", ""]}, r"'kinds\[1\]' must be a name"),
        ({"kinds": "ageism"}, "'kinds' must be a list"),
        ({"rows": 10.5}, "'rows' must be a whole number"),
        ({"rows": True}, "'rows' must be a whole number"),
        ({"seed": "12"}, "'seed' must be a whole number"),
        ({"source": 3}, "'source' must be a name"),
        ({"source": "people"}, "unknown source of judgements 'people'"),
    ],
)
def test_wrong_fields_are_named_with_the_file(tmp_path, changes, match) -> None:
    path = changed(tmp_path, **changes)
    with pytest.raises(InputError, match=match) as caught:
        load(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


HEADER = "willingness,quality,priority,risk,biased,discrimination,respondent\n"


def answers(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "answers.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_answers_are_read(tmp_path) -> None:
    read = read_answers(
        answers(
            tmp_path,
            HEADER
            + "0.5,0.25,0.375,0.43,yes,racism,anna\n"
            + "0,1,-0.01,1e-3,No,,ben\n"
            + "\n"
            + ' 0.1 , 0.2 ,0.3,0.4, TRUE ,Ageism,"ben, again"\n'
            + "0,0,0,0,0,none,anna\n",
        )
    )
    np.testing.assert_array_equal(
        read.issue_scores,
        [[0.5, 0.25, 0.375, 0.43], [0, 1, -0.01, 0.001], [0.1, 0.2, 0.3, 0.4], [0] * 4],
    )
    assert read.biased.tolist() == [True, False, True, False]
    assert read.kinds == ("racism", None, "ageism", None)
    assert read.respondents == ("anna", "ben", "ben, again", "anna")


@pytest.mark.parametrize(
    ("spelling", "biased"),
    [(s, True) for s in ("yes", "Y", "true", "True", "t", "1")]
    + [(s, False) for s in ("no", "N", "false", "FALSE", "f", "0")],
)
def test_usual_spellings_of_yes_and_no(tmp_path, spelling, biased) -> None:
    text = f"biased,willingness,quality,priority,risk\n{spelling},0,0,0,0\n"
    assert read_answers(answers(tmp_path, text)).biased.tolist() == [biased]


def test_columns_in_any_order_case_and_company(tmp_path) -> None:
    # As a spreadsheet writes it: a byte order mark, line ends of two characters.
    text = "\ufeffRisk,time,BIASED,Priority,Quality,Willingness\r\n0.4,noon,1,0.3,0.2,0.1\r\n"
    read = read_answers(answers(tmp_path, text))
    np.testing.assert_array_equal(read.issue_scores, [[0.1, 0.2, 0.3, 0.4]])
    assert (read.kinds, read.respondents) == ((None,), None)


def test_answers_about_other_issues(tmp_path) -> None:
    text = "slow,biased,discrimination\n0.5,1,caste\n"
    read = read_answers(answers(tmp_path, text), issues=("slow",), discriminations=("caste",))
    assert (read.issue_scores.tolist(), read.kinds) == ([[0.5]], ("caste",))


def test_own_names_keep_their_spelling(tmp_path) -> None:
    text = "Late,RUDE,biased,discrimination\n0.5,0.1,1,siteism\n"
    read = read_answers(
        answers(tmp_path, text), issues=("Late", "Rude"), discriminations=("Siteism",)
    )
    assert (read.issue_scores.tolist(), read.kinds) == ([[0.5, 0.1]], ("Siteism",))
    with refused("missing Crude", "'Crude'", "'rude'"):
        read_answers(answers(tmp_path, text), issues=("Late", "Crude"))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "lacks column 'willingness'"),
        (HEADER + "0,0,0_1,0,0,,a\n", "line 2, column 'priority': '0_1' is not a number"),
        ("willingness;quality;priority;risk;biased\n", "separate the columns by commas"),
        ("willingness,qualty,priority,risk,biased\n", r"lacks column 'quality' \(is it 'qualty'"),
        (HEADER.replace("biased,", ""), "lacks column 'biased'"),
        (HEADER.replace("respondent", "risk"), "has column 'risk' twice"),
        (HEADER, "has no answers"),
        (HEADER + "0,0,0,0,0,,a\n0,0,x,0,0,,a\n", "line 3, column 'priority': 'x' is not a num"),
        (HEADER + "0,,0,0,0,,a\n", "line 2, column 'quality': the cell is empty"),
        (HEADER + "0,nan,0,0,0,,a\n", "line 2, column 'quality': nan is outside -1 to 1"),
        (HEADER + "0,0,0,49,0,,a\n", "line 2, column 'risk': 49 is outside -1 to 1; .*percent"),
        (HEADER + "0,0,0,0,maybe,,a\n", "line 2, column 'biased': 'maybe' is neither"),
        (HEADER + "0,0,0,0,1,agism,a\n", "line 2, column 'discrimination': .*mean 'ageism'"),
        (HEADER + "0,0,0,0,0,ageism,a\n", "line 2, .*'ageism' is named in a row that says not"),
        (HEADER + "0,0,0,0,1,ageism,\n", "line 2, column 'respondent': the cell is empty"),
        (HEADER + "0,0,0,0\n", "line 2: there are 4 cells where the header has 7"),
        (HEADER + '0,0,0,0,1,ageism,"a\n', "line 2: unexpected end of data"),
        (HEADER.encode() + b"0,0,0,0,1,ageism,\xff\n", "not text in UTF-8"),
    ],
)
def test_mistakes_in_answers_are_told_with_their_place(tmp_path, text, match) -> None:
    path = answers(tmp_path, text)
    with pytest.raises(InputError, match=match) as caught:
        read_answers(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_answers_file(tmp_path) -> None:
    with refused("unavailable file"):
        read_answers(tmp_path / "answers.csv")
