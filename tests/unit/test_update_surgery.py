"""Updates with gradient surgery, and updates that are held near an anchor policy."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evenhand.training.update import Anchor, UpdateSettings, update
from support.updates import (
    ALGORITHMS,
    L,
    N,
    Reference,
    assert_same_bits,
    grid,
    learner,
    plain_steps,
    rng,
    services,
    vector,
)


def surgical_steps(reference: Reference, fairness: Reference, start: np.ndarray, steps: int):
    """Weights after each plain step, by the rules of surgery on numerical gradients.

    Both are gradients of what falls. Where they conflict, the fair one loses its part along the
    service one; and a step that would raise unevenness loses that part.
    """
    old, momentum, weights, out = reference.outputs(start)[0], 0.0, start, []
    for k in range(1, steps + 1):
        service, fair = reference.gradient(weights, old), fairness.gradient(weights, old)
        kept = fair - min(fair @ service, 0.0) * service / (service @ service)
        momentum = 0.9 * momentum + 0.1 * (service + kept)
        change = -2 * momentum / (1 - 0.9**k)
        change = change - max(change @ fair, 0.0) * fair / (fair @ fair)
        weights = weights + change
        out.append(weights)
    return out


def references(settings: UpdateSettings, trajectories, fair) -> tuple[Reference, Reference]:
    """Of service, and of evenness: nothing but the policy loss with the fair advantages."""
    bare = replace(settings, value_coefficient=0.0, entropy_coefficient=0.0)
    return (
        Reference(trajectories, grid(1), grid(2), settings),
        Reference(trajectories, fair, grid(2), bare),
    )


FAIRS = {
    "in conflict": -grid(1) + 0.3 * grid(7),
    "in agreement": grid(1) + 0.3 * grid(7),
    "strong": -20 * grid(1) + 20 * grid(7),
    "weak": -0.05 * grid(1) + 0.1 * grid(7),
}


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("kind", FAIRS)
def test_steps_of_surgery(algorithm, kind):
    steps = 2 if algorithm == "ppo" else 1
    settings = plain_steps(algorithm, passes=2, minibatches=1)
    state, trajectories, fair = learner(settings), services(), FAIRS[kind]
    expected = surgical_steps(*references(settings, trajectories, fair), vector(state), steps)
    after, _ = update(state, trajectories, grid(1), grid(2), settings, rng(), fair)
    moved = expected[-1] - vector(state)
    np.testing.assert_allclose(
        vector(after), expected[-1], rtol=1e-3, atol=1e-4 * np.abs(moved).max()
    )


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("adam", [False, True])
def test_no_step_raises_unevenness(algorithm, adam):
    """What the service wants is the opposite of what evenness wants, and has its way nowhere."""
    sizes: dict[str, Any] = {"passes": 1, "minibatches": 1, "normalise_advantage": True}
    settings = (
        UpdateSettings(algorithm=algorithm, learning_rate=0.003, **sizes)
        if adam
        else plain_steps(algorithm, **sizes)
    )
    state, trajectories, fair = learner(settings), services(), FAIRS["in conflict"]
    _, fairness = references(settings, trajectories, fair)
    start = vector(state)
    uneven = fairness.gradient(start, fairness.outputs(start)[0])

    def rise(given) -> float:
        """Cosine of the step with the direction in which unevenness grows."""
        after, _ = update(state, trajectories, grid(1), grid(2), settings, rng(), given)
        step = vector(after) - start
        return float(step @ uneven / np.linalg.norm(step) / np.linalg.norm(uneven))

    assert rise(None) > 0.2
    assert rise(fair) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("algorithm", "minibatches", "share"),
    [("reinforce", 1, 0.02), ("ppo", 1, 0.02), ("ppo", 4, 0.02)],
)
def test_over_ten_updates_unevenness_hardly_rises(algorithm, minibatches, share):
    """Also in minibatches: each step looks at the unevenness of the whole epoch."""
    settings = UpdateSettings(
        algorithm=algorithm, learning_rate=0.003, passes=4, minibatches=minibatches
    )
    trajectories, fair = services(), FAIRS["in conflict"]
    _, fairness = references(settings, trajectories, fair)

    def unevenness(updates: int, given=None) -> float:
        state = learner(settings)
        for _ in range(updates):
            state, _ = update(state, trajectories, grid(1), grid(2), settings, rng(), given)
        return -float(np.mean(fairness.outputs(vector(state))[0] * fairness.advantage))

    before = unevenness(0)
    without = unevenness(10) - before
    assert without > 0.01
    assert unevenness(10, fair) - before < share * without


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_nothing_to_be_fair_about_changes_nothing(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    plain = with_zeros = learner(settings)
    for epoch in range(3):
        batch = services(epoch)
        plain, one = update(plain, batch, grid(1), grid(2), settings, rng(epoch))
        with_zeros, two = update(
            with_zeros, batch, grid(1), grid(2), settings, rng(epoch), np.zeros((N, L))
        )
        for name, number in vars(one).items():
            wanted = pytest.approx(float(number), rel=1e-4, abs=1e-6)
            assert float(getattr(two, name)) == wanted, name
    np.testing.assert_allclose(vector(with_zeros), vector(plain), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_left_out_is_the_default(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    state = learner(settings)
    once = update(state, services(), grid(1), grid(2), settings, rng())
    again = update(state, services(), grid(1), grid(2), settings, rng(), None)
    assert_same_bits(once[0], again[0])
    assert once[1] == again[1]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_fair_advantages_of_decisions_that_did_not_happen_have_no_influence(algorithm):
    settings = UpdateSettings(algorithm=algorithm)
    state, trajectories = learner(settings), services()
    given = trajectories, grid(1), grid(2), settings
    clean, _ = update(state, *given, rng(), grid(7))
    soiled = np.where(trajectories.mask == 0, np.nan, grid(7))
    found, _ = update(state, *given, rng(), soiled)
    assert_same_bits(clean, found)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_fair_advantages_are_on_the_scale_of_the_others(algorithm):
    """Four times both, exact in binary: normalising takes the same scale from both."""
    settings = UpdateSettings(algorithm=algorithm)
    state = learner(settings)
    once, _ = update(state, services(), grid(1), grid(2), settings, rng(), grid(7))
    again, _ = update(state, services(), 4 * grid(1), grid(2), settings, rng(), 4 * grid(7))
    other, _ = update(state, services(), grid(1), grid(2), settings, rng(), 4 * grid(7))
    assert_same_bits(once, again)
    assert not np.array_equal(vector(once), vector(other))


def test_fair_advantages_of_another_shape_are_refused():
    settings = UpdateSettings()
    with pytest.raises(ValueError, match=r"fair has shape \(8, 9\), the mask has \(8, 10\)"):
        update(learner(settings), services(), grid(1), grid(2), settings, rng(), grid(7)[:, 1:])


# --- held near an anchor ---


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_anchor_adds_its_divergence_to_the_loss(algorithm):
    settings = plain_steps(algorithm, passes=1, minibatches=1)
    state, other, trajectories = learner(settings), learner(settings, 5), services()
    held = (vector(other), 0.7)
    reference = Reference(trajectories, grid(1), grid(2), settings, held)
    slope = reference.gradient(vector(state), reference.outputs(vector(state))[0])
    after, _ = update(
        state, trajectories, grid(1), grid(2), settings, rng(), anchor=Anchor(other.policy, 0.7)
    )
    np.testing.assert_allclose(vector(after), vector(state) - 2 * slope, rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_strong_anchor_wins(algorithm):
    """Advantages pull towards one action everywhere; a heavy anchor keeps the policy in place."""
    settings = UpdateSettings(algorithm=algorithm, learning_rate=0.01)
    trajectories = services()
    gain = np.where(trajectories.action == 1, 1.0, -1.0).astype(np.float32)

    def moved(anchor: Anchor | None) -> float:
        state = learner(settings)
        start = Reference(trajectories, gain, grid(2), settings)
        before = start.outputs(vector(state))[1]
        for _ in range(20):
            state, _ = update(state, trajectories, gain, grid(2), settings, rng(), anchor=anchor)
        return float(np.abs(start.outputs(vector(state))[1] - before).mean())

    free = moved(None)
    assert free > 0.3
    assert moved(Anchor(learner(settings).policy, 100.0)) < 0.2 * free
