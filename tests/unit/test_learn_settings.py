"""Settings of a run: what contradicts is refused in one sentence; what a scenario sets."""

from typing import Any

import pytest

from evenhand.core.errors import InputError
from evenhand.methods import guidance
from evenhand.restaurant.scenarios.needs import NeedSettings
from evenhand.restaurant.scenarios.sensing import SenseSettings
from evenhand.restaurant.worlds import World
from evenhand.training.settings import TrainSettings, settings_of


def told(kind: Any) -> guidance.GuidanceSettings:
    return guidance.GuidanceSettings(kind=kind)


NONE = told("none")
SCENARIOS = "even, prejudiced, perception, minority, tips, everyday"
RIVALS = "lagrangian, a_ppo, r_ppo, elbert, group_dro, ggf"
PAPER = "preset paper rewards Eq. 4/5 and nothing else, and {} is added to a service reward: "
PAPER += "choose the preset service"

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
        {"preset": "service", "guidance": NONE, "rival": "elbrt"},
        f"unknown rival 'elbrt': did you mean 'elbert'? choose one of {RIVALS}",
    ),
    (
        {"preset": "service", "guidance": NONE, "rival": "elbrt", "rival_strength": 1.0},
        f"unknown rival 'elbrt': did you mean 'elbert'? choose one of {RIVALS}",
    ),
    (
        {"preset": "service", "guidance": NONE, "rival": "elbert", "rival_strength": -1.0},
        "alpha is -1.0: give a number from 0 to 1e+06",
    ),
    (
        {"preset": "service", "guidance": told("levelup"), "rival": "ggf"},
        "guidance levelup and the rival ggf are two ways to evenness: choose one",
    ),
    (
        {"preset": "service", "rival": "a_ppo"},  # penalty by default
        "guidance penalty and the rival a_ppo are two ways to evenness: choose one",
    ),
    (
        {"preset": "service", "rival_strength": 1.0},
        "rival_strength is given without a rival: name one, or leave it out",
    ),
    *(({"guidance": told(kind)}, PAPER.format(kind)) for kind in guidance.SERVICE_KINDS),
    ({"guidance": NONE, "rival": "r_ppo"}, PAPER.format("r_ppo")),
    (
        {"guidance": NONE},
        "preset paper rewards Eq. 4/5 and nothing else, so guidance none rewards nothing: choose "
        "score or penalty, or the preset service",
    ),
    *(
        (
            {"scenario": name},
            "preset paper rewards Eq. 4/5 and nothing else, so nobody would tip in scenario "
            f"{name!r}: choose the preset service, or a scenario without tips",
        )
        for name in ("tips", "perception+tips", "everyday")
    ),
    ({"seed": -1}, "seed is -1: give a whole number from 0 to 4294967295"),
    ({"epochs": 0}, "epochs is 0: give a whole number from 1 to 1000000"),
    ({"people": 1}, "people is 1: give a whole number from 2 to 10000"),
    ({"evenness_weight": -0.1}, "evenness_weight is -0.1: give 0 or more"),
    ({"evenness_weight": float("nan")}, "evenness_weight is nan: give 0 or more"),
    ({"threshold": float("inf")}, "threshold is inf: give 0 or more"),
]


@pytest.mark.parametrize(("wrong", "said"), WRONG)
def test_what_is_refused(wrong, said):
    with pytest.raises(InputError) as refused:
        TrainSettings(**wrong)
    assert str(refused.value) == said


RIGHT: list[dict[str, Any]] = [
    {},
    *({"guidance": told(kind)} for kind in ("score", "penalty")),
    *({"scenario": name} for name in ("even", "prejudiced", "perception", "minority")),
    *({"preset": "service", "guidance": told(kind)} for kind in guidance.KINDS),
    *(
        {"preset": "service", "guidance": NONE, "rival": name, "rival_strength": strength}
        for name in RIVALS.split(", ")
        for strength in (None, 0.5)
    ),
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
    assert (paper.guidance.kind, paper.update.anneal_updates) == ("score", 9)
    service = settings_of("service", "ppo", "levelup")
    assert (service.update.gamma, service.update.anneal_updates) == (1.0, 300)
    assert service.world == World()
    with pytest.raises(InputError, match="unknown preset 'papers': did you mean 'paper'"):
        settings_of("papers", "ppo", "score")
    with pytest.raises(InputError, match=r"preset paper rewards Eq\. 4/5 and nothing else"):
        settings_of("paper", "ppo", "influence")
