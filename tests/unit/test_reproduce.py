"""Which runs of a folder the paper's experiment counts; nothing is trained here."""

from dataclasses import replace
from typing import Any

from evenhand.core import files
from evenhand.experiments.paper import reproduce
from evenhand.experiments.settings import ReproduceSettings
from evenhand.training import run_folder
from support.refusals import refused


def end(settings: ReproduceSettings, preset: str, arm: str, seed: int, **changes: Any) -> None:
    """A run that has ended."""
    training = reproduce.training_of(preset, arm, seed, settings.epochs, settings.population)
    folder = settings.out / "runs" / preset / arm / f"seed-{seed:02d}"
    folder.mkdir(parents=True)
    noted = {"test": {}, "versions": run_folder.versions(), "commit": None} | changes
    run_folder.finish(folder, reproduce.key_of(training, settings.services), noted)


def counted(settings: ReproduceSettings) -> set[tuple[str, str, int]]:
    found = reproduce.finished(settings.out, settings)
    return {(one["preset"], one["arm"], one["seed"]) for one in found}


def test_every_run_that_ended_counts_whatever_this_call_asks_for(tmp_path):
    asked = ReproduceSettings(tmp_path, preset=("service",), seeds=1)
    for preset, seeds in (("paper", (0, 1, 4)), ("service", (0,))):
        for arm in reproduce.arms_of(preset):
            for seed in seeds:
                end(asked, preset, arm, seed)
    expected = {("paper", arm, seed) for arm in reproduce.arms_of("paper") for seed in (0, 1, 4)}
    expected |= {("service", arm, 0) for arm in reproduce.arms_of("service")}
    assert counted(asked) == expected
    # with and without guidance are paired: a seed that an arm lacks counts for none
    end(asked, "paper", "ppo", 2)
    (tmp_path / "runs" / "paper" / "ppo" / "seed-00 old").mkdir()
    assert counted(asked) == expected


def test_a_run_with_other_settings_does_not_count(tmp_path):
    there = ReproduceSettings(tmp_path, preset=("paper",), seeds=1)
    for arm in reproduce.arms_of("paper"):
        end(there, "paper", arm, 0)
    assert len(counted(there)) == 4
    for other in (
        replace(there, epochs=41),
        replace(there, services=301),
        replace(there, population="us"),
    ):
        assert counted(other) == set()


def test_a_demonstration_folder_of_other_versions_is_refused(tmp_path, monkeypatch):
    settings = ReproduceSettings(tmp_path)
    reproduce._claim_folder(tmp_path, settings)
    monkeypatch.setattr(run_folder, "versions", lambda: {"python": "3", "mujoco": "3.9.9"})
    with refused("changed file"):
        reproduce._claim_folder(tmp_path, settings)
    noted = files.read_json(tmp_path / "experiment.json")
    assert "python" not in noted["versions"]  # whose number decides nothing
