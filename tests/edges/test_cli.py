"""Wrong words: one sentence, code 2, nothing written. And what the command line explains."""

import os
import re
import sys
from dataclasses import fields
from importlib import import_module

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evenhand.cli import COMMANDS, GROUPS, parse
from evenhand.core.errors import InputError
from evenhand.experiments.settings import PRESETS
from evenhand.methods import registry
from evenhand.training.settings import PRESETS as LEARNED
from evenhand.training.settings import TrainSettings

TRAIN = ("train", "--out", "x")
REPRODUCE = ("reproduce", "--out", "x")
DEMOS = ("demos", "--out", "x")
EVEN = ("evaluate", "--robot", "even")

LEAVES = {
    **{(name,): room for name, (room, _) in COMMANDS.items() if room},
    **{
        (group, name): room
        for group, (table, _) in GROUPS.items()
        for name, (room, _) in table.items()
    },
}


def command_of(room: str) -> type:
    module, _, name = room.partition(".")
    return getattr(import_module(f"evenhand.cli.{module}"), name)


# --- one sentence for everything that cannot be meant ---

UNKNOWN = [
    (("trian",), "unknown command 'trian': did you mean 'train'? choose one of reproduce, train"),
    (("detect", "fti"), "unknown command of detect 'fti': did you mean 'fit'? choose one of fit,"),
    (("--trian",), "unknown command '--trian': did you mean 'train'?"),
    ((*TRAIN, "--epohcs", "3"), "unknown option '--epohcs': did you mean '--epochs'?"),
    ((*TRAIN, "-seed", "3"), "unknown option '-seed': did you mean '--seed'?"),
    ((*EVEN, "--jsno"), "unknown option '--jsno': did you mean '--json'?"),
    ((*TRAIN, "--preset", "papr"), "unknown preset 'papr': did you mean 'paper'?"),
    ((*REPRODUCE, "--preset", "papr"), "unknown preset 'papr': did you mean 'paper'?"),
    ((*TRAIN, "--algorithm", "pp"), "unknown algorithm 'pp': did you mean 'ppo'?"),
    ((*TRAIN, "--guidance", "Penalty"), "unknown method 'Penalty': did you mean 'penalty'?"),
    ((*TRAIN, "--set", "credit=own"), "unknown credit 'own': choose one of own_groups, epoch"),
    ((*TRAIN, "--tau", "risk_frist"), "unknown tau 'risk_frist': did you mean 'risk_first'?"),
    ((*TRAIN, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    ((*REPRODUCE, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    ((*DEMOS, "--population", "face"), "unknown population 'face': did you mean 'fairface'?"),
    ((*EVEN, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    (("evaluate", "--robot", "racst"), "unknown robot 'racst': did you mean 'racist'?"),
    (
        ("calibrate", "--robot", "agist"),
        "'agist': did you mean 'ageist'? choose one of all, racist",
    ),
    (("calibrate", "--robot", "sexist"), "unknown robot with a signature in the paper 'sexist'"),
    (
        ("detect", "fit", "--answers", "a", "--out", "b", "--source", "respondent"),
        "unknown source 'respondent': did you mean 'respondents'?",
    ),
]
NUMBERS = [
    ((*TRAIN, "--epochs", "2.5"), "--epochs is '2.5': give a whole number"),
    ((*TRAIN, "--epochs", "-3"), "epochs is -3: give a whole number from 1 to 1000000"),
    ((*TRAIN, "--epochs", "0"), "epochs is 0: give a whole number from 1 to 1000000"),
    ((*TRAIN, "--epochs", "9" * 30), "give a whole number from 1 to 1000000"),
    ((*TRAIN, "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    ((*TRAIN, "--seed", "1e9"), "--seed is '1e9': give a whole number"),
    ((*TRAIN, "--seed=4294967296"), "seed is 4294967296: give a whole number from 0 to"),
    ((*TRAIN, "--threads", "0"), "threads is 0: give a whole number from 1 to 256"),
    ((*TRAIN, "--people", "1"), "people is 1: give a whole number from 2 to 10000"),
    ((*TRAIN, "--people", "10001"), "people is 10001: give a whole number from 2 to 10000"),
    ((*TRAIN, "--set", "lam=half"), "lam of penalty is 'half': give a number"),
    ((*TRAIN, "--set", "lam=nan"), "lam is nan: lambda multiplies rewards, give 0 to 1"),
    ((*TRAIN, "--set", "lam=-0.1"), "lam is -0.1: lambda multiplies rewards, give 0 to 1"),
    ((*TRAIN, "--set", "lam=inf"), "lam is inf: lambda multiplies rewards, give 0 to 1"),
    ((*TRAIN, "--tau", "1,2,3"), "unknown tau '1,2,3': choose one of equal, risk_first"),
    ((*TRAIN, "--tau", "1,2,3,nan"), "give four finite numbers of at least 0"),
    ((*TRAIN, "--tau", "1,2,3,-1"), "give four finite numbers of at least 0"),
    ((*TRAIN, "--tau", "0,0,0,0"), "tau is 0 for every issue: give at least one issue a weight"),
    ((*REPRODUCE, "--seeds", "0"), "seeds is 0: give a whole number from 1 to 1000"),
    ((*REPRODUCE, "--epochs", "39"), "epochs is 39: give a whole number from 40 to 100000"),
    ((*REPRODUCE, "--windows", "99"), "windows is 99: give a whole number from 100 to 100000"),
    ((*REPRODUCE, "--services", "1"), "services is 1: give a whole number from 300 to 100000"),
    ((*REPRODUCE, "--workers", "0"), "workers is 0: give a whole number from 1 to 64"),
    ((*REPRODUCE, "--workers", "1" * 9), "give a whole number from 1 to 64"),
    ((*DEMOS, "--windows", "-100"), "windows is -100: give a whole number from 100 to 100000"),
    ((*DEMOS, "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    ((*DEMOS, "--workers", "65"), "workers is 65: give a whole number from 1 to 64"),
    ((*EVEN, "--threads", "257"), "threads is 257: give a whole number from 1 to 256"),
    ((*EVEN, "--services", "29"), "services is 29: give a whole number from 30 to 100000"),
    ((*EVEN, "--services", "9" * 12), "give a whole number from 30 to 100000"),
    ((*EVEN, "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    ((*EVEN, "--strength", "1.01"), "strength of the even robot is 1.01: give 0 to 1"),
    ((*EVEN, "--strength", "nan"), "strength of the even robot is nan: give 0 to 1"),
    (("alarms", "--windows", "99"), "windows is 99: give a whole number from 100 to 1000000"),
    (("alarms", "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    (("calibrate", "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    (("calibrate", "--rounds", "0"), "rounds is 0: give a whole number from 1 to 1000"),
    (("calibrate", "--services", "29"), "services is 29: give a whole number from 30 to 100000"),
    (("calibrate", "--windows", "19"), "windows is 19: give a whole number from 20 to 10000"),
    (("detect", "judge", "--scores", "0", "0", "0", "x"), "--scores is 'x': give a number"),
    (("detect", "judge", "--scores", "50", "0", "0", "0"), "use shares, not percent"),
    (("detect", "judge", "--scores", "0", "0", "0", "inf"), "use shares, not percent"),
    (
        ("detect", "fit", "--answers", "a", "--out", "b", "--seed", "4294967296"),
        "seed is 4294967296: give a whole number from 0 to 4294967295",
    ),
]
SHAPES = [
    (("train",), "--out is missing: it has to be given (see `evenhand train --help`)"),
    (("train", "--out"), "--out needs a value (see `evenhand train --help`)"),
    (("train", "--out", "--seed", "1"), "--out needs a value"),
    ((*TRAIN, "epochs", "3"), "too many words after --out: x epochs 3"),
    (("train", "epochs", "3", "--out", "x"), "unexpected word 'epochs': did you mean --epochs?"),
    (("detect", "judge", "--scores", "1", "2", "3"), "--scores needs 4 values, and 3 follow it"),
    (("detect", "judge", *("--scores", *"01111")), "too many words after --scores: 0 1 1 1 1"),
    (("evaluate",), "name either the folder of a run or a scripted robot with --robot"),
    ((*EVEN, "run"), "name either the folder of a run or a scripted robot with --robot"),
    (("evaluate", "x", "--strength", "1"), "--strength belongs to a scripted robot"),
    (("detect", "judge"), "name either a file of services or four numbers with --scores"),
    ((*TRAIN, "--set", "lam"), "--set lam has no value: give SETTING=VALUE"),
    ((*TRAIN, "--set", "lam=much"), "lam of penalty is 'much': give a number"),
    ((*TRAIN, "--set", "lam=1.5"), "lam is 1.5: lambda multiplies rewards, give 0 to 1"),
    (
        (*TRAIN, "--guidance", "levelup", "--set", "credit=epoch"),
        "unknown setting of levelup 'credit': choose one of strength, windows, shrink, when, gua",
    ),
    ((*TRAIN, "--guidance", "service", "--set", "a=1"), "method service has no settings: leave a"),
    ((*TRAIN, "--plugin", "absent.py"), "plugin absent.py is no Python file: give the path"),
    ((*TRAIN, "--preset", "paper", "--scenario", "tips"), "nobody would tip in scenario 'tips'"),
    ((*TRAIN, "--preset", "paper", "--guidance", "service"), "and service needs a service reward"),
    (("reproduce", "--preset", "--out", "x"), "no preset is given: choose from paper, service"),
    ((*REPRODUCE, "--preset", "paper", "paper"), "a preset is given twice: paper, paper"),
]


@pytest.mark.parametrize(("words", "said"), [*UNKNOWN, *NUMBERS, *SHAPES])
def test_what_cannot_be_meant_is_said_in_one_sentence(cli, tmp_path, words, said):
    assert said in cli(*words).complaint
    assert os.listdir(tmp_path) == []


LOOSE = st.one_of(
    st.sampled_from(
        ["--out", "--seed", "--seed=", "--json", "--tau", "--scores", "--epochs", "--no-json", "-x"]
    ),
    st.sampled_from(["0", "-1", "nan", "x", "", "--", "-", "ä", "'", "--=", "None", "a b", "=\n"]),
)


@pytest.mark.parametrize("words", LEAVES, ids=" ".join)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(rest=st.lists(LOOSE, max_size=6))
def test_any_words_are_understood_or_refused(words, rest, capsys):
    command = command_of(LEAVES[words])
    parsed, said = None, ""
    try:
        parsed = parse(command, " ".join(["evenhand", *words]), rest)
    except InputError as error:
        said = str(error)
    refused = re.fullmatch(r"[\s\S]+ \(see `evenhand [a-z ]+ --help`\)", said)
    assert isinstance(parsed, command) != bool(refused)
    shown = capsys.readouterr()
    assert (shown.out, shown.err) == ("", "")


# --- targets ---


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("x.txt", "x.txt does not end in .parquet or .csv: give such a file"),
        ("file/x.csv", "file is a file, not a folder: give another one"),
        ("file/a/x.csv", "folder file/a cannot be written (Not a directory): give another one"),
        ("folder.csv", "folder.csv is a folder: give the name of a file"),
    ],
)
def test_services_that_cannot_be_written_are_not_served(cli, tmp_path, target, said):
    (tmp_path / "file").touch()
    (tmp_path / "folder.csv").mkdir()
    assert cli(*EVEN, "--out", target).complaint == said


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("folder", "folder is a folder: give the name of a file"),
        ("file/x.json", "file is a file, not a folder: give another one"),
    ],
)
def test_odds_that_cannot_be_written_are_not_searched(cli, tmp_path, out, said):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    assert cli("calibrate", "--out", out).complaint == said


@pytest.mark.parametrize("command", ["train", "reproduce", "demos"])
@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("file", "file is a file, not a folder: give another one"),
        ("file/x", "folder file/x cannot be written (Not a directory): give another one"),
        ("/proc/x", "folder /proc/x cannot be written (No such file or directory)"),
        ("taken", "taken is not empty and holds no "),
    ],
)
def test_a_folder_that_cannot_be_used(cli, tmp_path, command, out, said):
    (tmp_path / "file").touch()
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "thesis.tex").write_text("years of work")
    assert said in cli(command, "--out", out).complaint
    assert [p.name for p in (tmp_path / "taken").iterdir() if p.name != ".lock"] == ["thesis.tex"]


# --- help ---


@pytest.mark.parametrize("words", [(), ("--help",), ("-h",), ("help",)])
def test_the_overview_names_every_command(cli, words):
    shown = cli(*words)
    assert (shown.code, shown.err) == (0, "")
    assert [line.split()[0] for line in shown.out.splitlines() if line.startswith("  ")] == [
        "reproduce", "train", "evaluate", "film", "compare", "sweep", "audit", "watch", "example",
        "demos", "alarms", "calibrate", "detect", "study", "replay", "view", "curves", "minari",
        "card",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("group", "names"),
    [
        ("detect", ["fit", "judge"]),
        (
            "study",
            ["check", "new", "preview", "serve", "backup", "export", "analyse", "fit", "simulate"],
        ),
    ],
)
@pytest.mark.parametrize("more", [(), ("--help",)])
def test_the_overview_of_a_group(cli, group, names, more):
    shown = cli(group, *more)
    assert (shown.code, shown.err) == (0, "")
    listed = [line.split()[0] for line in shown.out.splitlines() if line.startswith("  ")]
    assert listed == names


@pytest.mark.parametrize("words", LEAVES, ids=" ".join)
def test_help_explains_every_option(cli, words):
    shown = cli(*words, "--help")
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.startswith(f"usage: evenhand {' '.join(words)} ")
    text = " ".join(shown.out.replace("│", " ").split())
    assert not re.search(r"\bNone\b|''|\(default: \)", text)  # what applies, not what Python holds
    for field in fields(command_of(LEAVES[words])):
        option = f"--{field.name.replace('_', '-')}".replace("--run-folder", "--run")
        if "Positional" in str(field.type):
            log = "FILE" if words == ("example",) else "LOG"
            named = {"run_folder": "RUN", "services": "FILE", "file": "FILE", "log": log,
                     "answers": "ANSWERS", "folder": "FOLDER"}  # fmt: skip
            option = named[field.name]
        # its line, then what it is: a sentence, and the default or that it must be given
        assert re.search(rf"{re.escape(option)} .{{0,60}}?[A-Z].{{12,}}?\.", text), option
    assert max(map(len, shown.out.split("╭")[1].splitlines()[1:])) <= 80


def test_the_version(cli):
    assert re.fullmatch(r"evenhand \d+\.\d+\.\d+\n", cli("--version").out)


def test_help_needs_none_of_the_heavy_libraries(apart):
    script = (
        "import sys; from evenhand.cli import main; main(['train', '--help']);"
        "print(*({'jax', 'mujoco', 'sklearn', 'pyarrow', 'scipy'} & set(sys.modules)))"
    )
    shown = apart.of(sys.executable, "-c", script)()
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.endswith("\n\n")  # the last line, of libraries, is empty


# --- what stands twice stands alike ---


def test_commands_and_settings_know_the_same_names_and_defaults():
    assert (*LEARNED, "prejudiced") == PRESETS
    words = {f.name: f.default for f in fields(command_of("train.Train"))}
    settings = TrainSettings()
    for name in ("seed", "epochs", "people", "population"):
        assert words[name] == getattr(settings, name), name
    assert registry.create(str(words["guidance"])) == settings.method
