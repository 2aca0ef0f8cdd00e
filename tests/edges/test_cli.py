"""Wrong words: one sentence, code 2, nothing written. And what the command line shows."""

import csv
import json
import os
import pty
import re
import subprocess
import sys
from contextlib import suppress
from dataclasses import fields
from importlib import import_module

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evenhand.cli import COMMANDS, DETECT, parse
from evenhand.errors import InputError
from evenhand.experiments.settings import PRESETS
from evenhand.guidance import GuidanceSettings
from evenhand.learn import train

TRAIN = ("train", "--out", "x")
REPRODUCE = ("reproduce", "--out", "x")
DEMOS = ("demos", "--out", "x")
EVEN = ("evaluate", "--robot", "even")

LEAVES = {
    **{(name,): room for name, (room, _) in COMMANDS.items() if room},
    **{("detect", name): room for name, (room, _) in DETECT.items()},
}


def command_of(room: str) -> type:
    module, _, name = room.partition(".")
    return getattr(import_module(f"evenhand.commands.{module}"), name)


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
    ((*TRAIN, "--guidance", "Penalty"), "unknown guidance 'Penalty': did you mean 'penalty'?"),
    ((*TRAIN, "--credit", "own"), "unknown credit 'own': choose one of own_groups, epoch"),
    ((*TRAIN, "--tau", "risk_frist"), "unknown tau 'risk_frist': did you mean 'risk_first'?"),
    ((*TRAIN, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    ((*REPRODUCE, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    ((*DEMOS, "--population", "face"), "unknown population 'face': did you mean 'fairface'?"),
    ((*EVEN, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    (("evaluate", "--robot", "racst"), "unknown robot 'racst': did you mean 'racist'?"),
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
    ((*TRAIN, "--people", "1"), "people is 1: give a whole number from 2 to 10000"),
    ((*TRAIN, "--people", "10001"), "people is 10001: give a whole number from 2 to 10000"),
    ((*TRAIN, "--penalty", "half"), "--penalty is 'half': give a number"),
    ((*TRAIN, "--penalty", "nan"), "penalty is nan: lambda multiplies rewards, give 0 to 1"),
    ((*TRAIN, "--penalty", "-0.1"), "penalty is -0.1: lambda multiplies rewards, give 0 to 1"),
    ((*TRAIN, "--penalty", "inf"), "penalty is inf: lambda multiplies rewards, give 0 to 1"),
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
    ((*EVEN, "--services", "29"), "services is 29: give a whole number from 30 to 100000"),
    ((*EVEN, "--services", "9" * 12), "give a whole number from 30 to 100000"),
    ((*EVEN, "--seed", "-1"), "seed is -1: give a whole number from 0 to 4294967295"),
    ((*EVEN, "--strength", "1.01"), "strength of the even robot is 1.01: give 0 to 1"),
    ((*EVEN, "--strength", "nan"), "strength of the even robot is nan: give 0 to 1"),
    (("bench", "--seconds", "nan"), "seconds is nan: give 0.01 to 600"),
    (("bench", "--seconds", "0"), "seconds is 0.0: give 0.01 to 600"),
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
    (("bench", "now"), "unexpected word 'now': options begin with --"),
    (("detect", "judge", "--scores", "1", "2", "3"), "--scores needs 4 values, and 3 follow it"),
    (("detect", "judge", *("--scores", *"01111")), "too many words after --scores: 0 1 1 1 1"),
    (("evaluate",), "name either the folder of a run or a scripted robot with --robot"),
    ((*EVEN, "run"), "name either the folder of a run or a scripted robot with --robot"),
    (("evaluate", "x", "--strength", "1"), "--strength belongs to a scripted robot"),
    (("detect", "judge"), "name either a file of services or four numbers with --scores"),
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


# --- help ---


@pytest.mark.parametrize("words", [(), ("--help",), ("-h",), ("help",)])
def test_the_overview_names_every_command(cli, words):
    shown = cli(*words)
    assert (shown.code, shown.err) == (0, "")
    assert [line.split()[0] for line in shown.out.splitlines() if line.startswith("  ")] == [
        "reproduce", "train", "evaluate", "demos", "detect", "bench",
    ]  # fmt: skip


@pytest.mark.parametrize("words", [("detect",), ("detect", "--help")])
def test_the_overview_of_detect(cli, words):
    shown = cli(*words)
    assert (shown.code, shown.err) == (0, "")
    assert [line.split()[0] for line in shown.out.splitlines() if line.startswith("  ")] == [
        "fit", "judge",
    ]  # fmt: skip


@pytest.mark.parametrize("words", LEAVES, ids=" ".join)
def test_help_explains_every_option(cli, words):
    shown = cli(*words, "--help")
    assert (shown.code, shown.err) == (0, "")
    assert shown.out.startswith(f"usage: evenhand {' '.join(words)} ")
    text = " ".join(shown.out.replace("│", " ").split())
    for field in fields(command_of(LEAVES[words])):
        option = f"--{field.name.replace('_', '-')}"
        if field.name in ("run_folder", "services") and "Positional" in str(field.type):
            option = {"run_folder": "RUN", "services": "FILE"}[field.name]
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
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.endswith("\n\n")  # the last line, of libraries, is empty


# --- what stands twice stands alike ---


def test_commands_and_settings_know_the_same_names_and_defaults():
    assert PRESETS == train.PRESETS
    words = {f.name: f.default for f in fields(command_of("train.Train"))}
    settings = train.TrainSettings()
    for name in ("seed", "epochs", "people", "population"):
        assert words[name] == getattr(settings, name), name
    for name in ("credit", "penalty"):
        assert words[name] == getattr(GuidanceSettings(), name), name


# --- libraries, terminal, pipes ---


def test_numeric_libraries_keep_to_one_thread_unless_told_otherwise(apart):
    script = (
        "import os, sys; from evenhand.cli import main; main([]);"
        "print('numpy' in sys.modules, os.environ['OMP_NUM_THREADS'],"
        " os.environ['OPENBLAS_NUM_THREADS'])"
    )
    clean = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}

    def last(environment: dict[str, str]) -> str:
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        return done.stdout.splitlines()[-1]

    assert last(clean) == "False 1 1"
    assert last(clean | {"OMP_NUM_THREADS": "2"}) == "False 2 1"


def in_a_terminal(apart, *words: object) -> tuple[int, str]:
    """Run with standard error as a terminal; returns code and what it showed."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*apart.program, *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "140"},
    )
    os.close(theirs)
    shown = b""
    with suppress(OSError):  # when the other side has ended
        while True:
            shown += os.read(ours, 4096)
    os.close(ours)
    return process.wait(), re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())


SHORT = ("--epochs", 30, "--people", 4, "--algorithm", "reinforce")


@pytest.mark.slow
def test_progress_is_shown_in_a_terminal(apart, tmp_path):
    code, shown = in_a_terminal(apart, "train", "--out", tmp_path / "run", *SHORT)
    assert code == 0
    assert "reinforce, seed 0" in shown
    assert "100 %" in shown
    assert re.search(r"\d:\d\d:\d\d left  [\d,]+ steps/s  [\d,]+ services/s", shown)


@pytest.mark.slow
def test_nothing_but_the_result_is_shown_elsewhere(apart, tmp_path):
    shown = apart("train", "--out", tmp_path / "run", "--epochs", 1, "--people", 2)
    assert (shown.code, shown.out, shown.err) == (0, f"{tmp_path / 'run'}\n", "")


def test_a_reader_that_has_gone_is_no_error(apart):
    process = apart.start("train", "--help")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait() == 0


def test_output_that_cannot_be_written(apart):
    with open("/dev/full", "w") as full:
        ended = apart("train", "--help", capture_output=False, stdout=full, stderr=subprocess.PIPE)
    assert ended.code == 1
    assert ended.err == (
        "evenhand: the output cannot be written: No space left on device: free some space\n"
    )


# --- Ctrl-C, and other ends ---

STUB = """
import os, signal, sys, time
from evenhand import cli
from evenhand.errors import WorkerLostError

class Dying:
    def __del__(self):  # what is raised in here is lost
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)

def stopped_while_memory_is_collected(words):
    Dying()
    time.sleep(600)

def stopped_while_a_library_loads(words):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(600)
    except KeyboardInterrupt:
        raise ImportError("initialization failed")

def ended(words):
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(600)

def lost(words):
    raise WorkerLostError("a worker is gone")

def defect(words):
    raise ZeroDivisionError("a defect")

cli._dispatch = globals()[sys.argv.pop()]
sys.exit(cli.main())
"""


@pytest.mark.parametrize(
    ("what", "code", "said"),
    [
        ("stopped_while_memory_is_collected", 130, "evenhand: stopped; what was finished is kept"),
        ("stopped_while_a_library_loads", 130, "evenhand: stopped; what was finished is kept"),
        ("ended", 143, ""),
        ("lost", 1, "evenhand: a worker is gone"),
        ("defect", 1, "Traceback (most recent call last):"),
    ],
)
def test_how_a_command_can_end(what, code, said):
    command = [sys.executable, "-c", STUB, what]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(said)
    assert done.stderr.count("\n") <= 1 or what == "defect"
    assert ("Traceback" in done.stderr) == (what == "defect")


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


@pytest.mark.slow
def test_a_full_disk(apart, tmp_path, monkeypatch):
    monkeypatch.setenv("EVENHAND_CACHE", str(tmp_path / "cache"))
    words = (*EVEN, "--services", 300, "--out", tmp_path / "x.parquet")
    ended = apart.with_small_files(4_000, *words)
    assert ended.complaint == f"{tmp_path / 'x.parquet'} cannot be written: File too large"
    words = ("train", "--out", tmp_path / "run", "--epochs", 2, "--algorithm", "reinforce")
    ended = apart.with_small_files(4_000, *words)
    assert ended.complaint.endswith(" cannot be written: File too large")
    assert not list(tmp_path.rglob("*.part"))
    assert not (tmp_path / "run" / "checkpoint.npz").exists()


# --- results ---


@pytest.mark.slow
def test_a_scripted_robot_is_measured(cli, tmp_path):
    words = ("--services", 60, "--seed", 3, "--json")
    ended = cli(*EVEN, *words, "--out", "services.csv")
    assert (ended.code, ended.err) == (0, "")
    found = json.loads(ended.out)
    with (tmp_path / "services.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == found["services"] == 60
    answered = [row for row in rows if row["responded"] == "true"]
    assert found["response_rate"] == len(answered) / 60
    for fact, name in (
        ("response_distance", "mean_response_distance"),
        ("response_step", "mean_response_time"),
    ):
        mean = sum(float(row[fact]) for row in answered) / len(answered)
        assert found[name] == pytest.approx(mean, rel=1e-12)
    seconds = sum(int(row["steps"]) for row in rows) / 60 * 0.02
    assert found["mean_service_seconds"] == pytest.approx(seconds, rel=1e-12)
    assert cli(*EVEN, *words).out == ended.out
