"""Who needs another service, and that a response they cannot notice is none."""

import numpy as np
import pytest

from evenhand.restaurant import people
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.scenarios.needs import NeedSettings
from evenhand.restaurant.simulation import layout, task
from evenhand.restaurant.simulation.lanes import Lanes
from support.refusals import refused

ADULT, ELDER, WHEELCHAIR, BOTH = (
    [0, 0, 2, 1, 0], [0, 0, 4, 1, 0], [0, 0, 2, 0, 0], [0, 0, 4, 0, 0],
)  # fmt: skip
CODES = np.array([ADULT, ELDER, WHEELCHAIR, BOTH])


def test_windows_at_full_strength():
    drawn = needs.draw(NeedSettings(1.0), CODES, np.random.default_rng(1))
    assert drawn.room == pytest.approx([0.0, 0.0, 1.3, 0.0])
    assert drawn.reach == pytest.approx([np.inf, 1.2, np.inf, 1.2])
    assert (drawn.signal[[0, 2]] == 0.0).all()
    assert ((drawn.signal[[1, 3]] >= 25.0) & (drawn.signal[[1, 3]] <= 75.0)).all()


def test_half_strength_is_half_the_way():
    drawn = needs.draw(NeedSettings(0.5), CODES, np.random.default_rng(1))
    assert drawn.room[2] == pytest.approx(1.15)
    assert drawn.reach[1] == pytest.approx(1.35)


def test_nobody_by_default():
    drawn = needs.draw(NeedSettings(), CODES, np.random.default_rng(1))
    assert (drawn.room == 0.0).all()
    assert (drawn.reach == np.inf).all()
    assert (drawn.signal == 0.0).all()


def test_everybody_can_be_served_properly():
    """Each window overlaps with 1.0-1.5 m, and no distance suits an elder and a wheelchair user."""
    drawn = needs.draw(NeedSettings(1.0), CODES, np.random.default_rng(1))
    least, most = np.maximum(drawn.room, 1.0), np.minimum(drawn.reach, 1.5)
    assert (most - least >= 0.199).all()
    assert most[1] < least[2]


@pytest.mark.parametrize("strength", [-0.1, 1.1, np.nan])
def test_impossible_strengths(strength):
    with refused("range needs", "0", "1"):
        NeedSettings(strength)


def test_a_response_that_is_not_noticed_is_none():
    n = 6
    setups = layout.draw(people.population("uniform"), n, np.random.default_rng(4))
    settings = task.TaskSettings()
    lanes, ids = Lanes(n, settings), np.arange(n)
    readings = settings.decisions + 1
    chances = sensing.Chances(np.zeros((n, readings)), np.zeros((n, readings), bool), np.ones(n))
    far = setups.start_distance
    wanted = needs.Needs(
        # exactly there; too near; too far; too early; just in time; nobody special
        room=np.array([far[0], far[1] + 0.1, 0.0, 0.0, 0.0, 0.0]),
        reach=np.array([far[0], 9.0, far[2] - 0.1, 9.0, 9.0, np.inf]),
        signal=np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0]),
    )
    lanes.begin(ids, lanes.prepare(setups, chances, wanted), ids)
    lanes.respond(ids)
    assert lanes.facts(ids).responded.tolist() == [True, False, False, False, True, True]


def test_a_signal_is_waited_for():
    setups = layout.draw(people.population("uniform"), 2, np.random.default_rng(4))
    settings = task.TaskSettings()
    lanes, ids = Lanes(2, settings), np.arange(2)
    chances = sensing.Chances(np.zeros((2, 61)), np.zeros((2, 61), bool), np.ones(2))
    wanted = needs.Needs(np.zeros(2), np.full(2, np.inf), np.array([10.0, 10.1]))
    lanes.begin(ids, lanes.prepare(setups, chances, wanted), ids)
    for _ in range(2):
        lanes.walk(ids)
    lanes.respond(ids)
    assert lanes.facts(ids).responded.tolist() == [True, False]
