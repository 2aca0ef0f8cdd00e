"""Laws of own schemes and of what wrappers pay."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.adapters import (
    Fact,
    Identity,
    JudgeServices,
    JudgeSettings,
    JudgeVectorServices,
    Scheme,
    invented,
    own_issue,
)
from evenhand.methods import registry
from evenhand.methods.services import Services
from support.toys import SCHEME, Toy, facts_of

FACTS = (Fact("slow", bool), Fact("noise", float, may_miss=True))
ISSUES = (
    own_issue("slow", ["slow"], lambda slow: slow == 1),
    own_issue("loud", ["noise"], lambda noise: noise > 0.5),
)


def scheme(*groups):
    one, two = groups or (("x", "y", "z"), ("u", "v"))
    return Scheme((Identity("one", one), Identity("two", two)), FACTS, ISSUES)


def table(rows, chosen):
    columns = rows.T
    one, two = chosen.identities
    return Services.build(
        {
            "one": (columns[0].astype(int) - 1, one.groups),
            "two": (columns[1].astype(int) - 1, two.groups),
        },
        {"slow": columns[2] > 0, "noise": np.where(columns[3] > 2, np.nan, columns[3] / 2)},
        chosen.own,
    )


ROWS = st.integers(1, 40).flatmap(
    lambda n: st.tuples(
        *(hnp.arrays(int, n, elements=st.integers(0, most)) for most in (3, 2, 1, 3))
    ).map(lambda columns: np.stack(columns, axis=1))
)


@given(ROWS, st.permutations(range(3)))
def test_other_names_and_another_order_of_groups_change_nothing_else(rows, order):
    plain = scheme().score(table(rows, scheme()))
    names = tuple(f"group {place}" for place in order)
    renamed = scheme(names, ("p", "q"))
    moved = rows.copy()
    known = rows[:, 0] > 0
    moved[known, 0] = np.argsort(order)[rows[known, 0] - 1] + 1
    found = renamed.score(table(moved, renamed))
    place = [*order, 3, 4]
    np.testing.assert_allclose(found.gap, plain.gap[place], atol=1e-12)
    np.testing.assert_allclose(found.overall, plain.overall, atol=1e-12)


@given(ROWS, st.integers(0, 2**32 - 1))
def test_the_order_of_services_changes_no_score(rows, seed):
    chosen = scheme()
    mixed = np.random.default_rng(seed).permutation(rows)
    one, other = chosen.score(table(rows, chosen)), chosen.score(table(mixed, chosen))
    np.testing.assert_allclose(one.gap, other.gap, atol=1e-12)


@given(ROWS)
def test_a_reference_changes_nothing_where_there_are_two_groups(rows):
    plain = scheme()
    named = Scheme((plain.identities[0], Identity("two", ("u", "v"), reference="v")), FACTS, ISSUES)
    services = table(rows, plain)
    np.testing.assert_array_equal(named.score(services).gap, plain.score(services).gap)


def rewards(settings, mode=AutoresetMode.SAME_STEP):
    envs = SyncVectorEnv([Toy] * 3, autoreset_mode=mode)
    env = JudgeVectorServices(
        envs, SCHEME, facts_of,
        sampler=invented(SCHEME), rng=np.random.default_rng(0), settings=settings,
    )  # fmt: skip
    env.reset(seed=1)
    return np.array([env.step(np.zeros(3, int))[1] for _ in range(200)]), env


@pytest.mark.parametrize(
    "method",
    [registry.create("levelup@0", cost=0.0), "influence@0", "score@0", "service"],
    ids=["levelup", "influence", "score", "service"],
)
def test_evenness_without_weight_leaves_every_reward_bit_for_bit(method):
    bare = SyncVectorEnv([Toy] * 3, autoreset_mode=AutoresetMode.SAME_STEP)
    bare.reset(seed=1)
    plain = np.array([bare.step(np.zeros(3, int))[1] for _ in range(200)])
    found, env = rewards(JudgeSettings(5, method))
    assert found.tobytes() == plain.tobytes()
    assert len(env.services) > 100


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
@pytest.mark.parametrize("kind", ["levelup", "influence", "score"])
def test_what_is_paid_is_what_rewards_gain(kind, mode):
    settings = JudgeSettings(5, kind)
    found, env = rewards(settings, mode)
    plain, _ = rewards(JudgeSettings(5), mode)
    assert np.abs(found - plain).sum() > 0
    assert (found - plain).sum() == pytest.approx(env.ledger.paid.sum())
    # what the environment paid is written down without it
    _, bare = rewards(JudgeSettings(5), mode)
    np.testing.assert_allclose(env.services.fact("total"), bare.services.fact("total"))


def test_one_environment_is_paid_as_the_only_lane_of_a_vector():
    settings = JudgeSettings(5, "influence")

    def wrapped(wrapper, env):
        rng = np.random.default_rng(0)
        return wrapper(env, SCHEME, facts_of, sampler=invented(SCHEME), rng=rng, settings=settings)

    one = wrapped(JudgeServices, Toy())
    envs = SyncVectorEnv([Toy], autoreset_mode=AutoresetMode.SAME_STEP)
    several = wrapped(JudgeVectorServices, envs)
    one.reset(seed=2)
    several.reset(seed=2)
    for _ in range(300):
        _, reward, terminated, truncated, _ = one.step(0)
        assert several.step(np.zeros(1, int))[1][0] == reward
        if terminated or truncated:
            one.reset()
    for name in ("steps", "seen", "total", "delay"):
        np.testing.assert_allclose(one.services.fact(name), several.services.fact(name))
    assert np.abs(one.ledger.paid).sum() > 0


def test_rewards_keep_their_type():
    env = gym.make_vec("CartPole-v1", 4, vectorization_mode="vector_entry_point")
    short = own_issue("short", ["steps"], lambda steps: steps < 20)
    poles = Scheme(scheme().identities, (Fact("steps", int),), (short,))
    judged = JudgeVectorServices(
        env, poles, lambda ended: {"steps": ended.steps},
        sampler=invented(poles), rng=np.random.default_rng(0),
        settings=JudgeSettings(5, "levelup"),
    )  # fmt: skip
    judged.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 2, (200, 4))
    kinds = {judged.step(action)[1].dtype for action in actions}
    assert kinds == {np.dtype(np.float32)}
    assert np.abs(judged.ledger.paid).sum() > 0
