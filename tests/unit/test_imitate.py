"""Imitation: demonstrations of biased robots become more likely, and with them their prejudice."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from evenhand.restaurant import people
from evenhand.training import imitation, train
from evenhand.training.batches import Trajectories
from evenhand.training.observation import view
from evenhand.training.policy import response_probability
from evenhand.training.settings import TrainSettings

SETTINGS = TrainSettings(preset="service", scenario="prejudiced")
SERVICES = 600
"""Fewer would be learned by heart."""

WORSE = np.array(
    [[race, 0, age, 0, skin] for race in (1, 2) for age in (0, 4) for skin in range(6)]
)
"""Served worse by each of the four robots: by race, gender, age and disability."""
OTHERS = np.array(
    [[race, 1, age, 1, skin] for race in (0, 3) for age in (2, 3) for skin in range(6)]
)
"""By none of them."""


def demonstrations(settings: TrainSettings, seed: int = 0) -> Trajectories:
    world, rng = settings.world, np.random.default_rng(seed)
    shown = imitation.demonstrate(
        world.prejudice, world.population, settings.task, settings.sensor, settings.needs, rng
    )
    return shown._replace(obs=view(settings, np.asarray(shown.obs)))


def likelihood(policy, shown: Trajectories) -> float:
    """Mean log-likelihood of the decisions."""
    valid = shown.mask > 0
    respond = np.asarray(response_probability(policy, shown.obs[valid])).astype(float)
    each = np.where(shown.action[valid] == 1, respond, 1.0 - respond)
    return float(np.log(np.maximum(each, 1e-12)).mean())


def seen(codes: np.ndarray, distance: float, seconds: float) -> np.ndarray:
    """These people at a distance, as the policy sees them."""
    out = np.zeros((len(codes), 25), np.float32)
    out[:, :22] = people.encode(codes)
    out[:, 22:24] = distance / 5.0, seconds / 6.0
    return view(SETTINGS, out)


@pytest.fixture(scope="module")
def learned():
    """Learner before and after some demonstrations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(imitation, "SERVICES", SERVICES)
        shown = demonstrations(SETTINGS)
        before = train.untrained(SETTINGS)
        kept = [np.array(leaf) for leaf in jax.tree.leaves(before)]
        after = imitation.imitate(before, shown, np.random.default_rng(1))
        for old, leaf in zip(kept, jax.tree.leaves(before), strict=True):
            np.testing.assert_array_equal(old, leaf)  # what was given stays as it was
        yield before, after, shown


def test_demonstrations_are_services_of_a_mixture_of_robots(learned):
    _, _, shown = learned
    assert shown.obs.shape == (SERVICES, 60, 25)
    lengths = shown.mask.sum(axis=1)
    assert (lengths >= 1).all()
    assert (shown.action.sum(axis=1) <= 1).all()  # a response ends a service
    # odds at strength 1: half are served by a robot that treats them worse, half of these late
    # or not at all
    ignored = (shown.action.sum(axis=1) == 0).mean()
    assert 0.1 <= ignored <= 0.5


def test_what_was_shown_becomes_more_likely(learned):
    before, after, shown = learned
    assert likelihood(after.policy, shown) > likelihood(before.policy, shown) + 0.02


def test_so_does_what_was_not_shown(learned, monkeypatch):
    monkeypatch.setattr(imitation, "SERVICES", SERVICES)
    before, after, _ = learned
    others = demonstrations(SETTINGS, seed=5)
    assert likelihood(after.policy, others) > likelihood(before.policy, others) + 0.01


def test_it_takes_over_whom_the_robots_serve_worse(learned):
    """Near enough for a proper response and in time: what each decision adds to the chance."""
    _, after, _ = learned
    worse = np.asarray(response_probability(after.policy, seen(WORSE, 1.15, 2.5)))
    others = np.asarray(response_probability(after.policy, seen(OTHERS, 1.15, 2.5)))
    assert others.mean() >= 0.3
    assert worse.mean() <= others.mean() / 3


def test_before_it_treats_all_alike(learned):
    before, _, _ = learned
    worse = np.asarray(response_probability(before.policy, seen(WORSE, 1.15, 2.5)))
    others = np.asarray(response_probability(before.policy, seen(OTHERS, 1.15, 2.5)))
    assert abs(worse.mean() - others.mean()) <= 0.01


def test_robots_without_bias_leave_no_gap(monkeypatch):
    """Strength 0: whoever asks is served properly, and so the clone responds to both."""
    monkeypatch.setattr(imitation, "SERVICES", SERVICES)
    rng = np.random.default_rng(0)
    shown = imitation.demonstrate(
        0.0, "uniform", SETTINGS.task, SETTINGS.sensor, SETTINGS.needs, rng
    )
    assert (shown.action.sum(axis=1) == 1).all()
    shown = shown._replace(obs=view(SETTINGS, np.asarray(shown.obs)))
    after = imitation.imitate(train.untrained(SETTINGS), shown, rng)
    worse = np.asarray(response_probability(after.policy, seen(WORSE, 1.15, 2.5)))
    others = np.asarray(response_probability(after.policy, seen(OTHERS, 1.15, 2.5)))
    assert min(worse.mean(), others.mean()) >= 0.8


def test_critic_and_optimiser_stay(learned):
    before, after, _ = learned
    for part in (lambda s: s.policy.critic, lambda s: s.opt_state, lambda s: s.step):
        for old, new in zip(
            jax.tree.leaves(part(before)), jax.tree.leaves(part(after)), strict=True
        ):
            np.testing.assert_array_equal(old, new)
    moved = [
        not np.array_equal(old, new)
        for old, new in zip(
            jax.tree.leaves(before.policy.actor), jax.tree.leaves(after.policy.actor), strict=True
        )
    ]
    assert all(moved)


def test_the_same_seed_imitates_the_same(learned):
    before, after, shown = learned
    again = imitation.imitate(before, shown, np.random.default_rng(1))
    for old, new in zip(jax.tree.leaves(after), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(old, new)


@pytest.fixture
def few(monkeypatch):
    """Few demonstrations, and nothing of them kept for other tests."""
    monkeypatch.setattr(imitation, "SERVICES", 60)
    train.begin.cache_clear()
    yield
    train.begin.cache_clear()


def test_training_is_held_near_it_in_its_scenario_only(few):
    held = train.anchor(SETTINGS)
    assert held is not None
    assert held.weight == imitation.PULL
    for old, new in zip(
        jax.tree.leaves(train.begin(SETTINGS).policy), jax.tree.leaves(held.policy), strict=True
    ):
        np.testing.assert_array_equal(old, new)
    assert train.anchor(replace(SETTINGS, scenario="perception+tips")) is None


def test_a_run_begins_with_it_in_its_scenario_only(few):

    def same_actor(settings: TrainSettings) -> bool:
        old, new = (f(settings).policy.actor.weights[0] for f in (train.untrained, train.begin))
        return np.array_equal(old, new)

    assert not same_actor(SETTINGS)
    assert not same_actor(replace(SETTINGS, scenario="prejudiced+tips"))
    assert same_actor(replace(SETTINGS, scenario="tips"))


def test_the_unaware_cannot_take_it_over(few):
    chosen = replace(SETTINGS, method="unaware")
    policy = train.begin(chosen).policy
    robot = train.robot(chosen, policy)
    at = np.zeros((2, 25), np.float32)
    at[:, :22] = people.encode(np.stack([WORSE[0], OTHERS[0]]))
    at[:, 22:24] = 0.24, 0.4
    worse, others = robot(at, np.arange(2))
    assert worse == others
