"""The core works without what only extras bring, and a missing extra is named.

Everything runs in one process of its own, in which such packages cannot be imported.
"""

import json
import subprocess
import sys

import pytest

from evenhand.core.extras import EXTRAS

# Pillow comes with Matplotlib
HEAVY = sorted({package for packages in EXTRAS.values() for package in packages} - {"PIL"})

CORE = {
    "overview": ["--help"],
    "example": ["example", "fleet.csv", "--services", "600"],
    "audit": ["audit", "fleet.csv", "--permutations", "99", "--out", "a.html", "a.json", "a.csv"],
    "watch": ["watch", "fleet.csv", "--once"],
    "detect judge scores": ["detect", "judge", "--scores", "0.5", "0.2", "0.4", "0.4"],
    "detect judge services": ["detect", "judge", "services.csv", "--identities", "age"],
    "detect fit": ["detect", "fit", "--answers", "judgements.csv", "--out", "detector.json"],
    "card": ["card", "detector.json", "--out", "card.md", "--answers", "judgements.csv"],
    "alarms": ["alarms", "--windows", "100", "--out", "alarms"],
    "study new": ["study", "new", "study.toml"],
    "study simulate": ["study", "simulate", "--protocol", "study.toml", "--out", "answers.csv"],
    "study analyse": ["study", "analyse", "answers.csv", "--permutations", "99"],
    "study fit": ["study", "fit", "answers.csv", "--protocol", "study.toml", "--out", "d.json"],
    "sweep example": ["sweep", "--example"],
}
"""Commands that need no extra, in an order in which each finds its files."""

LACKING = {
    "train": ["train", "--out", "run"],
    "train run": ["evaluate", "run"],
    "train page": ["replay", "run", "--out", "page.html"],
    "train card": ["card", "run", "--out", "card.md"],
    "train arms": ["compare"],
    "train paper": ["reproduce"],
    "train sweep": ["sweep", "sweep.toml"],
    "sim": ["evaluate", "--robot", "even"],
    "sim demos": ["demos", "--out", "demos"],
    "sim calibrate": ["calibrate"],
    "sim view": ["view"],
    "film": ["film", "--robot", "even", "--services", "1"],
    "minari": ["minari", "--robot", "even", "--out", "data"],
    "tensorboard": ["curves", "run"],
    "wandb": ["curves", "run", "--to", "wandb"],
    "study": ["study", "serve"],
    "study preview": ["study", "preview"],
    "study backup": ["study", "backup", "--db", "a.db", "--out", "b.db"],
    "study export": ["study", "export"],
    "pages": ["study", "simulate", "--url", "http://127.0.0.1:9", "--pages"],
    "postgres": ["audit", "postgres://host/db"],
    "spark": ["audit", "pyspark://"],
}
"""Commands that need an extra; the first word of each name is the extra."""

NEEDING = {
    **dict.fromkeys(("train", "TrainSettings", "evaluate", "compare"), "train"),
    **dict.fromkeys(("RestaurantEnv", "ScriptedRobot", "World", "JudgeServices"), "sim"),
}
"""Public names that need an extra, and which."""

BLOCKED = """
import contextlib, io, json, pathlib, sys, warnings

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in HEAVY:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

HEAVY, commands = set(json.loads(sys.argv[1])), json.loads(sys.argv[2])
sys.meta_path.insert(0, Blocked())
import importlib.util
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name in HEAVY else found(name)
warnings.simplefilter("error")

import numpy as np
import evenhand
from evenhand import cli
from evenhand.methods import detector_file

rng, told = np.random.default_rng(0), {}
responded = rng.random(200) < 0.7
log = evenhand.Services.build(
    {"age": (rng.integers(0, 2, 200), ["child", "adult"])},
    {
        "responded": responded,
        "response_step": np.ma.array(rng.integers(0, 400, 200), mask=~responded),
        "response_distance": np.where(responded, rng.uniform(0.5, 2, 200), np.nan),
        "min_distance": rng.uniform(0, 1, 200),
        "steps": rng.integers(400, 500, 200),
    },
)
log.write_csv("services.csv")
pathlib.Path("run").mkdir()
scores = rng.random((200, 4)).round(3)
rows = [f"{','.join(map(str, row))},{'yes' if row.sum() > 2 else 'no'}" for row in scores]
header = "willingness,quality,priority,risk,biased"
pathlib.Path("judgements.csv").write_text("\\n".join([header, *rows]) + "\\n")
told["score"] = evenhand.score(log).issues
told["verdict"] = evenhand.audit(log).verdict
told["detector"] = evenhand.load_detector(detector_file.SHIPPED).rows
told["missing"] = {}
for name in json.loads(sys.argv[3]):
    try:
        getattr(evenhand, name)
    except evenhand.InputError as error:
        told["missing"][name] = str(error)
told["commands"] = {}
for name, words in commands.items():
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = cli.main(words)
        except BaseException as error:
            code = repr(error)
    told["commands"][name] = [code, out.getvalue(), err.getvalue()]
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What comes out of the core, and how each command ends: code, output, standard error."""
    from evenhand.cli import COMMANDS, DETECT, STUDY

    plain = [[name] for name, (module, _) in COMMANDS.items() if module]
    words = plain + [[group, name] for group, table in (("detect", DETECT), ("study", STUDY))
                     for name in table]  # fmt: skip
    helps = {" ".join([*each, "help"]): [*each, "--help"] for each in words}
    every = json.dumps(CORE | {f"no {name}": words for name, words in LACKING.items()} | helps)
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, json.dumps(HEAVY), every, json.dumps([*NEEDING])],
        cwd=tmp_path_factory.mktemp("light"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_scores_audits_and_the_detector_are_the_core(told):
    assert told["score"] == ["willingness", "quality", "priority", "risk"]
    assert told["verdict"] in ("disparity", "no evidence", "insufficient data")
    assert told["detector"] > 0


@pytest.mark.parametrize("name", CORE)
def test_a_command_of_the_core_needs_no_extra(told, name):
    code, out, err = told["commands"][name]
    assert code == 0, err
    assert out


def test_help_is_there_without_extras(told):
    helps = {name: said for name, said in told["commands"].items() if name.endswith("help")}
    assert len(helps) > 20
    assert [name for name, (code, out, _) in helps.items() if code or "usage" not in out] == []


@pytest.mark.parametrize("name", LACKING)
def test_a_missing_extra_is_one_sentence(told, name):
    code, out, err = told["commands"][f"no {name}"]
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"run pip install '.[{name.split()[0]}]' in a clone of Evenhand" in err


@pytest.mark.parametrize(("name", "extra"), NEEDING.items())
def test_a_public_name_that_needs_an_extra_says_so(told, name, extra):
    assert told["missing"][name].startswith(f"evenhand.{name} needs the package ")
    assert f"'.[{extra}]'" in told["missing"][name]


def test_an_audit_loads_nothing_of_an_extra():
    """Where all of them are installed; PyArrow itself imports pandas then."""
    code = """
import json, sys
import evenhand
from evenhand.methods import detector_file
log = evenhand.Services.build(
    {"age": ([0, 1] * 300, ["child", "adult"])},
    {"responded": [True, False] * 300, "response_distance": [1.2, None] * 300,
     "response_step": [90, None] * 300, "min_distance": [0.8] * 600},
)
evenhand.score(log), evenhand.audit(log).verdict, evenhand.load_detector(detector_file.SHIPPED)
print(json.dumps([name for name in sys.modules if "." not in name]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(json.loads(done.stdout)) & set(HEAVY) - {"pandas"} == set()
