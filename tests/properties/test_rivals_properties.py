"""Laws of the rivals."""

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.methods.epoch import Epoch
from evenhand.methods.paper import scores
from evenhand.methods.paper.scores import count, gaps, issue_score, total
from evenhand.methods.rivals import a_ppo, elbert, ggf, group_dro, lagrangian, r_ppo, shared
from evenhand.methods.rivals.critic import standardised
from support.rivals import epoch_of, scheme

SIZES = (3, 2)
GROUPS = sum(SIZES)
NUMBERS = st.floats(-5, 5).map(lambda v: round(v, 3))


@st.composite
def epochs(draw: Any, x: Any = None) -> Epoch:
    """Epochs of two identities and two issues; some issues do not apply."""
    n = draw(st.integers(1, 14))
    length = draw(st.integers(1, 3))
    codes = [draw(hnp.arrays(int, n, elements=st.integers(0, k - 1))) for k in SIZES]
    lengths = draw(hnp.arrays(int, n, elements=st.integers(1, length)))
    happened = st.sampled_from([0.0, 1.0, np.nan])
    return epoch_of(
        reward=draw(hnp.arrays(float, n, elements=st.sampled_from([-0.5, 0.0, 0.25, 1.0]))),
        x=draw(hnp.arrays(float, (n, 2), elements=happened if x is None else x)),
        inside=np.concatenate([np.eye(k)[c] for k, c in zip(SIZES, codes, strict=True)], axis=1),
        identity=np.repeat([0, 1], SIZES),
        advantage=draw(hnp.arrays(float, (n, length), elements=NUMBERS)),
        mask=(np.arange(length) < lengths[:, None]).astype(float),
        excess=draw(st.floats(0, 2)),
    )


def valid(outcome: Epoch, advantage: np.ndarray) -> np.ndarray:
    return advantage[outcome.mask > 0]


@given(
    st.floats(0, 10), st.lists(st.floats(0, 4) | st.just(np.nan)), st.floats(0, 4), st.floats(0, 9)
)
def test_the_multiplier_is_never_negative(lam, scores, limit, rate):
    for score in scores:
        before, lam = lam, lagrangian.multiplier(lam, score, limit, rate)
        assert lam >= 0
        if score > limit:
            assert lam >= before
        if score <= limit:
            assert lam <= before


@given(epochs(), st.floats(0, 100))
def test_a_cost_that_all_share_only_shrinks_the_advantage(outcome, lam):
    cost = np.full(outcome.mask.shape, 2.5)
    mixed = lagrangian.lagrangian_advantage(outcome.advantage, outcome.mask, cost, lam)
    plain = standardised(outcome.advantage, outcome.mask)
    np.testing.assert_allclose(valid(outcome, mixed), valid(outcome, plain) / (1 + lam), atol=1e-12)


@given(epochs())
def test_without_a_multiplier_the_advantage_is_only_standardised(outcome):
    cost = np.broadcast_to(np.arange(len(outcome))[:, None] / 7, outcome.mask.shape)
    mixed = lagrangian.lagrangian_advantage(outcome.advantage, outcome.mask, cost, 0.0)
    plain = standardised(outcome.advantage, outcome.mask)
    np.testing.assert_array_equal(valid(outcome, mixed), valid(outcome, plain))
    chosen = valid(outcome, plain)
    assert abs(chosen.mean()) < 1e-9
    assert chosen.std() < 1e-9 or abs(chosen.std() - 1.0) < 1e-9


@given(epochs(), epochs())
def test_the_running_score_is_the_score_of_all_so_far(before, outcome):
    earlier = scores.count(before.x, before.inside)
    running = shared.running_scores(outcome.x, outcome.inside, earlier)
    for t in range(len(outcome.x) + 1):
        x = np.concatenate([before.x, outcome.x[:t]])
        inside = np.concatenate([before.inside, outcome.inside[:t]])
        score = total(issue_score(gaps(count(x, inside))))
        np.testing.assert_allclose(running[t], np.nan_to_num(score), atol=1e-12)


@given(epochs(x=st.just(0.0)), st.floats(0, 1))
def test_a_ppo_scales_the_advantage_where_all_is_even(outcome, omega):
    method = a_ppo.APPO(strength=0.25, omega=omega)
    shaped = valid(outcome, method.teach(outcome, method.begin(scheme(GROUPS, 2)))[0])
    plain = valid(outcome, outcome.advantage)
    span = plain.max() - plain.min()
    expected = (plain - plain.min()) / span if span > 0 else np.zeros(len(plain))
    np.testing.assert_allclose(shaped, expected, atol=1e-12)


@given(epochs(), st.floats(0, 1), st.floats(0, 2))
def test_a_ppo_lies_between_0_and_the_sum_of_its_weights(outcome, omega, strength):
    method = a_ppo.APPO(strength=strength, omega=omega)
    shaped = method.teach(outcome, method.begin(scheme(GROUPS, 2)))[0]
    assert shaped.min() >= 0
    assert shaped.max() <= 1.0 + 2.0 * strength + 1e-12


@given(epochs(), st.floats(0, 4))
def test_r_ppo_never_adds(outcome, omega):
    method = r_ppo.RPPO(zeta=1.5, omega=omega)
    shaped = method.teach(outcome, method.begin(scheme(GROUPS, 2)))[0]
    assert (valid(outcome, shaped) <= valid(outcome, outcome.advantage)).all()


@given(hnp.arrays(float, st.integers(2, 7), elements=st.floats(0, 1)), st.floats(1, 100))
def test_the_soft_bias_is_at_least_the_hard_one(z, sharpness):
    b, gradient = elbert.soft_bias(z, sharpness)
    hard = z.max() - z.min()
    # log-sum-exp of M numbers exceeds their maximum by log(M)/β at most
    assert hard - 1e-12 <= b <= hard + 2 * np.log(len(z)) / sharpness + 1e-12
    np.testing.assert_allclose(gradient.sum(), 0.0, atol=1e-9)


@given(epochs(x=st.sampled_from([0.0, np.nan])))
def test_elbert_leaves_an_even_robot_alone(outcome):
    method = elbert.Elbert(alpha=7.0, standardise=False)
    shaped = method.teach(outcome, method.begin(scheme(GROUPS, 2)))[0]
    np.testing.assert_allclose(
        valid(outcome, shaped), valid(outcome, outcome.advantage), atol=1e-12
    )


@given(epochs(), st.floats(0, 10))
def test_elbert_is_linear_in_its_weight_and_sums_to_nothing(outcome, alpha):
    def change(weight: float) -> np.ndarray:
        method = elbert.Elbert(alpha=weight, standardise=False)
        plain = np.zeros((len(outcome.x), 1))
        mask = np.ones_like(plain)
        one = replace(outcome, advantages_of=lambda rewards: plain, mask=mask)
        return method.teach(one, method.begin(scheme(GROUPS, 2)))[0][:, 0]

    np.testing.assert_allclose(change(alpha), alpha * change(1.0), atol=1e-9)
    # weighing all services alike changes no rate
    np.testing.assert_allclose(change(1.0).sum(), 0.0, atol=1e-9)


@given(
    hnp.arrays(float, 4, elements=st.floats(0.01, 1)),
    hnp.arrays(float, 4, elements=st.floats(-1, 0.5)),
    hnp.arrays(float, 4, elements=st.sampled_from([0.0, 1.0, 9.0])),
)
def test_the_adversary_stands_still_without_a_step(share, loss, n):
    log_q = np.log(share / share.sum())
    np.testing.assert_allclose(group_dro.dro_step(log_q, loss, n, 0.0, 1.0), log_q, atol=1e-12)


@given(epochs(), st.floats(0, 1e6), st.floats(0, 10))
def test_shares_sum_to_one_and_the_worse_off_gain(outcome, rate, adjustment):
    method = group_dro.GroupDRO(rate=rate, adjustment=adjustment)
    state = method.teach(outcome, method.begin(scheme(GROUPS, 2)))[1]
    q = np.exp(state.log_q)
    np.testing.assert_allclose(q.sum(), 1.0, atol=1e-9)
    for a in range(GROUPS):
        for b in range(GROUPS):
            alike = state.seen[a] == state.seen[b] > 0
            if alike and state.mean[a] < state.mean[b]:
                assert q[a] >= q[b] - 1e-12


@given(epochs(), hnp.arrays(float, GROUPS, elements=st.floats(0, 1)))
def test_weighted_services_earn_what_weighted_groups_earn(outcome, group_weight):
    mean, n = shared.group_means(outcome.reward, outcome.inside)
    weight = shared.service_weights(group_weight, outcome.inside)
    np.testing.assert_allclose((weight * outcome.reward).mean(), group_weight @ mean, atol=1e-9)
    np.testing.assert_allclose(weight.mean(), group_weight[n > 0].sum(), atol=1e-9)


RATES = hnp.arrays(float, st.integers(1, 8), elements=st.sampled_from([-0.5, 0.0, 0.3, 0.3001, 1]))


@given(RATES, st.floats(0.01, 1))
def test_gini_weights_sum_to_one_and_fall_with_the_mean(mean, decay):
    weight = ggf.gini_weights(mean, np.ones(len(mean), bool), decay)
    np.testing.assert_allclose(weight.sum(), 1.0)
    order = np.argsort(mean, kind="stable")
    assert (np.diff(weight[order]) <= 1e-15).all()
    # welfare is the least that these weights give in any order, hence at most the mean
    geometric = decay ** np.arange(len(mean)) / (decay ** np.arange(len(mean))).sum()
    np.testing.assert_allclose(weight @ mean, geometric @ np.sort(mean), atol=1e-12)
    assert weight @ mean <= mean.mean() + 1e-12


@given(RATES)
def test_welfare_that_weighs_all_alike_is_the_mean(mean):
    weight = ggf.gini_weights(mean, np.ones(len(mean), bool), 1.0)
    np.testing.assert_allclose(weight, 1 / len(mean))


@given(epochs(), st.floats(0.1, 1), st.randoms(use_true_random=False))
def test_ggf_favours_no_group_by_its_place(outcome, decay, random):
    order = list(range(GROUPS))
    random.shuffle(order)
    method = ggf.GGF(decay=decay)
    groups = [outcome.groups[g] for g in order]
    there = replace(outcome, inside=outcome.inside[:, order], groups=groups)
    start = method.begin(scheme(GROUPS, 2))
    np.testing.assert_allclose(
        method.teach(outcome, start)[0], method.teach(there, start)[0], atol=1e-12
    )
