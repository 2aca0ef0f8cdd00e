"""Settings of a run: what contradicts is refused in one sentence; what a scenario sets."""

from typing import Any

import pytest

from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.restaurant.scenarios.needs import NeedSettings
from evenhand.restaurant.scenarios.sensing import SenseSettings
from evenhand.restaurant.worlds import World
from evenhand.training.settings import TrainSettings, settings_of
from support.refusals import refused

PRINTED = ("score", "penalty")
NAMES = ", ".join(registry.BUILT_IN)
SCENARIOS = "even, prejudiced, perception, minority, tips, everyday, hidden, hurry, what-if-skin"
PAPER = "preset paper rewards Eq. 4/5 and nothing else, and {} needs a service reward: choose "
PAPER += "score or penalty, or the preset service"

WRONG: list[tuple[dict[str, Any], str]] = [
    (
        {"preset": "servic"},
        "unknown preset 'servic': did you mean 'service'? choose one of paper, service",
    ),
    (
        {"scenario": "minorty"},
        f"unknown scenario 'minorty': did you mean 'minority'? choose one of {SCENARIOS}",
    ),
    (
        {"scenario": "everyday+tips"},
        "scenario 'everyday+tips' contradicts itself: everyday and tips both set tips; choose one "
        "of them",
    ),
    (
        {"population": "usa"},
        "unknown population 'usa': did you mean 'us'? choose one of uniform, us, fairface",
    ),
    (
        {"preset": "service", "method": "elbrt"},
        f"unknown method 'elbrt': did you mean 'elbert'? choose one of {NAMES}; the file of an own "
        "method is named by --plugin",
    ),
    (
        {"preset": "service", "method": "elbert@-1"},
        "elbert@-1: give a finite strength of at least 0 after the @",
    ),
    ({"preset": "service", "method": "ggf@2"}, "decay is 2.0: give a number from 0.001 to 1"),
    ({"preset": "service", "method": "service@2"}, "service@2: service has no strength, drop @2"),
    (
        {"preset": "service", "method": 3},
        "3 is no method: register its class with @evenhand.method, or give a name",
    ),
    *(
        ({"preset": "paper", "method": name}, PAPER.format(name))
        for name in registry.BUILT_IN
        if name not in PRINTED
    ),
    *(
        (
            {"preset": "paper", "scenario": name},
            "preset paper rewards Eq. 4/5 and nothing else, so nobody would tip in scenario "
            f"{name!r}: choose the preset service, or a scenario without tips",
        )
        for name in ("tips", "perception+tips", "everyday")
    ),
    ({"seed": -1}, "seed is -1: give a whole number from 0 to 4294967295"),
    ({"epochs": 0}, "epochs is 0: give a whole number from 1 to 1000000"),
    ({"people": 1}, "people is 1: give a whole number from 2 to 10000"),
    ({"tau": (0.0, 0.0, 0.0, 0.0)}, "tau is 0 for every issue: give at least one issue a weight"),
    ({"threshold": float("inf")}, "threshold is inf: give 0 or more"),
]


@pytest.mark.parametrize(("wrong", "said"), WRONG)
def test_what_is_refused(wrong, said):
    with pytest.raises(InputError) as refused:
        TrainSettings(**wrong)
    assert str(refused.value) == said


RIGHT: list[dict[str, Any]] = [
    {},
    *({"method": registry.create(name)} for name in PRINTED),
    *({"scenario": name} for name in ("even", "prejudiced", "perception", "minority")),
    *({"preset": "service", "method": registry.create(name)} for name in registry.BUILT_IN),
]


@pytest.mark.parametrize("right", RIGHT)
def test_what_goes_together(right):
    chosen = TrainSettings(**right)
    assert all(getattr(chosen, name) == value for name, value in right.items())


def test_a_scenario_brings_its_population_unless_one_is_given():
    assert TrainSettings(scenario="minority").world == World("us", needs=1.0)
    given = TrainSettings(scenario="minority", population="fairface")
    assert given.world == World("fairface", needs=1.0)
    assert TrainSettings(population="us").world == World("us")
    assert TrainSettings(scenario="minority", population="uniform").world == World(needs=1.0)


def test_a_scenario_sets_the_sensor_and_the_needs():
    found = TrainSettings("service", scenario="perception+tips").world
    assert (found.sensor, found.need) == (SenseSettings(perception=1.0), NeedSettings(0.0))
    found = TrainSettings("service", scenario="everyday").world
    assert (found.sensor, found.need) == (SenseSettings(0.01, 0.02, 0.5), NeedSettings(0.5))
    assert TrainSettings(scenario="minority").world.need == NeedSettings(1.0)
    assert TrainSettings().world.sensor == SenseSettings()


def test_arms_of_the_experiment():
    paper = settings_of("paper", "reinforce", "score", seed=5, epochs=9, population="us")
    assert (paper.preset, paper.seed, paper.epochs, paper.population) == ("paper", 5, 9, "us")
    assert (paper.update.algorithm, paper.update.gamma) == ("reinforce", 0.99)
    assert (paper.method, paper.update.anneal_updates) == (registry.create("score"), 9)
    service = settings_of("service", "ppo", "levelup")
    assert (service.update.gamma, service.update.anneal_updates) == (1.0, 300)
    assert service.world == World()
    with refused("unknown preset", "'papers'", "'paper'"):
        settings_of("papers", "ppo", "score")
    with refused("conflict preset", "4", "5"):
        settings_of("paper", "ppo", "influence")
