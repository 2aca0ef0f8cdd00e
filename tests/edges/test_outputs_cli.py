"""Cards, datasets and curves from the command line: from one run to every file, and wrong words."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from evenhand.cli.card import repeating
from evenhand.cli.train import Train
from evenhand.methods import detector_file
from evenhand.methods.services import Services
from evenhand.training import run_folder
from evenhand.training.settings import TrainSettings, settings_of


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    """A folder with two small runs in it."""
    root = tmp_path_factory.mktemp("outputs")
    detector = detector_file.load(detector_file.SHIPPED)
    for seed in (0, 1):
        words = Train(root, algorithm="reinforce", guidance="levelup", people=4, epochs=2)
        settings = replace(words, seed=seed).settings()
        run_folder.execute(root / "runs" / f"seed-{seed}", settings, detector)
    return root


def test_a_card_is_of_the_services_that_evaluate_would_serve(cli, trained, tmp_path):
    folder = trained / "runs" / "seed-1"
    made = cli("card", folder, "--out", "new/README.md", "--services", "60", "--seed", "9",
               "--name", "Robot *1*", "--licence", "mit", "--notes", "Mind the gap.")  # fmt: skip
    assert (made.code, made.out) == (0, "new/README.md\n")
    page = (tmp_path / "new" / "README.md").read_text()
    cli("evaluate", folder, "--services", "60", "--seed", "9", "--out", "s.parquet")
    table = Services.read_parquet(tmp_path / "s.parquet")
    disabled = table.identity("disability")[0] == 0
    assert re.search(rf"\| disability: Yes \| [^|]*n {int(disabled.sum())}\) \|", page)
    responded = 100 * float(np.mean(table.fact("responded")))
    assert f"| services with a response | {responded:.1f} % (" in page
    assert yaml.safe_load(page.split("---\n")[1])["model-index"][0]["name"] == "Robot *1*"
    assert "Robot &#42;1&#42;" in page
    assert "Notes of its maker: Mind the gap." in page
    # what repeats it is what trained it
    (line,) = re.findall(r"^evenhand train .*$", page, re.MULTILINE)
    assert line == (
        "evenhand train --out RUN --algorithm reinforce --guidance levelup --seed 1 --epochs 2 "
        "--people 4"
    )
    assert "evenhand evaluate RUN --services 60 --seed 9" in page


def test_a_card_without_a_test(cli, trained, tmp_path):
    made = cli("card", trained / "runs" / "seed-0", "--out", "c.md", "--services", "0")
    assert made.code == 0
    page = (tmp_path / "c.md").read_text()
    assert "On people whom training never saw: not measured." in page
    assert "# seed-0\n" in page
    assert "| people served in training | 8, all of them synthetic |" in page


def test_a_run_that_lost_epochs_has_no_card(cli, trained, tmp_path):
    folder = tmp_path / "r"
    shutil.copytree(trained / "runs" / "seed-0", folder)
    log = folder / "epochs.jsonl"
    log.write_text(log.read_text().splitlines(keepends=True)[0])
    made = cli("card", "r", "--out", "c.md", "--services", "0")
    assert "r/epochs.jsonl has 1 lines, but 2 epochs have run: restore it, or" in made.complaint
    assert not (tmp_path / "c.md").exists()


def test_the_code_of_a_robots_card_runs(cli, trained, tmp_path):
    cli("card", trained / "runs" / "seed-0", "--out", "c.md", "--services", "0")
    (block,) = re.findall(r"```python\n(.*?)```", (tmp_path / "c.md").read_text(), re.DOTALL)
    shutil.copytree(trained / "runs" / "seed-0", tmp_path / "RUN")
    names: dict = {}
    exec(block, names)
    chance = names["robot"](np.zeros((3, 25), np.float32), np.arange(3))
    assert chance.shape == (3,)
    assert ((chance > 0) & (chance < 1)).all()


def test_a_card_of_a_detector(cli, tmp_path):
    made = cli("card", detector_file.SHIPPED, "--out", "d.md", "--name", "Judge")
    assert (made.code, made.out) == (0, "d.md\n")
    page = (tmp_path / "d.md").read_text()
    assert "| judgements | 1000 |" in page
    assert "| by | simulated respondents |" in page


@pytest.mark.parametrize(
    ("settings", "shipped", "words"),
    [
        (settings_of("paper", "ppo", "penalty"), True, "--preset paper"),
        (settings_of("service", "ppo", "service", seed=3, population="us"), True,
         "--guidance service --seed 3 --population us"),
        (settings_of("service", "ppo", "penalty"), False, "--detector RUN/detector.json"),
    ],
)  # fmt: skip
def test_the_command_that_trains_again(settings, shipped, words):
    assert repeating(settings, shipped) == f"evenhand train --out RUN {words}"


def test_settings_that_no_option_says_have_no_command():
    assert repeating(TrainSettings(reflect=False), True) is None


def test_curves_of_every_run_below_a_folder(cli, trained):
    pytest.importorskip("tensorboardX")
    shown = cli("curves", trained, "--to", "tensorboard")
    assert (shown.code, shown.out) == (0, f"2 runs in {trained}\n")
    for seed in (0, 1):
        assert list((trained / "runs" / f"seed-{seed}" / "tensorboard").glob("events.*"))


def test_a_dataset_of_a_run(cli, trained, tmp_path):
    minari = pytest.importorskip("minari")
    made = cli("minari", trained / "runs" / "seed-0", "--out", "sets", "--services", "3")
    assert (made.code, made.out) == (0, "sets/restaurant-reinforce-v0\n")
    dataset = minari.MinariDataset(tmp_path / "sets" / "restaurant-reinforce-v0" / "data")
    assert dataset.total_episodes == 3
    again = cli("minari", trained / "runs" / "seed-0", "--out", "sets", "--services", "3")
    assert "restaurant-reinforce-v0 is there already" in again.complaint


WRONG = [
    (("card", "x", "--out", "x.txt"), "x.txt does not end in .md: give such a file"),
    (("card", "x", "--out", "x.md"), "x does not exist: give the folder of a run or a detector"),
    (("card", ".", "--out", "x.md"), ". holds no run: there is no settings.json in it"),
    (("card", ".", "--out", "x.md", "--services", "29"), "services is 29: give a whole number"),
    (("card", ".", "--out", "x.md", "--answers", "a"), "--answers belongs to a detector"),
    (("card", "."), "--out is missing: it has to be given"),
    (("minari", "--out", "x"), "name either the folder of a run or a scripted robot"),
    (("minari", ".", "--out", "x"), ". holds no run"),
    (("minari", "--robot", "racst", "--out", "x"), "unknown robot 'racst': did you mean 'racist'"),
    (("minari", ".", "--strength", "1", "--out", "x"), "--strength belongs to a scripted robot"),
    (
        ("minari", "--robot", "even", "--out", "x", "--services", "0"),
        "services is 0: give a whole number from 1 to 100000",
    ),
    (
        ("minari", "--robot", "even", "--out", "x", "--name", "mine"),
        "a dataset cannot be called 'mine'",
    ),
    (("curves", "."), ". holds no run: there is no epochs.jsonl in it or below it"),
    (("curves", ".", "--to", "wandbb"), "unknown to 'wandbb': did you mean 'wandb'"),
    (("curves", ".", "--to"), "--to names no sink: give tensorboard, wandb or both"),
    (("train", "--out", "x", "--log", "tensorbord"), "unknown log 'tensorbord': did you mean"),
    (("train", "--out", "x", "--log"), "--log names no sink: give tensorboard, wandb or both"),
    (("train", "--out", "x", "--log", "wandb", "wandb"), "the sink wandb is named twice"),
]


@pytest.mark.parametrize(("words", "said"), WRONG)
def test_what_cannot_be_meant_is_said_in_one_sentence(cli, tmp_path, words, said):
    assert said in cli(*words).complaint
    assert list(tmp_path.iterdir()) == []
