"""Studies read from files: every mistake, with its line."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.core.toml_file import line_of, lines
from evenhand.study.design import protocol_file
from evenhand.study.design.protocol import Option
from evenhand.study.design.protocol_file import PAPER, examine, read, unfinished
from support.refusals import refused
from support.studies import FILM, WEBM

GOOD = """\
format = 1
[study]
name = "tiny"
title = "Tiny"
length = 1
completion_code = "C0DE"
redirect = "https://recruit.example/?cc={code}"
[consent]
version = "1"
text = \"\"\"
[[sets]] is not a table here,
nor is title = 3.\"\"\"
[[demographics]]
id = "years"
ask = "How old?"
options = ["young", "old"]
[[sets]]
id = "s1"
clips = [
  "a.mp4", # ]
  "b.webm",
]
captions = ["A.", "B."]
note = "for the lead"
[sets.scores]
race = [0.5, 0, 0, -0.1]
[[sets]]
id = "s2"
clips = ["c.mp4"]
kind = "control"
[[questions]]
id = "fair"
ask = "How fair?"
type = "scale"
role = "fair"
points = 5
low = "unfair"
high = "fair"
[[questions]]
id = "worst"
ask = "Which?"
type = "choice"
role = "issue"
options = [
  { value = "risk", label = "Too close" },
  { value = "none", label = "None" },
]
[[questions]]
id = "even"
ask = "Which robot?"
type = "pair"
role = "pair"
about = "pair"
[[pairs]]
id = "p"
first = "s1"
second = "s2"
[[checks]]
id = "look"
ask = "Choose blue."
options = ["red", "blue"]
right = "blue"
after = 1
"""


@pytest.fixture
def file(tmp_path):
    def write(text: str) -> Path:
        for name in ("a.mp4", "b.webm", "c.mp4"):
            (tmp_path / "clips").mkdir(exist_ok=True)
            (tmp_path / "clips" / name).write_bytes(WEBM if name == "b.webm" else FILM)
        path = tmp_path / "s.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def wrong(path: Path) -> list[str]:
    study, found = examine(path)
    assert (study is None) == bool(found)
    return [str(one) for one in found]


def line(text: str, of: str) -> int:
    """The first line that begins so."""
    return next(i for i, one in enumerate(text.splitlines(), 1) if one.startswith(of))


def test_a_whole_study(file):
    study = read(file(GOOD))
    assert (study.name, study.judged, study.clip_names) == (
        "tiny", 1, ("a.mp4", "b.webm", "c.mp4"),
    )  # fmt: skip
    assert study.sets[0].scores == {"race": (0.5, 0.0, 0.0, -0.1)}
    assert study.sets[0].captions == ("A.", "B.")
    assert [one.kind for one in study.sets] == ["scenario", "control"]
    assert study.questions[0].lowest_is_unfair is True
    assert study.questions[1].options == (Option("risk", "Too close"), Option("none", "None"))
    # a comparison brings its own answers
    assert [one.value for one in study.questions[2].options] == ["first", "second", "same"]
    assert (study.order, study.language, study.checks[0].after) == ("latin", "en", 1)
    assert study.clips.name == "clips"


def test_windows_line_ends_and_a_byte_order_mark(file, tmp_path):
    path = file(GOOD)
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert read(path).consent == "[[sets]] is not a table here,\nnor is title = 3."


MISTAKES = [
    ('name = "tiny"', 'name = "Tiny!"', "study.name: 'Tiny!' does not fit: give a-z, 0-9 and"),
    ('title = "Tiny"', "title = 3", 'study.title: it is 3: give text, in quotes "..."'),
    ('title = "Tiny"', 'title = " "', "study.title: it is empty"),
    ('title = "Tiny"', f'title = "{"x" * 201}"', "study.title: it has 201 characters: give at m"),
    ('title = "Tiny"', 'title = "a\\u0007"', "study.title: it holds a control character"),
    ("length = 1", "length = 3", "study.length: 3 sets are to be judged, but there are 2"),
    ("length = 1", "length = true", "study.length: it is True: give a whole number from 0 to"),
    ("length = 1", "lenght = 1", "study.lenght: unknown key 'lenght': did you mean 'length'?"),
    ("length = 1", 'order = "latn"', "unknown order 'latn': did you mean 'latin'?"),
    ('redirect = "https', 'redirect = "http', "study.redirect: 'http://recruit.example/?cc={cod"),
    ('completion_code = "C0DE"', "", "it holds {code}, but there is no completion_code: add one"),
    (
        "cc={code}",
        "cc={code}{cod}",
        "redirect: it holds {cod}, which nothing is put for: write {code}",
    ),
    (
        "length = 1",
        "shared_computer = true",
        "nobody else could begin where everybody is sent on to redirect: leave one of them out",
    ),
    ("length = 1", "shared_computer = 1", "study.shared_computer: it is 1: give true or false"),
    ('version = "1"', "", "consent: version is missing: add it"),
    ('options = ["young", "old"]', 'options = ["a", "a"]', "demographics 1.options: an option st"),
    (
        'options = ["young", "old"]',
        'options = ["Prefer not to say"]',
        "'Prefer not to say' is always added: leave it out",
    ),
    ('id = "years"', 'id = "s2"', "id 's2' is taken in demographics: ids are unique"),
    ('captions = ["A.", "B."]', 'captions = ["A."]', "1 captions stand beside 2 clips"),
    ("race = [0.5, 0, 0, -0.1]", "race = [2, 0, 0, 0]", "scores.race: give four scores from -1 to"),
    ("race = [0.5, 0, 0, -0.1]", "race = [0, 0, 0]", "scores.race: give four scores from -1 to 1:"),
    ("race = [0.5, 0, 0, -0.1]", "rase = [0, 0, 0, 0]", "unknown key 'rase': did you mean 'race'?"),
    ('clips = ["c.mp4"]', 'clips = ["../c.mp4"]', "item 1: '../c.mp4' does not fit: give names of"),
    ('clips = ["c.mp4"]', "clips = []", "clips: give 1 to 20 texts"),
    ('clips = ["c.mp4"]', 'clips = ["d.mp4"]', "sets 2.clips: d.mp4 is not in the folder"),
    ('kind = "control"', 'kind = "even"', "unknown kind 'even'"),
    ('type = "scale"', 'type = "scael"', "unknown type 'scael': did you mean 'scale'?"),
    ('role = "pair"', 'role = "free"', "questions 3.type: role 'free' needs type text"),
    ("points = 5", "points = 12", "points: it is 12: give a whole number from 2 to 11"),
    ("points = 5", "longest = 12", "unknown key 'longest'"),
    ('role = "fair"', 'role = "fair"\nabout = "end"', 'needs about = "set"'),
    ('about = "pair"', 'about = "set"', "type 'pair' with role 'pair' needs about = \"pair\""),
    ('value = "risk"', 'value = "danger"', "value 'danger' is none of willingness, quality, prior"),
    ('value = "risk"', 'value = "none"', "questions 2.options: a value stands twice"),
    ('value = "risk"', 'value = "a|b"', "'a|b' does not fit: give no blank, no |"),
    ('value = "risk", ', "", "options 1: value is missing: add it"),
    ('second = "s2"', 'second = "s3"', "'s3' is no set: name one of s1, s2"),
    ('second = "s2"', 'second = "s1"', "a set is compared with itself: name two sets"),
    ('right = "blue"', 'right = "green"', "'green' is none of its options: name one of red, bl"),
    ("after = 1", "after = 2", "it would come after set 2, but 1 are judged"),
    ("format = 1", "format = 2", "format: it is 2: give 1"),
    ("[consent]", "[consnet]", "unknown key 'consnet': did you mean 'consent'?"),
]


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES)
def test_a_mistake_is_told_with_its_line(file, old, new, said):
    assert old in GOOD
    changed = GOOD.replace(old, new, 1)
    told = [one for one in wrong(file(changed)) if said in one]
    assert len(told) == 1
    number = int(told[0].split()[1].rstrip(",:"))
    rows, where = changed.splitlines(), GOOD[: GOOD.index(old)].count("\n")
    expected = next((start for words, start in ELSEWHERE.items() if words in said), None)
    assert rows[number - 1].startswith(expected or rows[where])


ELSEWHERE = {
    "options 1: value is missing": "options = [",
    "is missing": "[consent]",
    "but there is no completion_code": "redirect =",
    "is taken in": 'id = "s2"',
    "needs about": "about =",
    "needs type": 'type = "pair"',
    "is none of willingness": "options = [",
    "a value stands twice": "options = [",
    "'a|b'": "options = [",
}
"""Mistakes that are told at another line than the one changed: that of the table or the list."""


def test_all_mistakes_are_told_at_once_in_order(file):
    text = GOOD
    for old, new in (("length = 1", "x = 1"), ("points = 5", "points = 0"),
                     ('second = "s2"', 'second = "no"'), ("after = 1", 'after = "1"')):  # fmt: skip
        text = text.replace(old, new, 1)
    found = wrong(file(text))
    at = [line(text, start) for start in ("x = 1", "points = 0", 'second = "no"', 'after = "1"')]
    assert [int(one.split()[1].rstrip(",:")) for one in found] == at


def test_what_only_follows_from_another_mistake_is_not_told(file):
    # without its id, the set cannot be found by the pair; that says nothing about the pair
    assert len(wrong(file(GOOD.replace('id = "s1"', 'id = "S 1"', 1)))) == 1
    # nor is a key of a scale unknown when the type is misspelt
    assert len(wrong(file(GOOD.replace('type = "scale"', 'type = "scael"')))) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format = 1\n[study\n", "line 2: this is no TOML: Expected ']' at the end of a table"),
        ("a = 1\na = 2\n", "line 2: this is no TOML: Cannot overwrite a value"),
        ('x = """\n\n', "line 3: this is no TOML: Unterminated string"),
        ("x = " + "[" * 5000, "this is no TOML"),
        ("", "line 1: format is missing: add it"),
        ("study = 3", "line 1, study: write it as a table, [study]"),
        ("sets = 3", "line 1, sets: write each as a table, [[sets]]"),
        ("sets = [3]", "line 1, sets: write each as a table, [[sets]]"),
    ],
)
def test_files_that_are_no_study(file, text, said):
    assert any(said in one for one in wrong(file(text)))


def test_a_file_that_cannot_be_read(tmp_path):
    with refused("unavailable file", "none.toml"):
        read(tmp_path / "none.toml")
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe")
    with refused("format file", "8"):
        read(tmp_path / "x.toml")


def test_to_serve_the_first_mistake_is_told_and_where_the_others_are(file):
    path = file(GOOD.replace('"c.mp4"', '"d.mp4"').replace("after = 1", "after = 9"))
    with refused("format file", "29", "2"):
        read(path)


@given(st.text(max_size=300))
def test_any_text_is_a_study_or_explained(text):
    # no shared folder is written: the text goes to one of its own
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "s.toml"
        path.write_text(text, encoding="utf-8", errors="replace", newline="")
        study, found = examine(path)
        assert study is None
        assert found


_PARTS = st.sampled_from(
    ["[[sets]]", "[sets.scores]", "[study]", "a = 1", "'b c' = [", "]", '"d" = """', '"""',
     "#[[x]]", "e.f = { g = 1 }", "h = [[1], [2]]", "", "x"]
)  # fmt: skip


@given(st.lists(_PARTS, max_size=12).map("\n".join))
def test_every_key_of_any_toml_has_a_line(text):
    import tomllib

    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    found = lines(text)
    rows = text.split("\n")

    def look(table: dict, place: tuple) -> None:
        for key, value in table.items():
            at = found.get((*place, key))
            if at is None:  # inside an inline table: the key around it has one
                assert line_of(found, (*place, key)) > 1 or rows[0]
                continue
            assert key in rows[at - 1]
            if isinstance(value, dict):
                look(value, (*place, key))
            elif isinstance(value, list) and value and isinstance(value[0], dict):
                for number, one in enumerate(value):
                    look(one, (*place, key, number))

    look(content, ())


# --- the paper's study ---


def test_the_papers_study_has_what_the_paper_tells():
    study, found = examine(PAPER, look=False)
    assert found == []
    assert study is not None
    scenarios = [one for one in study.sets if one.kind == "scenario"]
    seen = [re.search(r"scenario (\d) of the paper, (\w+)", one.note) for one in scenarios]
    assert sorted(match.groups() for match in seen if match) == [
        ("1", "willingness"), ("2", "quality"), ("3", "priority"), ("4", "risk"),
    ]  # fmt: skip
    controls = [one for one in study.sets if one.kind == "control"]
    assert len(controls) == 4
    assert all(set(score) == {0.0} for one in controls for score in one.scores.values())
    assert [one.role for one in study.asked("set")] == ["fair", "issue", "identity", "free"]
    assert (len(study.pairs), len(study.checks)) == (1, 2)
    # nobody can agree to a template
    assert len(unfinished(study)) >= 5
    assert all(len(one.captions) == len(one.clips) == 2 for one in study.sets)


def test_nothing_that_participants_see_tells_what_is_even():
    study, _ = examine(PAPER, look=False)
    assert study is not None
    for one in study.sets:
        assert not re.search("even|control|bias|scen|rac|able|age", f"{one.id} {one.clips}")


def test_the_fingerprint_covers_what_answers_mean_and_nothing_else(file):
    from dataclasses import replace

    study = read(file(GOOD))
    same = replace(study, thanks="Bye.", contact="me", clips=Path("x"), minutes=1)
    assert same.fingerprint() == study.fingerprint()
    noted = replace(study.sets[0], note="", scores={})
    assert replace(study, sets=(noted, study.sets[1])).fingerprint() == study.fingerprint()
    for changed in (
        replace(study, consent="Other."),
        replace(study, seed=1),
        replace(study, sets=study.sets[::-1]),
        replace(study, questions=(replace(study.questions[0], points=7), *study.questions[1:])),
    ):
        assert changed.fingerprint() != study.fingerprint()


def test_the_formats_number_is_the_one_that_is_read():
    assert f"format = {protocol_file.FORMAT}\n" in PAPER.read_text()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("c.mp4", b"GIF89a, and some more", "sets 2.clips: c.mp4 is no MP4 film, and browsers"),
        ("c.mp4", b"", "sets 2.clips: c.mp4 is no MP4 film"),
        ("c.mp4", WEBM, "sets 2.clips: c.mp4 is no MP4 film"),
        ("b.webm", FILM, "sets 1.clips: b.webm is no WebM film"),
    ],
)
def test_a_clip_that_is_no_film(file, tmp_path, name, content, said):
    path = file(GOOD)
    (tmp_path / "clips" / name).write_bytes(content)
    (told,) = wrong(path)
    assert said in told
    # what was answered can be read all the same
    assert examine(path, look=False)[1] == []
