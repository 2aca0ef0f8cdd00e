"""What wrappers write down is what a plain loop over the environment sees, in every mode."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from evenhand.adapters import JudgeServices, JudgeSettings, JudgeVectorServices, invented, lane_log
from support.refusals import refused
from support.toys import SCHEME, Toy, facts_of, plainly

MODES = list(AutoresetMode)
LANES, SEED = 3, 5
COLUMNS = ("lane", "steps", "total", "cut", "seen", "delay")


def vector(mode=AutoresetMode.NEXT_STEP, kind="box", **options):
    envs = SyncVectorEnv([lambda: Toy(kind)] * LANES, autoreset_mode=mode)
    return JudgeVectorServices(envs, SCHEME, facts_of, **options)


def run(env, steps):
    """Step a vector environment, and reset what has ended where nobody else does."""
    env.reset(seed=SEED)
    mode = env.metadata["autoreset_mode"]
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(np.zeros(LANES, int))
        over = terminated | truncated
        if mode is AutoresetMode.DISABLED and over.any():
            env.reset(options={"reset_mask": over})
    return env.services


def of_lane(services, lane):
    """Rows of one lane as the plain loop gives them, without the step of the end."""
    part = services.take(services.fact("lane") == lane)
    codes, groups = part.identity("who")
    columns = [part.fact(name) for name in COLUMNS]
    rows = [tuple(column[row] for column in columns) for row in range(len(part))]
    return [(groups[code], *row) for code, row in zip(codes, rows, strict=True)]


def assert_same(found, expected):
    assert len(found) == len(expected)
    for row, plain in zip(found, expected, strict=True):
        who, _, *facts = plain
        assert row[0] == who
        for value, wanted in zip(row[1:], facts, strict=True):
            assert np.isnan(value) if wanted is None else value == pytest.approx(float(wanted))


@pytest.mark.parametrize("kind", ["box", "dict"])
@pytest.mark.parametrize("mode", MODES)
def test_every_mode_writes_down_what_a_plain_loop_sees(mode, kind):
    services = run(vector(mode, kind), 400)
    for lane in range(LANES):
        found = of_lane(services, lane)
        assert len(found) > 60
        # where a reset takes a step of its own, fewer episodes fit into as many steps
        assert_same(found, plainly(SEED + lane, lane, 400)[: len(found)])


@pytest.mark.parametrize("mode", MODES)
def test_services_stand_in_the_order_in_which_they_ended(mode):
    services = run(vector(mode), 100)
    gap = 1 if mode is AutoresetMode.NEXT_STEP else 0
    ends = {}
    for lane in range(LANES):
        plain = plainly(SEED + lane, lane, 100)
        ends[lane] = [row[1] + gap * number for number, row in enumerate(plain)]
    expected = sorted((end, lane) for lane in ends for end in ends[lane] if end <= 100)
    assert services.fact("lane").tolist() == [lane for _, lane in expected]


@pytest.mark.parametrize("mode", MODES)
def test_where_episodes_are_cut_for_writing_makes_no_difference(mode, monkeypatch):
    whole = run(vector(mode), 300)
    monkeypatch.setattr(lane_log, "STEPS", 7)
    monkeypatch.setattr("evenhand.adapters.wrappers.STEPS", 7)
    parts = run(vector(mode), 300)
    assert whole.fact("steps").tolist() == parts.fact("steps").tolist()
    np.testing.assert_allclose(whole.fact("total"), parts.fact("total"), rtol=1e-12)
    assert whole.take(np.arange(len(whole))).identity("who")[0].tolist() == (
        parts.identity("who")[0].tolist()
    )


def test_what_a_step_pays_that_only_resets_belongs_to_no_episode():
    class Generous(SyncVectorEnv):
        def step(self, actions):
            only_resets = self._autoreset_envs.copy()
            seen, rewards, *rest = super().step(actions)
            return seen, np.where(only_resets, 9.0, rewards), *rest

    env = JudgeVectorServices(Generous([Toy] * LANES), SCHEME, facts_of)
    totals = run(env, 600).fact("total")
    np.testing.assert_allclose(totals, run(vector(), 600).fact("total"), atol=1e-9)


def test_large_observations_are_kept_as_well(monkeypatch):
    small = run(vector(), 50)
    monkeypatch.setattr("evenhand.adapters.wrappers.SMALL", 0)
    assert run(vector(), 50) == small


def test_one_environment_writes_down_the_same():
    env = JudgeServices(Toy(), SCHEME, facts_of)
    env.reset(seed=SEED)
    for _ in range(400):
        _, _, terminated, truncated, _ = env.step(0)
        if terminated or truncated:
            env.reset()
    assert_same(of_lane(env.services, 0), plainly(SEED, 0, 400))


def drawn(mode, steps, **options):
    env = vector(mode, sampler=invented(SCHEME), rng=np.random.default_rng(3), **options)
    return env, run(env, steps)


@pytest.mark.parametrize("mode", MODES)
def test_a_lane_serves_the_same_people_in_every_mode(mode):
    _, services = drawn(mode, 300)
    env = JudgeServices(
        Toy(), SCHEME, facts_of, sampler=invented(SCHEME), rng=np.random.default_rng(3)
    )
    env.reset(seed=SEED)
    for _ in range(300):
        _, _, terminated, truncated, _ = env.step(0)
        if terminated or truncated:
            env.reset()
    alone = env.services
    # the first of three children of a source is that of one child
    part = services.take(services.fact("lane") == 0)
    for name in SCHEME.names:
        codes = part.identity(name)[0]
        assert len(set(codes)) > 1
        assert codes.tolist() == alone.identity(name)[0][: len(codes)].tolist()


def people_of(env):
    assert env.people is not None
    return env.people


@pytest.mark.parametrize("mode", MODES)
def test_people_are_those_who_will_be_written_down(mode):
    env = vector(mode, sampler=invented(SCHEME), rng=np.random.default_rng(3))
    env.reset(seed=SEED)
    told = []
    for _ in range(700):  # more than are drawn at a time
        before = people_of(env)
        _, _, terminated, truncated, _ = env.step(np.zeros(LANES, int))
        over = terminated | truncated
        told += [(lane, *before[lane]) for lane in np.flatnonzero(over)]
        if mode is AutoresetMode.DISABLED and over.any():
            env.reset(options={"reset_mask": over})
    services = env.services
    columns = [services.identity(name)[0] for name in SCHEME.names]
    assert told == list(zip(services.fact("lane"), *columns, strict=True))


def test_without_a_sampler_nobody_is_drawn():
    assert vector().people is None
    assert JudgeServices(Toy(), SCHEME, facts_of).people is None


def test_an_episode_that_a_reset_cuts_short_is_no_service():
    env = vector(AutoresetMode.DISABLED)
    env.reset(seed=SEED)
    lengths = [plainly(SEED + lane, lane, 60) for lane in range(LANES)]
    longest = max(range(LANES), key=lambda lane: lengths[lane][0][3])
    first = min(row[0][3] for row in lengths)
    assert lengths[longest][0][3] > first
    for _ in range(first):
        env.step(np.zeros(LANES, int))
    env.reset()
    services = env.services
    assert longest not in services.fact("lane")
    assert set(services.fact("steps")) == {first}
    paid, over = [], np.zeros(LANES, bool)
    while not over[longest]:  # what was paid before the reset is not counted
        _, rewards, terminated, truncated, _ = env.step(np.zeros(LANES, int))
        paid.append(rewards[longest])
        over = terminated | truncated
        if over.any() and not over[longest]:
            env.reset(options={"reset_mask": over})
    later = env.services.take(env.services.fact("lane") == longest)
    assert later.fact("total").tolist() == [pytest.approx(sum(paid))]
    assert later.fact("steps").tolist() == [len(paid)]


@pytest.mark.parametrize("mode", MODES)
def test_without_guidance_nothing_that_the_environment_gives_is_changed(mode):
    env, bare = vector(mode), SyncVectorEnv([Toy] * LANES, autoreset_mode=mode)
    np.testing.assert_array_equal(env.reset(seed=SEED)[0], bare.reset(seed=SEED)[0])
    for _ in range(60):
        given, plain = env.step(np.zeros(LANES, int)), bare.step(np.zeros(LANES, int))
        for mine, other in zip(given[:4], plain[:4], strict=True):
            assert mine.tobytes() == other.tobytes()
            assert mine.dtype == other.dtype
        assert given[4].keys() == plain[4].keys()
        over = plain[2] | plain[3]
        if mode is AutoresetMode.DISABLED and over.any():
            for one in (env, bare):
                one.reset(options={"reset_mask": over.copy()})


def test_gymnasiums_checker_has_nothing_more_to_say_of_a_wrapped_environment(recwarn):
    def said(wrapper, *arguments):
        recwarn.clear()
        check_env(wrapper(gym.make("CartPole-v1"), *arguments), skip_render_check=True)
        return [str(one.message).replace(wrapper.__name__, "a wrapper") for one in recwarn]

    usual = said(gym.wrappers.RecordEpisodeStatistics)
    found = said(JudgeServices, SCHEME, lambda ended: pytest.fail("no episode ends"))
    assert set(found) <= set(usual)


def test_a_spec_makes_the_wrapped_environment_again():
    made = JudgeServices(gym.make("CartPole-v1"), SCHEME, facts_of, settings=JudgeSettings(7))
    assert made.spec is not None
    again = gym.make(made.spec)
    assert isinstance(again, JudgeServices)
    assert again.ledger.settings.services == 7


def test_a_vector_environment_has_to_say_how_it_resets():
    env = SyncVectorEnv([Toy])
    env.metadata = {}
    with refused("missing autoreset_mode"):
        JudgeVectorServices(env, SCHEME, facts_of)
    env.metadata = {"autoreset_mode": "nextstep"}
    with refused("unknown autoreset_mode", "'nextstep'"):
        JudgeVectorServices(env, SCHEME, facts_of)
