"""Self-reflection: by hand, by numerical differentiation, planted bias, and even random walks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.methods.beyond import influence as credit
from evenhand.methods.beyond.influence import CreditSettings
from evenhand.methods.beyond.reflection import (
    Past,
    Reflection,
    ReflectionSettings,
    standardise,
    surprise,
)
from evenhand.training.batches import Trajectories
from evenhand.training.policy import ActorCritic, Network, PolicySettings, make_policy
from evenhand.training.reflection_gradients import examine

RAW = CreditSettings(shrink=0.0)
SETTINGS = ReflectionSettings()
ISSUES = ("willingness", "quality")
GROUPS = (
    ("gender", "female"),
    ("gender", "male"),
    ("gender", "other"),
    ("age", "child"),
    ("age", "adult"),
)
N, L = 30, 4


def linear(weights, biases) -> Network:
    return Network(
        weights=(jnp.asarray(weights, jnp.float32),),
        biases=(jnp.asarray(biases, jnp.float32),),
        activation="tanh",
    )


def moved(policy: ActorCritic, change: Network) -> ActorCritic:
    return ActorCritic(actor=jax.tree.map(jnp.add, policy.actor, change), critic=policy.critic)


class TestByHand:
    """Four services of one decision; a policy that responds with chance ½ whatever it sees.

    A: one ignored, one served; B: both served. So p(A) = ½, p(B) = 0, the services of A have
    influence ±¼ and b is ¼ (∇log π(walk | A) - ∇log π(respond | A)) = ¼ (1, -1) both in the
    weights of A and in the biases: of length ½.
    """

    POLICY = ActorCritic(
        actor=linear(np.zeros((2, 2)), np.zeros(2)), critic=linear([[0.0]] * 2, [0.0])
    )
    SERVICES = Trajectories(
        obs=np.array([[1, 0], [1, 0], [0, 1], [0, 1]], np.float32)[:, None],
        action=np.array([[0], [1], [1], [1]], np.int32),
        mask=np.ones((4, 1), np.float32),
    )
    INSIDE = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    X = np.array([[1.0], [0.0], [0.0], [0.0]])

    def reflection(self, weights, biases, cosines=()) -> Reflection:
        found = credit.influence(self.X, self.INSIDE, (2.0,), settings=RAW)
        after = moved(self.POLICY, linear(weights, biases))
        groups = (("one", "A"), ("one", "B"))
        past = Past(np.reshape(cosines, (-1, 1, 1)) * np.ones((2, 2)), len(cosines))
        looked = examine(self.POLICY, after, self.SERVICES, found, groups, ("w",), (2.0,))
        return looked.conclude(past, SETTINGS)[0]

    def test_a_step_that_ignores_a_more(self):
        # walking of A becomes likelier by ¼ · 0.2 = 0.05: so much does the gap grow
        found = self.reflection([[0.1, -0.1], [0.0, 0.0]], [0.0, 0.0])
        np.testing.assert_allclose(found.projection[:, 0], 0.05, rtol=1e-6)
        np.testing.assert_allclose(found.projection[:, 1], 0.10, rtol=1e-6)  # times tau
        np.testing.assert_allclose(found.cosine, 0.5**0.5, rtol=1e-6)
        assert (found.identity, found.issue) == (None, None)  # nothing to compare with yet
        assert not found.alarm

    def test_a_step_that_serves_a_better(self):
        found = self.reflection([[-0.1, 0.1], [0.0, 0.0]], [-0.1, 0.1])
        np.testing.assert_allclose(found.projection[0, 0], -0.1, rtol=1e-6)
        np.testing.assert_allclose(found.cosine, -1.0, rtol=1e-6)

    def test_the_least_evening_of_evening_updates_is_no_alarm(self):
        # it stands out, but it lowers bias
        found = self.reflection([[-0.1, 0.1], [0, 0]], [0, 0], np.linspace(-1.0, -0.9, 100))
        assert found.z[0, 0] > 3
        assert (found.alarm, found.p_value, found.identity) == (False, 1.0, None)

    def test_the_first_that_raises_bias_is(self):
        found = self.reflection([[0.1, -0.1], [0, 0]], [0, 0], np.linspace(-1.0, -0.9, 100))
        assert found.alarm
        assert found.p_value == pytest.approx(1 / 101)
        assert (found.identity, found.issue, found.favoured) == ("one", "w", ("B",))

    def test_a_step_at_a_right_angle(self):
        found = self.reflection([[0.0, 0.0], [0.3, -0.1]], [0.0, 0.0])
        np.testing.assert_allclose(found.cosine, 0.0, atol=1e-6)

    def test_no_step_has_no_direction(self):
        found = self.reflection(np.zeros((2, 2)), np.zeros(2))
        assert np.isnan(found.cosine).all()
        assert str(found.numbers()["reflection_cosine"]) == "nan"


# --- a network with a hidden layer, two identities, two issues ------------------------------------


def epoch(rng: np.random.Generator, rates=(0.4, 0.4)):
    """Services whose issues are chance; ``rates`` of the second issue for children and adults."""
    gender, age = rng.integers(0, 3, N), rng.integers(0, 2, N)
    inside = np.concatenate(
        [gender[:, None] == np.arange(3), age[:, None] == np.arange(2)], axis=1
    ).astype(float)
    obs = np.concatenate(
        [np.repeat(inside[:, None], L, axis=1), rng.normal(size=(N, L, 1))], axis=2
    )
    mask = np.arange(L) < rng.integers(1, L + 1, N)[:, None]
    x = np.stack([rng.random(N) < 0.4, rng.random(N) < np.take(rates, age)], axis=1).astype(float)
    services = Trajectories(
        obs=obs.astype(np.float32),
        action=rng.integers(0, 2, (N, L)).astype(np.int32),
        mask=mask.astype(np.float32),
    )
    return services, credit.influence(x, inside, (1.0, 1.0), settings=RAW)


POLICY = make_policy(6, PolicySettings(hidden=(4,)), np.random.default_rng(0))


def random_step(rng: np.random.Generator) -> Network:
    return jax.tree.map(
        lambda x: jnp.asarray(0.01 * rng.normal(size=x.shape), jnp.float32), POLICY.actor
    )


def summed_log_prob(flat: np.ndarray, services: Trajectories, weight: np.ndarray) -> float:
    """Σ_i w_i log π(service i) in NumPy; the weights are W W b b."""
    sizes = [(6, 4), (4, 2), (4,), (2,)]
    parts = np.split(flat, np.cumsum([int(np.prod(size)) for size in sizes])[:-1])
    w1, w2, b1, b2 = (part.reshape(size) for part, size in zip(parts, sizes, strict=True))
    logits = np.tanh(services.obs.astype(float) @ w1 + b1) @ w2 + b2
    log_p = logits - np.log(np.exp(logits).sum(axis=-1, keepdims=True))
    chosen = np.take_along_axis(log_p, services.action[..., None], axis=2)[..., 0]
    return float(weight @ (chosen * services.mask).sum(axis=1))


def vector(network: Network) -> np.ndarray:
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(network)]).astype(float)


def run(policy, after, services, influence, past, settings=SETTINGS):
    looked = examine(policy, after, services, influence, GROUPS, ISSUES, (1.0, 1.0))
    return looked.conclude(past, settings)


@pytest.mark.parametrize("seed", range(3))
def test_against_numerical_differentiation(seed):
    rng = np.random.default_rng(seed)
    services, influence = epoch(rng)
    after = moved(POLICY, random_step(rng))
    found, _ = run(POLICY, after, services, influence, Past.empty(2, 2, SETTINGS))
    theta = vector(POLICY.actor)
    step = vector(after.actor) - theta
    directions = {
        (0, 0): influence.over([0, 1, 2])[:, 0],
        (1, 1): influence.over([3, 4])[:, 1],
        (1, 2): influence.over([3, 4]).sum(axis=1),
        (2, 0): influence.issue[:, 0],
        (2, 2): influence.total,
    }
    h = 1e-5
    for place, weight in directions.items():
        b = np.array(
            [
                (
                    summed_log_prob(theta + h * axis, services, weight)
                    - summed_log_prob(theta - h * axis, services, weight)
                )
                / (2 * h)
                for axis in np.eye(len(theta))
            ]
        )
        cosine = b @ step / np.linalg.norm(b) / np.linalg.norm(step)
        assert found.projection[place] == pytest.approx(b @ step, rel=1e-3, abs=1e-6)
        assert found.cosine[place] == pytest.approx(cosine, rel=1e-3, abs=1e-4)


def test_what_stands_at_masked_places_changes_nothing():
    rng = np.random.default_rng(1)
    services, influence = epoch(rng)
    after = moved(POLICY, random_step(rng))
    obs, action = services.obs.copy(), services.action.copy()
    obs[services.mask == 0] = np.nan
    action[services.mask == 0] = 77
    other = services._replace(obs=obs, action=action)
    past = Past.empty(2, 2, SETTINGS)
    here, there = (run(POLICY, after, each, influence, past)[0] for each in (services, other))
    np.testing.assert_array_equal(here.cosine, there.cosine)


def walked(rng: np.random.Generator, updates: int, settings=SETTINGS):
    """An even robot whose weights take a random walk: what reflection says of each update."""
    past, policy, found = Past.empty(2, 2, settings), POLICY, []
    for _ in range(updates):
        after = moved(policy, random_step(rng))
        reflection, past = run(policy, after, *epoch(rng), past, settings)
        found.append(reflection)
        policy = after
    return found, past, policy


def towards(
    policy: ActorCritic, services: Trajectories, weight: np.ndarray, size: float
) -> Network:
    """A step along the gradient of Σ_i w_i log π(service i)."""

    def summed(actor: Network) -> jax.Array:
        each = jax.nn.log_softmax(actor(jnp.asarray(services.obs)))
        chosen = jnp.take_along_axis(each, jnp.asarray(services.action)[..., None], axis=2)
        return jnp.asarray(weight, jnp.float32) @ (chosen[..., 0] * services.mask).sum(axis=1)

    gradient = jax.grad(summed)(policy.actor)
    length = float(np.linalg.norm(vector(gradient)))
    return jax.tree.map(lambda x: size / length * x, gradient)


def test_a_planted_biased_update_is_found():
    rng = np.random.default_rng(5)
    _, past, policy = walked(rng, 60)
    services, influence = epoch(rng, rates=(0.8, 0.2))  # children have the second issue more often
    planted = towards(policy, services, influence.over([3, 4])[:, 1], 0.05)
    found, _ = run(policy, moved(policy, planted), services, influence, past)
    assert found.alarm
    assert (found.identity, found.issue, found.favoured) == ("age", "quality", ("adult",))
    assert found.p_value == pytest.approx(1 / 61)
    assert found.cosine[1, 1] == pytest.approx(1.0, abs=1e-5)
    assert found.z[1, 1] > 3
    numbers = found.numbers()
    assert numbers["reflection_alarm"] is True
    assert numbers["reflection_identity"] == "age"
    assert numbers["reflection_favoured"] == "adult"
    assert numbers["reflection_issue"] == "quality"


def test_an_update_that_evens_the_service_is_no_alarm_however_unusual():
    rng = np.random.default_rng(5)
    _, past, policy = walked(rng, 60)
    services, influence = epoch(rng, rates=(0.8, 0.2))
    evening = towards(policy, services, -influence.total, 0.05)
    found, _ = run(policy, moved(policy, evening), services, influence, past)
    assert found.cosine[2, 2] == pytest.approx(-1.0, abs=1e-5)
    assert found.z[2, 2] < -3
    assert not found.alarm
    assert found.numbers()["reflection_identity"] is None


def test_the_favoured_are_named_most_favoured_first():
    rng = np.random.default_rng(6)
    _, past, policy = walked(rng, 60)
    for _ in range(3):
        services, influence = epoch(rng)
        step = towards(policy, services, influence.over([0, 1, 2])[:, 0], 0.01)
        found, _ = run(policy, moved(policy, step), services, influence, past)
        assert (found.identity, found.issue) == ("gender", "willingness")
        theta = vector(policy.actor)
        change = {
            GROUPS[g][1]: summed_log_prob(theta + vector(step), services, influence.gap[:, g, 0])
            - summed_log_prob(theta, services, influence.gap[:, g, 0])
            for g in range(3)
        }
        lowered = [name for name in sorted(change, key=change.__getitem__) if change[name] < 0]
        assert found.favoured == tuple(lowered)
        assert 1 <= len(lowered) <= 2


def test_an_even_random_walk_raises_no_more_alarms_than_stated():
    settings = ReflectionSettings(rate=0.05, history=40)
    found, _, _ = walked(np.random.default_rng(7), 400, settings)
    alarms = sum(reflection.alarm for reflection in found[19:])
    # neighbours share most of their history, but not so much of their verdict
    assert 0 < alarms <= stats.binom.ppf(0.999, 400 - 19, settings.rate)
    assert not any(reflection.alarm for reflection in found[:19])


def test_the_rate_holds_for_any_distribution_and_is_not_idle():
    rng = np.random.default_rng(8)
    trials, rate = 2000, 0.05
    # directions of unlike scale, heavy tails, and shared shocks
    scale = np.geomspace(0.01, 1.0, 20).reshape(5, 4)
    alarms = 0
    for _ in range(trials):
        cosines = scale * (rng.standard_t(3, (41, 5, 4)) + rng.standard_t(3, (41, 1, 1)))
        p, _ = surprise(cosines[:-1], cosines[-1])
        alarms += p <= rate
    # of 41 updates the two most extreme
    low, high = stats.binom.ppf([0.001, 0.999], trials, 2 / 41)
    assert low <= alarms <= high


class TestSurprise:
    def test_by_hand(self):
        past = np.array([0.1, 0.3, 0.2, 0.4])[:, None, None]
        assert surprise(past, np.array([[0.35]])) == (2 / 5, (0, 0))
        assert surprise(past, np.array([[0.5]])) == (1 / 5, (0, 0))
        assert surprise(past, np.array([[0.05]])) == (1.0, (0, 0))
        assert surprise(past, np.array([[-0.5]])) == (1.0, None)

    def test_each_direction_has_its_own_scale(self):
        past = np.stack([np.linspace(-1, 1, 9), np.linspace(-0.01, 0.01, 9)], axis=1)[:, None]
        p, where = surprise(past, np.array([[0.9, 0.05]]))
        assert (p, where) == (1 / 10, (0, 1))

    def test_ties_are_no_surprise(self):
        assert surprise(np.full((30, 2, 2), 0.1), np.full((2, 2), 0.1)) == (1.0, None)

    def test_missing_directions_are_left_out(self):
        past = np.array([[0.1, np.nan], [0.2, np.nan], [0.3, np.nan]])[:, None]
        assert surprise(past, np.array([[0.4, np.nan]])) == (1 / 4, (0, 0))
        assert surprise(past, np.array([[np.nan, np.nan]])) == (1.0, None)

    def test_z_by_hand(self):
        by = np.array([1.0, 2.0, 3.0, np.nan])[:, None, None]
        np.testing.assert_allclose(standardise(np.array([[4.0]]), by), 2.0)
        assert np.isnan(standardise(np.array([[4.0]]), by[:1])).all()


class TestPast:
    def test_it_holds_the_last_updates(self):
        settings = ReflectionSettings(rate=0.5, history=3)
        found, past, _ = walked(np.random.default_rng(9), 5, settings)
        assert past.filled == 3
        np.testing.assert_array_equal(past.known, [each.cosine for each in found[2:]])

    def test_z_is_of_earlier_updates_only(self):
        found, past, _ = walked(np.random.default_rng(10), 6)
        earlier = np.array([each.cosine for each in found[:5]])
        spread = np.nanstd(earlier, axis=0, ddof=1)  # even ages in an epoch have no direction
        expected = (found[5].cosine - np.nanmean(earlier, axis=0)) / spread
        np.testing.assert_allclose(found[5].z, expected)
        assert np.isnan(found[0].z).all()
        assert past.filled == 6


def test_numbers_name_every_issue_and_identity():
    found, _, _ = walked(np.random.default_rng(12), 3)
    numbers = found[-1].numbers()
    for kind in ("cosine", "projection", "z"):
        for name in ("", "_willingness", "_quality", "_gender", "_age"):
            assert isinstance(numbers[f"reflection_{kind}{name}"], float)
    assert numbers["reflection_cosine_quality"] == found[-1].cosine[2, 1]
    assert numbers["reflection_cosine_age"] == found[-1].cosine[1, 2]
    assert numbers["reflection_projection"] == found[-1].projection[2, 2]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rate": 0.0}, "rate is"),
        ({"rate": 1.0}, "rate is"),
        ({"history": 0}, "history is"),
        ({"rate": 1 / 49, "history": 47}, "at least 48"),
        ({"history": 100.5}, "whole number"),
        ({"rate": 0.01, "history": 98}, "at least 99"),
    ],
)
def test_wrong_settings(wrong, said):
    with pytest.raises(InputError, match=said):
        ReflectionSettings(**wrong)


def test_as_many_as_the_rate_asks_for_are_enough():
    # in floating point (48 + 1) / 49 is a bit below 1
    assert ReflectionSettings(rate=1 / 49, history=48).history == 48


def test_influence_of_other_services():
    services, _ = epoch(np.random.default_rng(0))
    found = credit.influence(np.ones((3, 2)), np.ones((3, 5)), (1.0, 1.0), settings=RAW)
    with pytest.raises(ValueError, match="influence of 3 services"):
        run(POLICY, POLICY, services, found, Past.empty(2, 2, SETTINGS))
