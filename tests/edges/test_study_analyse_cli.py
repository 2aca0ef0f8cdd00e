"""``evenhand study analyse``, ``fit`` and ``simulate`` on the command line."""

import json
from pathlib import Path

import pytest

from evenhand.methods import detector_file
from evenhand.study.analysis import answers as forms
from evenhand.study.analysis import figures
from evenhand.study.analysis.answers import Answers
from evenhand.study.design import protocol_file
from support.answered import judged, row

PAPER = protocol_file.PAPER


@pytest.fixture(scope="module")
def trial(tmp_path_factory) -> Path:
    """Answers of 24 simulated participants to the paper's study."""
    from evenhand.study.simulated import participants

    study, _ = protocol_file.examine(PAPER, look=False)
    assert study is not None
    path = tmp_path_factory.mktemp("trial") / "trial.csv"
    forms.write(participants.answers(study, 24, 0), path)
    return path


def test_from_simulated_participants_to_a_detector(cli, tmp_path):
    made = cli("study", "simulate", "--respondents", 24, "--out", "trial.parquet", "--seed", 3)
    assert made.code == 0, made.err
    assert "24 simulated participants" in made.out
    assert forms.read(tmp_path / "trial.parquet").simulated

    done = cli("study", "fit", "trial.parquet", "--protocol", PAPER, "--out", "d/detector.json")
    assert done.code == 0, done.err
    assert "judgements of simulated respondents" in " ".join(done.out.split())
    assert "on participants it never saw" in done.out
    assert "on sets it never saw" in done.out
    fitted = detector_file.load(tmp_path / "d" / "detector.json")
    assert fitted.source == "simulated respondents"

    # what `train --detector` and `audit --detector` do with it begins like this
    judged = cli("detect", "judge", "--detector", "d/detector.json", "--scores", 0.5, 0.2, 0.4, 0.4)
    assert judged.code == 0, judged.err
    assert "simulated respondents" in judged.out


def test_a_report_of_answers(cli, trial, tmp_path):
    done = cli("study", "analyse", trial, "--protocol", PAPER, "--out", "report")
    assert done.code == 0, done.err
    assert done.out.rstrip().endswith("report/report.html")
    assert "Simulated participants rated scenarios" in done.out
    assert "Every answer here is simulated." in (tmp_path / "report" / "report.html").read_text()
    manifest = json.loads((tmp_path / "report" / "manifest.json").read_text())
    assert manifest["answers"] == "trial.csv"
    assert manifest["simulated"]


def test_a_set_that_the_protocol_lost_is_told(cli, trial, tmp_path):
    text = PAPER.read_text()
    study, _ = protocol_file.examine(PAPER, look=False)
    assert study is not None
    gone = study.sets[0].id
    (tmp_path / "fewer.toml").write_text(text.replace(f'"{gone}"', '"another"'))
    rows = forms.read(trial).table.to_pylist()
    many = sum(row["item"] == gone for row in rows)
    note = (
        f"note: {many} answers are left out of ratings: they are about {gone}, which the protocol"
    )
    done = cli("study", "analyse", trial, "--protocol", "fewer.toml", "--out", "fewer")
    assert done.code == 0, done.err
    assert note in done.err
    assert f"about {gone}, which" in (tmp_path / "fewer" / "report.html").read_text()
    manifest = json.loads((tmp_path / "fewer" / "manifest.json").read_text())
    assert manifest["answers_left_out"] == {gone: many}
    done = cli("study", "fit", trial, "--protocol", "fewer.toml", "--out", "fewer.json")
    assert done.code == 0, done.err
    assert note in done.err


def test_answers_to_a_study_that_was_changed_since_are_refused(cli, trial, tmp_path):
    study, _ = protocol_file.examine(PAPER, look=False)
    assert study is not None
    answers = tmp_path / "old.csv"
    answers.write_bytes(trial.read_bytes())
    beside = tmp_path / "old.codebook.json"
    noted = {"name": study.name, "fingerprint": study.fingerprint()}
    commands = (
        ("study", "analyse", answers, "--protocol", PAPER, "--out", "report"),
        ("study", "fit", answers, "--protocol", PAPER, "--out", "d.json"),
    )
    beside.write_text(json.dumps({"study": noted}))
    assert all(cli(*words).code == 0 for words in commands)
    for changed in (noted | {"fingerprint": "0" * 64}, noted | {"name": "other"}):
        beside.write_text(json.dumps({"study": changed}))
        for words in commands:
            said = cli(*words).complaint
            assert said.endswith("(says old.codebook.json): give the file that was served")
    beside.write_text("{}")
    assert "old.codebook.json is no codebook of" in cli(*commands[0]).complaint


def test_the_flagged_can_be_left_out(cli, trial, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "draw_all", lambda part, found: [])  # only words here
    options = ("--permutations", 99, "--out", "report")
    cli("study", "analyse", trial, "--protocol", PAPER, *options)
    kept = json.loads((tmp_path / "report" / "manifest.json").read_text())["participants"]
    done = cli("study", "analyse", trial, "--protocol", PAPER, "--exclude-flagged", *options)
    assert "left out of the results" in done.out
    left = json.loads((tmp_path / "report" / "manifest.json").read_text())["participants"]
    flagged = left["simulated"]["flagged"]
    assert flagged == kept["simulated"]["flagged"] > 0
    assert kept["simulated"]["used"] - left["simulated"]["used"] == flagged
    fitted = cli("study", "fit", trial, "--protocol", PAPER, "--exclude-flagged", "--out", "d.json")
    assert f"{flagged} flagged participants are left out" in fitted.err


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("analyse", "none.csv"), "none.csv does not exist"),
        (("analyse", "answers.txt"), "has to end in .csv, .json or .parquet"),
        (("analyse", "few.csv", "--permutations", 5), "permutations is 5"),
        (("analyse", "few.csv", "--protocol", "none.toml"), "none.toml cannot be read"),
        (("analyse", "few.csv", "--protocol", "broken.toml"), "broken.toml, line 1"),
        (("analyse", "few.csv", "--out", "few.csv"), "is a file, not a folder"),
        (("analyse", "few.csv", "--exclude"), "unknown option '--exclude'"),
        (("analyse",), "understand"),
        (("fit", "few.csv", "--out", "d.json"), "--protocol is missing"),
        (("fit", "few.csv", "--protocol", PAPER, "--out", "d.json"), "few.csv: no set whose"),
        (("fit", "few.csv", "--protocol", PAPER, "--out", "."), "is a folder"),
        (
            ("fit", "few.csv", "--protocol", PAPER, "--out", "d.json", "--who", "all"),
            "unknown who 'all'",
        ),
        (("simulate",), "either a file with --out or a server with --url"),
        (("simulate", "--out", "a.csv", "--url", "http://127.0.0.1:1"), "either a file"),
        (("simulate", "--out", "a.xls"), "has to end in"),
        (("simulate", "--out", "a.csv", "--respondents", 0), "respondents is 0"),
        (("simulate", "--url", "ftp://here"), "no address of a server"),
        (("simulate", "--url", "http://127.0.0.1:1"), "no study answers at http://127.0.0.1:1"),
        (("analyze", "few.csv"), "did you mean 'analyse'"),
    ],
)
def test_wrong_input_is_one_sentence(cli, words, complaint):
    forms.write(Answers.of_rows([*judged("p", "x", 1), row("p", "end", "say")]), "few.csv")
    Path("broken.toml").write_text("format = \n")
    assert complaint in cli("study", *words).complaint
    assert not Path("d.json").exists()
    assert not Path("a.csv").exists()


def test_a_spoilt_file_is_told_by_row_and_column(cli, trial):
    text = trial.read_text().replace(",54.", ",x54.", 1)
    Path("spoilt.csv").write_text(text)
    complaint = cli("study", "analyse", "spoilt.csv").complaint
    assert "spoilt.csv: row" in complaint
    assert "column 'seconds'" in complaint


def test_people_and_simulated_ones_are_fitted_to_when_asked(cli, trial):
    mixed = [*forms.read(trial).rows(), *judged("p", "set-1", 1, "risk", "race")]
    forms.write(Answers.of_rows(mixed), "mixed.csv")
    words = ("study", "fit", "mixed.csv", "--protocol", PAPER, "--out", "d.json")
    assert "choose with --who people, simulated or both" in cli(*words).complaint
    assert cli(*words, "--who", "both").code == 0
    assert detector_file.load("d.json").source == "simulated respondents"
