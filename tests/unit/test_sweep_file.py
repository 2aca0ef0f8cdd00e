"""A sweep's file: what its grids mean, and every mistake with its line."""

from pathlib import Path

import pytest

from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.sweep import file
from evenhand.experiments.sweep.settings import EXAMPLE, Job, Sweep, Variant
from support.refusals import refused

HEAD = 'scenarios = ["tips"]\narms = ["service"]\nseeds = 1\n'


def examine(tmp_path: Path, text: str) -> tuple[Sweep | None, list[str]]:
    path = tmp_path / "s.toml"
    path.write_text(text)
    found, wrong = file.examine(path)
    return found, [str(mistake) for mistake in wrong]


def jobs(tmp_path: Path, text: str) -> tuple[Job, ...]:
    found, wrong = examine(tmp_path, text)
    assert found is not None, wrong
    assert found.text == text
    return found.jobs


class TestGrids:
    def test_every_combination_a_seed_of_all_before_the_next(self, tmp_path):
        text = """
scenarios = ["tips", "even"]
arms = ["reference", "levelup@2.0"]
algorithms = ["ppo", "reinforce"]
seeds = [7, 3]
"""
        default = Variant()
        assert jobs(tmp_path, text) == tuple(
            Job(default, Cell(scenario, algorithm, arm, seed))
            for seed in (3, 7)
            for scenario in ("tips", "even")
            for arm, algorithm in (
                ("reference", "none"), ("levelup@2", "ppo"), ("levelup@2", "reinforce"),
            )
        )  # fmt: skip

    def test_a_number_of_seeds_begins_with_0(self, tmp_path):
        found = jobs(tmp_path, HEAD.replace("seeds = 1", "seeds = 3"))
        assert [job.cell.seed for job in found] == [0, 1, 2]
        assert {job.cell.algorithm for job in found} == {"ppo"}

    def test_settings_make_variants(self, tmp_path):
        text = HEAD + "epochs = [40, 300]\n[settings]\nclip = [0.2, 0.3]\nhidden = [32, 32]\n"
        hidden = ("hidden", (32, 32))
        assert [job.variant for job in jobs(tmp_path, text)] == [
            Variant(40, learner=(hidden,)),
            Variant(40, learner=(("clip", 0.3), hidden)),
            Variant(300, learner=(hidden,)),
            Variant(300, learner=(("clip", 0.3), hidden)),
        ]

    def test_several_networks(self, tmp_path):
        text = HEAD + "[settings]\nhidden = [[8], [64, 64]]\n"
        assert [job.variant.name for job in jobs(tmp_path, text)] == ["hidden=8", "default"]

    def test_tables_of_runs_say_what_differs(self, tmp_path):
        text = HEAD + (
            "[settings]\nclip = 0.3\n[[runs]]\nseeds = [5]\n"
            '[[runs]]\narms = ["penalty"]\nsettings = { gamma = 0.9 }\n'
        )
        assert jobs(tmp_path, text) == (
            Job(
                Variant(learner=(("clip", 0.3), ("gamma", 0.9))),
                Cell("tips", "ppo", "penalty", 0),
            ),
            Job(Variant(learner=(("clip", 0.3),)), Cell("tips", "ppo", "service", 5)),
        )

    def test_the_example_is_one(self):
        found, wrong = file.examine(EXAMPLE)
        assert not wrong
        assert found is not None
        # 2 scenarios, 4 arms, 5 seeds, 2 learning rates
        assert len(found.jobs) == 80
        text = EXAMPLE.read_text()
        for name in file.SETTINGS:
            assert name in text


class TestNames:
    @pytest.mark.parametrize(
        ("variant", "name"),
        [
            (Variant(), "default"),
            (Variant(epochs=40), "epochs=40"),
            (Variant(people=10, services=300), "people=10,services=300"),
            (
                Variant(learner=(("activation", "relu"), ("normalise_advantage", False))),
                "activation=relu,normalise_advantage=false",
            ),
            (Variant(learner=(("adam_eps", 1e-7), ("hidden", (64, 32)))),
             "adam_eps=1e-07,hidden=64x32"),
        ],
    )  # fmt: skip
    def test_of_variants(self, variant, name):
        assert variant.name == name

    def test_long_ones_are_cut_and_differ(self):
        learner = tuple((f"a_rather_long_name_{i}", 0.123456789) for i in range(8))
        names = {Variant(epochs, learner=(*learner, ("z", epochs))).name for epochs in (300, 300)}
        others = {Variant(learner=(*learner, ("z", z))).name for z in range(20)}
        assert len(names) == 1
        assert len(others) == 20
        assert max(map(len, others)) <= 129

    def test_a_folder_for_each_run(self):
        job = Job(Variant(40), Cell("tips", "ppo", "levelup@2", 3))
        assert job.path == Path("variants/epochs=40/runs/tips/ppo/levelup@2/seed-03")
        assert job.units == 40 * 30 + 5000
        assert Job(Variant(40), Cell("tips", "none", "reference", 3)).units == 5000


MISTAKES = [
    ('scenarios = ["tip"]\n', ["line 1, scenarios: unknown scenario 'tip': did you mean 'tips'?"]),
    ('arms = ["levlup"]\n', ["line 1, arms: unknown arm 'levlup': did you mean 'levelup'?"]),
    ('arms = ["service@2"]\n', ["line 1, arms: service@2: service has no strength"]),
    ('arms = ["ggf@2"]\n', ["line 1, arms: decay is 2.0: give a number from 0.001 to 1"]),
    ("arms = [3]\n", ["line 1, arms: arm is 3: give a name, in quotes"]),
    ("arms = []\n", ["line 1, arms: it is empty: give at least one"]),
    ('algorithms = "pp"\n', ["line 1, algorithms: unknown algorithm 'pp': did you mean 'ppo'?"]),
    ("seeds = 0\n", ["line 1, seeds: seeds is 0: give a whole number from 1 to 1000, or a list"]),
    ("seeds = [1, -1]\n", ["line 1, seeds: seed is -1: give a whole number from 0 to 100000"]),
    ("seeds = [1, 1]\n", ["line 1, seeds: 1 stands there twice: take it out once"]),
    ("seeds = true\n", ["line 1, seeds: seeds is True: give a whole number"]),
    ("epochs = 1\n", ["line 1, epochs: epochs is 1: give a whole number from 2 to 100000"]),
    ("epochs = 2.5\n", ["line 1, epochs: epochs is 2.5: give a whole number"]),
    ("people = 1\n", ["line 1, people: people is 1: give a whole number from 2 to 10000"]),
    ("services = 9\n", ["line 1, services: services is 9: give a whole number from 300 to"]),
    ("epohcs = 3\n", ["line 1, epohcs: unknown key 'epohcs': did you mean 'epochs'?"]),
    (
        "[settings]\nlearning_rat = 3\nclip = 0\n",
        [
            "line 2, settings.learning_rat: unknown key 'learning_rat': did you mean "
            "'learning_rate'?",
            "line 3, settings.clip: clip is 0.0; give a number above 0",
        ],
    ),
    ('[settings]\nclip = "a"\n', ["line 2, settings.clip: clip is 'a': give a number"]),
    ("[settings]\npasses = 1.5\n", ["line 2, settings.passes: passes is 1.5: give a whole number"]),
    (
        'scenarios = ["perception+tips", "tips+perception"]\n',
        ["line 1, scenarios: 'tips+perception' stands there twice: take it out once"],
    ),
    ("[settings]\nhidden = [1000000000]\n", ["line 2, settings.hidden: hidden is (1000000000,);"]),
    ("[settings]\npasses = 100000000000\n", ["line 2, settings.passes: passes is 100000000000:"]),
    ("[settings]\ngamma = [1, 1.0]\n", ["line 2, settings.gamma: 1.0 stands there twice"]),
    (
        "[settings]\nnormalise_advantage = 1\n",
        ["line 2, settings.normalise_advantage: normalise_advantage is 1: give true or false"],
    ),
    ('[settings]\nhidden = ["a"]\n', ["line 2, settings.hidden: hidden is ['a']: give a list of"]),
    ('[settings]\nactivation = "rleu"\n', ["unknown activation 'rleu': did you mean 'relu'?"]),
    ('[settings]\npopulation = "usa"\n', ["unknown population 'usa': did you mean 'us'?"]),
    ("settings = 3\n", ["line 1, settings: write it as a table, [settings]"]),
    ("runs = 3\n", ["line 1, runs: write each as a table, [[runs]]"]),
    ("[[runs]]\nsed = 3\n", ["line 2, runs.1.sed: unknown key 'sed': did you mean 'seeds'?"]),
    ("epochs = \n", ["line 1: this is no TOML: Invalid value"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "said"), MISTAKES)
def test_every_mistake_has_its_line(tmp_path, text, said):
    key = text.partition(" ")[0]
    rest = [line for line in HEAD.splitlines() if not line.startswith(f"{key} ")]
    tables = text.startswith("[")
    whole = "\n".join([*rest, text]) if tables else text + "\n".join(rest)
    moved = len(rest) if tables else 0
    found, wrong = examine(tmp_path, whole)
    assert found is None
    assert len(wrong) == len(said)
    for line, sentence in zip(wrong, said, strict=True):
        at, mark, after = sentence.partition(",")
        if mark and at.startswith("line"):
            sentence = f"line {int(at.removeprefix('line ')) + moved},{after}"
        assert sentence in line


def test_all_of_them_are_said_at_once(tmp_path):
    _, wrong = examine(tmp_path, 'arms = ["a_pp"]\nseeds = 0\n[settings]\nclip = -1\n')
    assert [line.partition(":")[0] for line in wrong] == [
        "line 1, arms", "line 1", "line 2, seeds", "line 4, settings.clip",
    ]  # fmt: skip
    assert wrong[1] == "line 1: scenarios is missing: add it"


def test_a_misspelt_key_is_not_missing_too(tmp_path):
    _, [said] = examine(tmp_path, HEAD.replace("scenarios", "scenario"))
    assert "unknown key 'scenario': did you mean 'scenarios'?" in said


class TestDuplicates:
    def test_by_two_tables(self, tmp_path):
        text = HEAD + '[[runs]]\nseeds = 2\n[[runs]]\nseeds = [1]\narms = ["penalty", "service"]\n'
        found, wrong = examine(tmp_path, text)
        assert found is None
        assert wrong == [
            "line 6, runs.2: the run default: tips, ppo, service, seed 1 stands there twice "
            "(first in runs.1): take it out once"
        ]

    def test_by_the_same_strength_written_otherwise(self, tmp_path):
        _, wrong = examine(tmp_path, HEAD.replace('"service"', '"levelup@2", "levelup@2.0"'))
        assert wrong == ["line 2, arms: 'levelup@2.0' stands there twice: take it out once"]

    @pytest.mark.parametrize(
        ("arm", "also"),
        [("levelup", "5"), ("surgery", "1.0"), ("influence", "0.5"), ("elbert", "2e-2")],
    )
    def test_by_the_strength_that_an_arm_has_anyway(self, tmp_path, arm, also):
        arms = f'"{arm}", "{arm}@{also}"'
        _, [said] = examine(tmp_path, HEAD.replace('"service"', arms))
        assert f"would be the same, for that is the strength of {arm} anyway: take one out" in said

    def test_by_the_sign_of_zero(self, tmp_path):
        _, [said] = examine(tmp_path, HEAD.replace('"service"', '"levelup@0", "levelup@-0"'))
        assert said == "line 2, arms: 'levelup@-0' stands there twice: take it out once"

    def test_by_a_setting_that_an_algorithm_does_not_know(self, tmp_path):
        text = 'algorithms = ["reinforce"]\n' + HEAD + "[settings]\nclip = [0.2, 0.3]\n"
        _, [said] = examine(tmp_path, text)
        assert "would be the same, for reinforce knows no passes, minibatches and clip" in said

    def test_too_many(self, tmp_path):
        text = HEAD.replace("seeds = 1", "seeds = 1000") + "[settings]\ngamma = [%s]\n"
        many = ", ".join(f"0.{i:04d}" for i in range(1, 102))
        _, wrong = examine(tmp_path, text % many)
        assert wrong == ["line 1: there are more than 100,000 runs: make several sweeps"]


def test_no_file_at_all(tmp_path):
    with refused("unavailable file", "no.toml"):
        file.examine(tmp_path / "no.toml")
    (tmp_path / "x.toml").write_bytes(b"\xff")
    with refused("format file", "x.toml", "8"):
        file.examine(tmp_path / "x.toml")
