"""`evenhand detect`: files that cannot be right, and the way from demonstrations to a detector."""

import json
import time
from pathlib import Path

import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.methods.detector_file import SHIPPED
from evenhand.methods.services import Services
from evenhand.training import run_folder, train
from evenhand.training.settings import settings_of
from support.refusals import refused

ANSWERS = """willingness,quality,priority,risk,biased,discrimination,respondent
0.1,0.1,0.0,0.0,no,,ann
0.0,0.2,0.1,0.0,no,,bob
0.1,0.0,0.0,0.1,no,none,cid
0.2,0.1,0.0,0.0,no,,dot
0.0,0.0,0.1,0.1,no,,eve
0.5,0.3,0.4,0.4,yes,racism,ann
0.6,0.2,0.3,0.5,yes,racism,bob
0.4,0.7,0.5,0.5,yes,ageism,cid
0.1,0.7,0.0,0.0,yes,ableism,dot
0.4,0.6,0.6,0.4,yes,ageism,eve
"""

WRONG_ANSWERS = [
    ("0.5,0.3,0.4", "0.5,x,0.4", "line 7, column 'quality': 'x' is not a number"),
    ("0.5,0.3,0.4", "0.5,,0.4", "line 7, column 'quality': the cell is empty"),
    ("0.5,0.3,0.4", "0.5,nan,0.4", "line 7, column 'quality': nan is outside -1 to 1"),
    ("0.5,0.3,0.4", "50,30,40", "line 7, column 'willingness': 50 is outside -1 to 1"),
    ("yes,racism,ann", "maybe,racism,ann", "line 7, column 'biased': 'maybe' is neither yes nor"),
    ("yes,racism,ann", "yes,rascism,ann", "did you mean 'racism'? choose one of racism,"),
    ("yes,racism,ann", "no,racism,ann", "'racism' is named in a row that says not biased"),
    ("yes,racism,ann", "yes,racism", "line 7: there are 6 cells where the header has 7"),
    ("yes,racism,ann", "yes,racism,", "line 7, column 'respondent': the cell is empty"),
    ("willingness,", "wilingness,", "lacks column 'willingness' (is it 'wilingness'?)"),
    ("yes", "no", "is named in a row that says not biased"),
    (ANSWERS, "", "lacks column 'willingness'"),
    (ANSWERS, ANSWERS.splitlines()[0], "has no answers: give one row for each judged window"),
    (ANSWERS, "\n".join(ANSWERS.splitlines()[:6]), "are not biased: the detector needs examples"),
    ("eve\n", "ann\n", "4 respondents cannot be dealt into 5 folds"),
    ("\n0.4,0.6,0.6,0.4,yes,ageism,eve", "", "the rarer answer was given 4 times: 5 folds need it"),
]


@pytest.mark.parametrize(("right", "wrong", "said"), WRONG_ANSWERS)
def test_wrong_answers(cli, tmp_path, right, wrong, said):
    assert right in ANSWERS
    (tmp_path / "answers.csv").write_text(ANSWERS.replace(right, wrong))
    complaint = cli("detect", "fit", "--answers", "answers.csv", "--out", "d.json").complaint
    assert complaint.startswith("answers file answers.csv")
    assert said in complaint
    assert not (tmp_path / "d.json").exists()


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("answers.csv/d.json", "answers.csv is a file, not a folder: give another one"),
        ("/proc/d.json", "folder /proc cannot be written (No such file or directory)"),
        (".", ". is a folder: give the name of a file"),
    ],
)
def test_a_detector_that_cannot_be_written(cli, tmp_path, out, said):
    (tmp_path / "answers.csv").write_text(ANSWERS)
    assert said in cli("detect", "fit", "--answers", "answers.csv", "--out", out).complaint


def test_answers_of_people_become_a_detector(cli, tmp_path):
    (tmp_path / "answers.csv").write_text(ANSWERS)
    ended = cli("detect", "fit", "--answers", "answers.csv", "--out", "new/d.json")
    assert (ended.code, ended.err) == (0, "")
    assert "Detector fitted to 10 judgements of respondents, out of fold" in ended.out
    fitted = detector_file.load(tmp_path / "new" / "d.json")
    assert (fitted.rows, fitted.source) == (10, "respondents")
    assert fitted.kinds == ("ableism", "ageism", "racism")
    scores = ("0.1", "0.7", "0", "0")
    shown = cli("detect", "judge", "--scores", *scores, "--detector", "new/d.json")
    assert "respondents" in shown.out
    assert "ableism" in shown.out


def spoil(**changes):
    return json.dumps(json.loads(SHIPPED.read_text()) | changes)


WRONG_DETECTORS = [
    (None, "cannot read detector file d.json: No such file or directory"),
    (SHIPPED.read_text()[:300], "detector file d.json is cut off or is not JSON: line "),
    ("[]", "detector file d.json is not a detector: field 'format' must be"),
    (spoil(mean=[1, 2, 3]), "field 'mean' has 3 numbers where 4 are needed"),
    (spoil(mean=[1, 2, 3, "x"]), "field 'mean[3]' must be a number"),
    (spoil(scale=[1, 1, 1, 0]), "field 'scale' holds a number that is not positive"),
    (spoil(bias=1e999), "field 'bias' holds a number that is not finite or far too large"),
    (spoil(bias=float("nan")), "field 'bias' holds a number that is not finite"),
    (spoil(threshold=1.5), "field 'threshold' is 1.5: it must lie between 0 and 1"),
    (spoil(components=[[1, 0, 0, 0]] * 3), "field 'components' does not hold rows of"),
    (spoil(source="robots"), "unknown source of judgements 'robots'"),
    (spoil(version=9), "has version 9, but this Evenhand reads version 1"),
]


@pytest.mark.parametrize(("content", "said"), WRONG_DETECTORS)
@pytest.mark.parametrize(
    "words", [("detect", "judge", *("--scores", *"0000")), ("train", "--out", "run")]
)
def test_a_detector_file_that_cannot_be_right(cli, tmp_path, words, content, said):
    if content is not None:
        (tmp_path / "d.json").write_text(content)
    complaint = cli(*words, "--detector", "d.json").complaint
    assert said in complaint
    assert "detector file d.json" in complaint
    assert not (tmp_path / "run").exists()


ISSUES = ("willingness", "quality", "priority", "risk")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"issues": ["risk", "quality", "priority", "haste"]},
            "the detector judges risk, quality, priority, haste, and training scores "
            f"{', '.join(ISSUES)}: fit a detector to judgements of these issues",
        ),
        (
            {"identities": ["class", "caste"]},
            "the detector was taught with class, caste, and people in scenario 'even' have race, "
            "gender, age, disability, skin: fit a detector to judgements of these identities",
        ),
    ],
)
def test_a_detector_of_something_else_trains_nobody(cli, tmp_path, changes, said):
    (tmp_path / "d.json").write_text(spoil(**changes))
    words = ("train", "--out", "run", "--detector", "d.json", "--log", "tensorboard")
    assert cli(*words).complaint == said
    assert not (tmp_path / "run").exists()
    detector = detector_file.load(tmp_path / "d.json")
    settings = settings_of("service", "ppo", "service", epochs=2)
    with refused("conflict detector") as caught:
        run_folder.execute(tmp_path / "run", settings, detector)
    assert str(caught.value) == said
    with refused("conflict detector"):
        next(train.train(settings, detector))
    assert not (tmp_path / "run").exists()


# --- judging services ---


def one_sided(folder: Path) -> Services:
    """12 people; nobody in a wheelchair gets a response, everybody else a perfect one."""
    n = 12
    disability = np.arange(n) % 2
    answered = disability == 0
    table = Services.build(
        {
            "disability": (disability, ("no", "yes")),
            "gender": (np.arange(n) // 2 % 2, ("f", "m")),
            "guild": (np.zeros(n, int), ("bakers",)),
        },
        {
            "responded": answered,
            "response_step": np.ma.array(np.full(n, 100), mask=~answered),
            "response_distance": np.ma.array(np.full(n, 1.25), mask=~answered),
            "min_distance": np.full(n, 1.25),
        },
    )
    table.write_parquet(folder / "services.parquet")
    table.write_csv(folder / "services.csv")
    return table


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_services_are_judged_by_each_of_their_identities(cli, tmp_path, kind):
    one_sided(tmp_path)
    names = ("disability", "gender", "guild")
    more = ("--identities", *names) if kind == "csv" else ()
    ended = cli("detect", "judge", f"services.{kind}", "--json", *more)
    assert (ended.code, ended.err) == (0, "")
    rows = {row["of"]: row for row in json.loads(ended.out)}
    assert tuple(rows) == names
    # Eq. 1 by hand: the rates of no response are 1 and 0, so both gaps are 1; for gender 1/2, 1/2
    assert rows["disability"]["willingness"] == 1.0
    assert rows["gender"]["willingness"] == 0.0
    assert rows["disability"]["biased"] is True
    assert rows["gender"]["biased"] is False
    # quality and priority are said of responses, which only one side has
    assert rows["disability"]["quality"] is rows["disability"]["priority"] is None
    # one category has no other side to compare with
    assert set(rows["guild"].values()) == {"guild", None}
    table = cli("detect", "judge", f"services.{kind}", *more)
    assert table.out.count("missing") == 2 + 7
    assert "Judged by a detector fitted to simulated respondents" in table.out


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("no.csv", None, "no.csv does not exist: give a file of services"),
        ("a.xlsx", "x", "a.xlsx does not end in .parquet or .csv: give such a file"),
        ("a.parquet", "PAR1 no more", "a.parquet cannot be read as Parquet: "),
        ("a.csv", "", "a.csv cannot be read as CSV: Empty CSV file"),
        ("a.csv", "race,gender,age,disability,skin,responded\n", "a.csv holds no services"),
        ("a.csv", "responded\ntrue\n", "a.csv: no column 'race': the identities named are"),
        ("a.csv", "race,gender,age,disability,skin,responded\n1,1,1,1,1,7\n", "a.csv cannot be"),
        (
            "a.csv",
            "race,gender,age,disability,skin,responded\n1,1,1,1,1,true\n",
            "a.csv: issue 'quality' needs the fact 'response_distance'",
        ),
        ("a.csv", "race,gender,age,disability,skin,mood\n1,1,1,1,1,7\n", "unknown fact 'mood'"),
    ],
)
def test_services_that_cannot_be_judged(cli, tmp_path, name, content, said):
    if content is not None:
        (tmp_path / name).write_text(content)
    complaint = cli("detect", "judge", name).complaint
    assert said in complaint
    assert complaint.startswith(name)


def test_scores_are_judged(cli):
    for scores, biased in (("0 0 0 0", False), ("0.5 0.25 0.38 0.43", True)):
        ended = cli("detect", "judge", "--scores", *scores.split(), "--json")
        (row,) = json.loads(ended.out)
        assert row["biased"] is biased
        assert (row["probability"] > 0.5) is biased
        assert row["looks like"] == ("racism" if biased else None)


# --- from demonstrations to a detector ---


@pytest.mark.slow
def test_demonstrations_are_judged_and_a_detector_is_fitted_to_them(cli, tmp_path, content):
    demos = ("demos", "--out", "demos", "--windows", 100, "--workers", 2, "--population", "us")
    ended = cli(*demos)
    assert (ended.code, ended.err) == (0, "")
    assert sorted(p.name for p in (tmp_path / "demos").iterdir() if p.name != ".lock") == [
        "behaviour.csv", "demonstrations.json", "judgements.csv", "questionnaire.csv",
        "questionnaire_issue.csv", "services", "signatures.csv",
    ]  # fmt: skip
    before = content(tmp_path / "demos")
    again = cli(*demos[:-4], "--workers", 1, "--population", "us")
    assert again.out == ended.out
    assert content(tmp_path / "demos") == before
    complaint = cli(*demos, "--seed", 1).complaint
    assert "demos holds another experiment (seed 2000000 there and 1 here): give" in complaint
    words = ("--answers", "demos/judgements.csv", "--source", "simulated respondents")
    ended = cli("detect", "fit", *words, "--out", "d.json")
    assert (ended.code, ended.err) == (0, "")
    # but for one window, a score of which Eq. 1 cannot say
    assert "Detector fitted to 99 judgements of simulated respondents" in ended.out
    fitted = detector_file.load(tmp_path / "d.json")
    assert (fitted.rows, fitted.source) == (99, "simulated respondents")
    assert set(fitted.kinds) <= {"racism", "sexism", "ageism", "ableism"}
    assert {"racism", "ageism"} <= set(fitted.kinds)
    # people of the published shares: in some windows nobody uses a wheelchair, so no score is known
    assert ",,,,0.0\n" in (tmp_path / "demos" / "judgements.csv").read_text()


def test_workers_end_when_their_parent_is_killed(apart, alive, tmp_path):
    process = apart.start("demos", "--out", tmp_path, "--windows", 10_000, "--workers", 2)
    while len(alive(process.pid)) < 3:
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    # without a parent they would go on for minutes; communicate() ends when they all have
    process.communicate(timeout=60)
    assert alive(process.pid) == []
