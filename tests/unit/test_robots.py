"""Scripted robots: their odds, and that each manner makes the issues that it is named for."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.methods.paper import scores
from evenhand.restaurant import people, robots, serve_people
from evenhand.restaurant.robots import BIASES, MANNERS, NAMES, ScriptedRobot
from evenhand.restaurant.worlds import World
from support.refusals import refused

EVERYONE = np.stack(
    np.meshgrid(*[np.arange(len(i.groups)) for i in people.IDENTITIES], indexing="ij"), axis=-1
).reshape(-1, 5)


class TestOdds:
    @given(st.sampled_from(NAMES), st.floats(0, 1), st.floats(0, 1))
    def test_they_are_probabilities(self, name, strength, sloppiness):
        odds = ScriptedRobot(name, strength, sloppiness).odds(EVERYONE[::97])
        assert odds.shape == (len(EVERYONE[::97]), 6)
        assert odds.min() >= -1e-12
        np.testing.assert_allclose(odds.sum(axis=1), 1.0, rtol=1e-12)

    @pytest.mark.parametrize("name", NAMES)
    def test_strength_0_is_even(self, name):
        odds = ScriptedRobot(name, strength=0.0).odds(EVERYONE)
        np.testing.assert_array_equal(odds, np.tile([1.0, 0, 0, 0, 0, 0], (len(EVERYONE), 1)))

    def test_the_even_robot_serves_everyone_properly(self):
        assert (ScriptedRobot().odds(EVERYONE)[:, 0] == 1.0).all()
        assert ScriptedRobot().identity is None

    @pytest.mark.parametrize(("name", "identity"), list(zip(BIASES, (
        ("race", {"Black", "American Indian", "Native Hawaiian"}),
        ("gender", {"Female", "Other"}),
        ("age", {"Child", "Teenager", "Elder"}),
        ("disability", {"Yes"}),
    ), strict=True)))  # fmt: skip
    def test_odds_follow_one_identity(self, name, identity):
        robot = ScriptedRobot(name)
        wanted, worse = identity
        assert robot.identity == wanted
        odds, named = robot.odds(EVERYONE), people.labels(EVERYONE)[wanted]
        is_worse = np.isin(named, list(worse))
        assert len(np.unique(odds, axis=0)) == 2
        assert len(np.unique(odds[is_worse], axis=0)) == 1
        assert len(np.unique(odds[~is_worse], axis=0)) == 1
        # those served worse are served properly less often, and the printed odds are used
        assert odds[is_worse][0, 0] < odds[~is_worse][0, 0]
        np.testing.assert_allclose(odds[is_worse][0, 1:], BIASES[name].odds_worse, rtol=1e-12)
        np.testing.assert_allclose(odds[~is_worse][0, 1:], BIASES[name].odds_others, rtol=1e-12)

    def test_half_the_strength_is_half_the_odds(self):
        whole, half = (ScriptedRobot("racist", s).odds(EVERYONE) for s in (1.0, 0.5))
        np.testing.assert_allclose(half[:, 1:], whole[:, 1:] / 2, rtol=1e-12)

    def test_sloppiness_is_shared_alike(self):
        odds = ScriptedRobot("even", sloppiness=0.25).odds(EVERYONE[:3])
        np.testing.assert_allclose(odds, [[0.75, 0.05, 0.05, 0.05, 0.05, 0.05]] * 3)

    def test_sloppiness_is_on_top_of_bias(self):
        # ignored with 0.67 by a robot that errs in one of ten services: 0.9·0.67 + 0.1/5
        child = np.array([[0, 0, 0, 1, 0]])
        ignored = BIASES["ageist"].odds_worse[-1]
        odds = ScriptedRobot("ageist", sloppiness=0.1).odds(child)
        assert odds[0, -1] == pytest.approx(0.9 * ignored + 0.02)

    @pytest.mark.parametrize("bias", BIASES.values(), ids=list(BIASES))
    def test_the_printed_odds_are_possible(self, bias):
        for row in (bias.odds_worse, bias.odds_others):
            assert len(row) == 5
            assert min(row) >= 0
            assert sum(row) <= 1 + 1e-12

    def test_draws_follow_the_odds(self):
        odds = np.tile([0.3, 0.1, 0.2, 0.0, 0.15, 0.25], (40_000, 1))
        drawn = np.bincount(robots.draw_manners(odds, np.random.default_rng(1)), minlength=6)
        assert drawn[3] == 0
        expected = odds[0] * len(odds)
        there = expected > 0
        assert stats.chisquare(drawn[there], expected[there]).pvalue > 1e-3

    def test_what_is_certain_is_drawn(self):
        odds = np.eye(6)
        for seed in range(20):
            drawn = robots.draw_manners(odds, np.random.default_rng(seed))
            np.testing.assert_array_equal(drawn, np.arange(6))


class TestWrongSettings:
    def test_an_unknown_robot_offers_the_nearest(self):
        with refused("unknown robot", "'racst'", "'racist'"):
            ScriptedRobot("racst")

    @pytest.mark.parametrize("field", ["strength", "sloppiness"])
    @pytest.mark.parametrize("value", [-0.1, 1.1, np.nan])
    def test_shares_outside_0_to_1(self, field, value):
        with pytest.raises(InputError, match=rf"{field} of the ageist robot is .*: give 0 to 1"):
            ScriptedRobot("ageist", **{field: value})


N = 120
EXACT = World(noise=0.0, dropout=0.0)


@pytest.fixture(scope="module")
def manners() -> Mapping[str, Any]:
    """Facts and issues of services in each manner, with a sensor that says the truth."""
    engine, out = serve_people.engine(EXACT, N), {}
    for code, name in enumerate(MANNERS):
        robot = robots.Mannered(lambda codes, rng, code=code: np.full(N, code))
        ahead = serve_people.draw(EXACT, N, np.random.default_rng(5), engine, robot)
        done, setups = engine.run(ahead.drawn, ahead.robot), ahead.drawn.setups
        start = setups.start[:, 0] + 1j * setups.start[:, 1]
        legs = np.diff(np.concatenate([start[:, None], setups.way], axis=1), axis=1)
        out[name] = done.facts, EXACT.indicators(done), np.abs(legs).sum(axis=1)
    return out


class TestManners:
    NAN = np.nan

    @pytest.mark.parametrize(
        ("manner", "willingness", "quality", "priority", "risk"),
        [
            ("proper", 0, 0, 0, 0),
            ("far", 0, 1, 0, 0),
            ("near", 0, 1, None, 0),  # on the longest ways it is late as well, see below
            ("close", 0, 1, None, 1),
            ("late", 0, None, 1, None),  # how near it has come by then depends on the way
            ("ignore", 1, NAN, NAN, 1),
        ],
    )
    def test_the_issues_of_each(self, manners, manner, willingness, quality, priority, risk):
        _, x, _ = manners[manner]
        for k, expected in enumerate((willingness, quality, priority, risk)):
            if expected is not None:
                np.testing.assert_array_equal(x[:, k], np.full(N, expected), f"issue {k}")

    def test_proper_is_at_about_one_and_a_quarter_metres(self, manners):
        facts, _, _ = manners["proper"]
        assert facts.distance.min() > 1.0
        assert facts.distance.max() < 1.37  # 1.35, and a reading that is one step old

    def test_far_is_at_once(self, manners):
        facts, _, _ = manners["far"]
        assert (facts.steps == 0).all()
        np.testing.assert_array_equal(facts.distance, facts.start_distance)

    def test_near_is_within_a_metre_but_not_too_close(self, manners):
        facts, _, _ = manners["near"]
        assert facts.distance.min() >= 0.5
        assert facts.distance.max() < 0.87

    def test_close_is_within_half_a_metre(self, manners):
        facts, _, _ = manners["close"]
        assert facts.distance.max() < 0.5

    @pytest.mark.parametrize(("manner", "gap"), [("near", 0.65), ("close", 0.42)])
    def test_who_comes_near_is_late_on_the_longest_ways_only(self, manners, manner, gap):
        _, x, way = manners[manner]
        # in 4 s at 1 m/s, with 0.4 s to get going, and up to half a second to slow down
        assert (x[way - gap < 3.3, 2] == 0).all()
        assert x[:, 2].mean() < 0.2

    def test_late_is_soon_after_200_steps(self, manners):
        facts, _, _ = manners["late"]
        assert facts.steps.min() > 200
        assert facts.steps.max() <= 230

    def test_ignored_people_are_walked_up_to(self, manners):
        facts, _, _ = manners["ignore"]
        assert (facts.steps == 300).all()
        assert not facts.responded.any()
        assert facts.distance.max() < 0.5

    def test_nobody_is_touched(self, manners):
        assert sum(facts.contact_steps.sum() for facts, *_ in manners.values()) == 0

    def test_every_service_keeps_to_its_own_manner(self):
        codes = np.arange(48) % 6
        robot = robots.Mannered(lambda people, rng: codes)
        # fewer lanes than services: rows are told apart over several rounds
        engine = serve_people.engine(EXACT, 7)
        ahead = serve_people.draw(EXACT, 48, np.random.default_rng(6), engine, robot)
        done = engine.run(ahead.drawn, ahead.robot)
        np.testing.assert_array_equal(done.facts.responded, codes != 5)
        np.testing.assert_array_equal(done.facts.steps == 0, codes == 1)
        assert (done.facts.steps[codes == 4] > 200).all()
        assert (done.facts.steps[codes == 0] <= 200).all()
        np.testing.assert_array_equal(done.facts.perfect, codes == 0)


@pytest.mark.parametrize(("name", "identity"), [(n, b.identity) for n, b in BIASES.items()])
def test_a_biased_robot_is_uneven_about_its_own_identity(name, identity):
    world = World()
    done = serve_people.serve_people(world, ScriptedRobot(name), 600, np.random.default_rng(7))
    found = scores.score(serve_people.table(done, world, name))
    totals = {one.name: float(found.total_of(one.name)) for one in people.IDENTITIES}
    assert max(totals, key=lambda one: totals[one]) == identity
    assert totals[identity] > 2 * max(v for one, v in totals.items() if one != identity)
