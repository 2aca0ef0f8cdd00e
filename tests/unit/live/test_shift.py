"""One service after another: the same facts as when many are served at once."""

from dataclasses import fields, replace

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan, serve_people
from evenhand.restaurant.live import shift
from evenhand.restaurant.live.shift import BATCH, Shift, Tally
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.worlds import World
from evenhand.training import evaluate, train
from evenhand.training.settings import TrainSettings
from support.refusals import refused


def outcomes(seen: Shift, n: int) -> list[shift.Outcome]:
    """The next n services, to their ends."""
    found = []
    for _ in range(n):
        while seen.outcome is None:
            seen.step()
        found.append(seen.outcome)
        seen.proceed()
    return found


def assert_same_facts(found: list[shift.Outcome], facts: serve.Facts) -> None:
    for field in fields(facts):
        one_by_one = np.concatenate([getattr(outcome.facts, field.name) for outcome in found])
        np.testing.assert_array_equal(one_by_one, getattr(facts, field.name), field.name)


@pytest.mark.parametrize(
    ("name", "scenario", "interval"),
    [("even", "even", 5), ("racist", "everyday", 5), ("ageist", "perception+minority", 12)],
)
def test_facts_are_those_of_services_served_at_once(name, scenario, interval):
    cast = shift.scripted(name, 1.0, scenario)
    cast = replace(cast, world=replace(cast.world, interval=interval))
    found = outcomes(Shift(cast, 7), 2 * BATCH)
    rng = np.random.default_rng(7)
    for batch in range(2):
        done = serve_people.serve_people(cast.world, cast.robot, BATCH, rng)
        part = found[batch * BATCH : (batch + 1) * BATCH]
        assert_same_facts(part, done.facts)
        np.testing.assert_array_equal([o.codes for o in part], done.codes)


def test_the_first_services_are_those_that_evaluate_measures():
    found = outcomes(Shift(shift.scripted("ageist", 0.5, "even"), 3), BATCH)
    table = evaluate.serve_scripted(ScriptedRobot("ageist", 0.5), World(), BATCH, 3)
    perfect = [
        not (outcome.issues == 1.0).any() and outcome.facts.responded[0] for outcome in found
    ]
    np.testing.assert_array_equal(perfect, evaluate.perfect(table))
    np.testing.assert_array_equal(
        [outcome.facts.min_distance[0] for outcome in found], table.fact("min_distance")
    )


def test_a_policy_is_shown_as_it_is_measured():
    settings = TrainSettings(scenario="perception")
    state = train.untrained(settings)
    cast = shift.Cast("policy", settings.world, train.robot(settings, state.policy))
    found = outcomes(Shift(cast, 11), BATCH)
    table = evaluate.serve_policy(state, settings, BATCH, 11)
    np.testing.assert_array_equal(
        [outcome.facts.steps[0] for outcome in found], table.fact("steps")
    )


def test_the_same_seed_shows_the_same_services_and_another_seed_others():
    cast = shift.scripted("sexist", 1.0, "minority")
    first, again, other = (
        [(*o.codes, o.facts.steps[0], o.facts.distance[0]) for o in outcomes(Shift(cast, seed), 5)]
        for seed in (1, 1, 2)
    )
    assert first == again != other


def test_a_service_that_begins_again_ends_alike():
    one, other = (Shift(shift.scripted("even", 1.0, "perception"), 4) for _ in range(2))
    for _ in range(40):
        other.step()
    assert other.moment.steps == 40
    other.restart()
    assert other.moment.steps == 0
    assert_same_facts(outcomes(one, 1), outcomes(other, 1)[0].facts)


def test_after_the_end_nothing_moves_and_nothing_is_counted_twice():
    seen = Shift(shift.scripted("even", 1.0, "even"), 0)
    while seen.outcome is None:
        seen.step()
    before = seen.data.qpos.copy()
    ended = seen.moment
    seen.step()
    seen.restart()
    np.testing.assert_array_equal(seen.data.qpos, before)
    assert seen.moment.steps == ended.steps == seen.outcome.facts.steps[0]
    assert seen.moment.tally.services[-1] == 1


def test_a_step_is_a_step_of_physics():
    seen = Shift(shift.scripted("even", 1.0, "even"), 0)
    for step in range(1, 12):
        seen.step()
        assert seen.moment.steps == step
        assert seen.data.time == pytest.approx(step * floor_plan.TIMESTEP)
    person = seen.now.drawn.setups.position[seen.now.row, 0]
    assert seen.moment.distance == pytest.approx(np.hypot(*(seen.data.qpos[:2] - person)))
    assert seen.moment.age == 0.0  # read at step 10
    assert seen.moment.reading == pytest.approx(seen.moment.distance, abs=0.2)


def test_the_next_service_is_known_before_it_begins():
    seen = Shift(shift.scripted("even", 1.0, "even"), 0)
    for _ in range(BATCH + 1):
        coming = seen.coming
        seen.proceed()
        assert seen.now is coming
    assert seen.now.number == BATCH + 2


def outcome(codes: tuple[int, ...], *issues: float) -> shift.Outcome:
    none = np.zeros(1)
    facts = serve.Facts(none > 0, none, none, none, none, none, none, none)
    return shift.Outcome(1, np.array(codes), facts, np.array(issues))


def test_counting_by_hand():
    nan = np.nan
    tally = Tally.empty()
    # race Black (group 1), gender Male (7), age Elder (13), disability No (15), skin VI (21)
    tally = tally.plus(outcome((1, 1, 4, 1, 5), 0.0, 1.0, 0.0, 0.0))
    # race White (0), gender Male (7), age Child (9), disability Yes (14), skin I (16)
    tally = tally.plus(outcome((0, 1, 0, 0, 0), 1.0, nan, nan, 1.0))
    assert tally.services[[0, 1, 7, 9, 13, 2, -1]].tolist() == [1, 1, 2, 1, 1, 0, 2]
    assert tally.services.sum() == 5 + 5 + 2
    assert tally.applies[-1].tolist() == [2, 1, 1, 2]
    assert tally.found[-1].tolist() == [1, 1, 0, 1]
    assert tally.applies[0].tolist() == [1, 0, 0, 1]
    assert tally.found[1].tolist() == [0, 1, 0, 0]


def test_a_cast_has_the_world_of_its_scenario():
    cast = shift.scripted("even", 1.0, "everyday")
    assert (cast.name, cast.world) == ("even", World("us", 0.5, 0.5, 0.5))
    assert shift.scripted("racist", 0.5, "even").name == "racist, strength 0.5"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("agist", 1.0, "even"), "did you mean 'ageist'"),
        (("ageist", 1.5, "even"), "strength of the ageist robot is 1.5: give 0 to 1"),
        (("even", 1.0, "tip"), "did you mean 'tips'"),
        (("even", 1.0, "tips+everyday"), "both set tips"),
    ],
)
def test_what_cannot_be_shown_is_said(wrong, said):
    with pytest.raises(InputError, match=said):
        shift.scripted(*wrong)


def test_a_party_is_not_shown_one_by_one():
    with refused("unsupported party", "hurry"):
        Shift(shift.scripted("even", 1.0, "hurry"), 3)
