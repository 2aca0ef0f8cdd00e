"""Laws of the losses that hold for every input."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenhand.methods.paper import losses
from evenhand.training import diagnostics

N, L = 3, 5  # one shape, so that each function compiles once
NUMBERS = st.floats(-10, 10, width=32)
GRID = arrays(np.float32, (N, L), elements=NUMBERS)
ROW = arrays(np.float32, N, elements=NUMBERS)
SHARES = st.floats(0, 1, width=32)
LOG_PROBS = arrays(np.float32, (N, L), elements=st.floats(-5, -0.015625, width=32))
MASKS = st.lists(st.integers(1, L), min_size=N, max_size=N).map(
    lambda lengths: (np.arange(L) < np.array(lengths)[:, None]).astype(np.float32)
)


def gae_in_a_plain_loop(reward, value, mask, gamma, lam):
    """Â_t = Σ_k (γλ)^k δ_{t+k}, summed forwards in double precision, service by service."""
    out = np.zeros(reward.shape)
    for i in range(reward.shape[0]):
        length = int(mask[i].sum())
        for t in range(length):
            for k in range(t, length):
                following = float(value[i, k + 1]) if k + 1 < length else 0.0
                delta = float(reward[i, k]) + gamma * following - float(value[i, k])
                out[i, t] += (gamma * lam) ** (k - t) * delta
    return out


@given(GRID, GRID, MASKS, SHARES, SHARES)
def test_gae_is_the_sum_of_discounted_errors(reward, value, mask, gamma, lam):
    found = losses.gae(reward, value, mask, gamma, lam)
    expected = gae_in_a_plain_loop(reward, value, mask, gamma, lam)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


@given(GRID, GRID, MASKS)
def test_with_full_traces_the_target_is_the_reward_to_go(reward, value, mask):
    advantage = losses.gae(reward, value, mask, 1.0, 1.0)
    to_go = np.cumsum((reward * mask)[:, ::-1].astype(float), axis=1)[:, ::-1] * mask
    found = np.where(mask > 0, np.asarray(advantage) + value, 0.0)
    np.testing.assert_allclose(found, to_go, rtol=1e-4, atol=1e-4)


@given(ROW, NUMBERS, SHARES)
def test_people_returns_are_the_printed_sum(reward, value_next, gamma):
    expected = [
        sum(gamma ** (k - t) * float(reward[k]) for k in range(t, N))
        + gamma ** (N - t) * value_next
        for t in range(N)
    ]
    found = losses.people_returns(reward, value_next, gamma)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


@given(ROW, GRID, NUMBERS, SHARES)
def test_all_decisions_of_a_service_share_its_return(reward, value, value_next, gamma):
    shared = np.asarray(losses.people_advantages(reward, value, value_next, gamma)) + value
    expected = np.broadcast_to(shared[:, :1], (N, L))
    np.testing.assert_allclose(shared, expected, rtol=1e-4, atol=1e-4)


@given(GRID, MASKS)
def test_normalised_advantages_have_mean_0_and_deviation_1(advantage, mask):
    found = np.asarray(losses.normalise(advantage, mask), float)
    valid = found[mask > 0]
    assert np.all(found[mask == 0] == 0)
    spread = advantage[mask > 0].std()
    if spread > 1e-2:
        np.testing.assert_allclose([valid.mean(), valid.std()], [0, 1], atol=1e-3)


@given(GRID, MASKS, st.floats(0.5, 4, width=32), NUMBERS)
def test_a_reward_scaled_alike_for_all_changes_nothing(advantage, mask, scale, shift):
    # Why a constant λ has no effect under normalised advantages.
    if advantage[mask > 0].std() > 1e-1:
        once = losses.normalise(advantage, mask)
        again = losses.normalise(scale * advantage + np.float32(shift), mask)
        np.testing.assert_allclose(once, again, atol=1e-2)


@given(GRID, GRID, GRID, LOG_PROBS, LOG_PROBS, MASKS, SHARES)
def test_masked_places_change_no_result(a, b, rubbish, log_prob, old, mask, share):
    rubbish = np.where(rubbish > 5, np.float32(np.nan), rubbish)

    def soil(x):
        return np.where(mask > 0, x, rubbish)

    def results(change):
        x, y, p, q = change(a), change(b), change(log_prob), change(old)
        return [
            losses.gae(x, y, mask, share, share),
            losses.normalise(x, mask),
            losses.reinforce_loss(p, x, mask),
            losses.ppo_loss(p, q, x, mask, 0.2),
            losses.value_loss(x, y, mask),
            diagnostics.approx_kl(p, q, mask),
            diagnostics.clip_fraction(p, q, mask, 0.2),
            diagnostics.explained_variance(x, y, mask),
        ]

    for clean, soiled in zip(results(np.asarray), results(soil), strict=True):
        np.testing.assert_array_equal(clean, soiled)


@given(LOG_PROBS, LOG_PROBS, GRID, MASKS)
def test_the_clipped_objective_never_promises_more_than_the_plain_one(log_prob, old, a, mask):
    plain = losses.masked_mean(np.exp(log_prob - old) * a, mask)
    tolerance = 1e-4 * float(losses.masked_mean(np.abs(np.exp(log_prob - old) * a), mask))
    assert -losses.ppo_loss(log_prob, old, a, mask, 0.2) <= plain + tolerance


@given(LOG_PROBS, GRID, MASKS)
def test_an_unchanged_policy_loses_minus_the_mean_advantage(log_prob, advantage, mask):
    found = losses.ppo_loss(log_prob, log_prob, advantage, mask, 0.2)
    expected = -advantage[mask > 0].astype(float).mean()
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)
    assert diagnostics.approx_kl(log_prob, log_prob, mask) == 0
    assert diagnostics.clip_fraction(log_prob, log_prob, mask, 0.2) == 0


@given(LOG_PROBS, LOG_PROBS, MASKS)
def test_the_measure_of_change_is_never_negative(log_prob, old, mask):
    assert diagnostics.approx_kl(log_prob, old, mask) >= -1e-6
