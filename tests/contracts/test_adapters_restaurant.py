"""Evenhand's own restaurant through the wrapper: the same table as the restaurant's own way."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from evenhand.adapters import (
    Identity,
    JudgeServices,
    JudgeSettings,
    JudgeVectorServices,
    paper_scheme,
)
from evenhand.methods.paper.scores import score
from evenhand.restaurant import people
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.vector import RestaurantVectorEnv

SCHEME = paper_scheme([Identity(one.name, one.groups) for one in people.IDENTITIES])
LANES, STEPS = 4, 150


def facts_of(ended):
    """Facts and identities from the infos of the environment."""
    facts = {fact.name: ended.info(f"facts.{fact.name}") for fact in SCHEME.facts}
    codes = np.stack(ended.first_info("identities"))
    return facts | {name: codes[:, d] for d, name in enumerate(SCHEME.names)}


def actions():
    """Mostly walk; some respond early, some late."""
    return (np.random.default_rng(0).random((STEPS, LANES)) < 0.04).astype(int)


@pytest.fixture(scope="module")
def single():
    """Services of each lane, from the environment on its own: facts and identities."""
    found = []
    for lane in range(LANES):
        env = RestaurantEnv()
        _, info = env.reset(seed=3 + lane)
        found.append([])
        for action in actions()[:, lane]:
            _, _, over, _, last = env.step(action)
            if over:
                found[-1].append((info["identities"].tolist(), last["facts"]))
                _, info = env.reset()
    return found


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_the_vector_environment_is_written_down_as_its_lanes_alone(mode, single):
    env = JudgeVectorServices(RestaurantVectorEnv(LANES, mode), SCHEME, facts_of)
    env.reset(seed=3)
    lanes = []
    for step in actions():
        _, _, over, _, _ = env.step(step)
        lanes += np.flatnonzero(over).tolist()
        if mode is AutoresetMode.DISABLED and over.any():
            env.reset(options={"reset_mask": over})
    table = env.services
    assert len(table) == len(lanes) > 10
    codes = np.stack([table.identity(name)[0] for name in SCHEME.names], axis=1)
    facts = {fact.name: table.fact(fact.name) for fact in SCHEME.facts}
    for row, lane in enumerate(lanes):
        who, true = single[lane][lanes[:row].count(lane)]
        assert codes[row].tolist() == who
        for name, values in facts.items():
            np.testing.assert_equal(values[row], float(true[name]))


def test_scores_are_those_of_the_restaurants_own_scheme():
    env = JudgeServices(RestaurantEnv(), SCHEME, facts_of, settings=JudgeSettings(5))
    env.reset(seed=0)
    for action in np.tile(actions().ravel(), 2):
        if env.step(action)[2]:
            env.reset()
    table, found = env.services, env.windows
    assert len(found) > 3
    for window in range(len(found)):
        part = table.take(table.fact("epoch") == window)
        np.testing.assert_array_equal(score(part).gap, found.scores.gap[window])
    assert found.scores.groups == people.GROUPS
