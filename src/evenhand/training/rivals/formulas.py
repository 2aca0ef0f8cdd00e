"""What the rivals compute: published ways to learn evenness, as pure functions on arrays.

Shapes: n services (one person each) in the order in which they were served, L decisions at most a
service, G groups of any number of identities, K issues. `mask` [n, L] is 1 for decisions that
happened; what stands at masked places changes nothing, and results are 0 there. Membership
`inside` [n, G] is 1, 0 or NaN (unknown: counts in no group); indicators `x` [n, K] are 1, 0 or NaN
(the issue does not apply).

Every method hands an advantage to the same update, so it is given here as a change of the
advantage of service quality: a weight a service, or a number added to all decisions of a service.
Such a number is on the scale of an advantage: if c [n] is added, the update climbs the objective
whose gradient is the mean over services of c ∇ log π(service).
"""

from __future__ import annotations

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, gaps, issue_score, total


def per_service(advantage: np.ndarray, mask: np.ndarray, added: np.ndarray) -> np.ndarray:
    """Advantages [n, L] with the number of each service, added [n], at all its decisions."""
    return np.where(mask > 0, advantage + added[:, None], 0.0)


# --- PPO-Lagrangian ------------------------------------------------------------------------------


def multiplier(lam: float, score: float, limit: float, rate: float) -> float:
    """λ ← [λ + η (J_c − d)]₊, the dual step of the constraint J_c <= d.

    Ray, Achiam and Amodei 2019 (Benchmarking Safe Exploration); OmniSafe `common/lagrange.py`,
    which steps λ before the policy, as is done here.

    Args:
        lam: λ so far.
        score: J_c, unevenness; NaN (not known) leaves λ as it is.
        limit: d.
        rate: η.
    """
    return lam if np.isnan(score) else max(0.0, lam + rate * (score - limit))


def lagrangian_advantage(
    advantage: np.ndarray, mask: np.ndarray, cost: np.ndarray, lam: float
) -> np.ndarray:
    """A' = (A_r − λ A_c) / (1 + λ), OmniSafe `naive_lagrange/ppo_lag.py`.

    A_c is the cost of the service minus the mean cost over decisions: centred and not scaled, as
    in OmniSafe, which also standardises A_r; that only changes the unit of λ. There is no cost
    critic, for a service has one cost, at its end.

    Args:
        advantage: A_r, [n, L].
        mask: [n, L].
        cost: what each service adds to the constrained score, on the scale of an advantage, [n].
        lam: λ.

    Returns:
        [n, L].
    """
    lengths = (mask > 0).sum(axis=1)
    centred = cost - (lengths * cost).sum() / max(lengths.sum(), 1)
    return per_service(advantage, mask, -lam * centred) / (1.0 + lam)


# --- A-PPO and R-PPO -----------------------------------------------------------------------------


def running_scores(x: np.ndarray, inside: np.ndarray, earlier: Counts) -> np.ndarray:
    """Δ after every person: the total issue score (Eq. 2) of all services so far.

    Counts of the first t services are cumulative sums, so all scores come at once.

    Args:
        x: indicators, [n, K].
        inside: membership, [n, G].
        earlier: counts of the services before these, [G, K]; zeros for none.

    Returns:
        [n + 1], the first before anybody was served; 0 as long as nothing can be compared.
    """
    applies = (~np.isnan(x)).astype(float)[:, None, :]
    happened = np.nan_to_num(x)[:, None, :]
    is_in = np.nan_to_num(inside)[:, :, None]
    is_out = np.nan_to_num(1.0 - inside)[:, :, None]

    def so_far(before: np.ndarray, each: np.ndarray) -> np.ndarray:
        return np.cumsum(np.concatenate([before[None], each]), axis=0)

    counts = Counts(
        so_far(earlier.inside_n, is_in * applies),
        so_far(earlier.inside_x, is_in * happened),
        so_far(earlier.outside_n, is_out * applies),
        so_far(earlier.outside_x, is_out * happened),
    )
    return np.nan_to_num(total(issue_score(gaps(counts))))


def a_ppo_advantage(
    advantage: np.ndarray,
    mask: np.ndarray,
    score: np.ndarray,
    omega: float,
    beta: tuple[float, float, float],
) -> np.ndarray:
    """A' = β₀ A + β₁ min(0, ω − Δ_t) + β₂ min(0, −1[Δ_t > ω] δΔ_t), with δΔ_t = Δ_t − Δ_{t−1}.

    Yu et al. 2022 (arXiv 2210.12546), Eq. 3; POCAR `sb3/ppo.py`, which scales each of the three
    terms to 0..1 over the batch first. The batch here is the epoch, and a term that is everywhere
    the same becomes 0.

    Args:
        advantage: A, [n, L].
        mask: [n, L].
        score: Δ before the first person and after every person, [n + 1].
        omega: ω, unevenness that is allowed.
        beta: β.

    Returns:
        [n, L].
    """
    valid = mask > 0
    delta = score[1:]
    over = np.minimum(0.0, omega - delta)
    worse = np.minimum(0.0, np.where(delta > omega, -np.diff(score), 0.0))
    terms = (advantage, over[:, None], worse[:, None])
    result = sum(b * _unit(term, valid) for b, term in zip(beta, terms, strict=True))
    return np.where(valid, result, 0.0)


def _unit(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Scaled so that valid entries go from 0 to 1; all 0 if they are alike."""
    chosen = np.broadcast_to(values, valid.shape)[valid]
    if chosen.size == 0 or chosen.max() <= chosen.min():
        return np.zeros(valid.shape)
    return (values - chosen.min()) / (chosen.max() - chosen.min())


def r_ppo_penalty(score: np.ndarray, omega: float, zeta: float) -> np.ndarray:
    """r'_t − r_t = −ζ Δ_t where Δ_t >= ω, else 0: R-PPO, POCAR `environments/rewards.py`.

    Args:
        score: as in `a_ppo_advantage`, [n + 1].
        omega: ω.
        zeta: ζ.

    Returns:
        [n].
    """
    delta = score[1:]
    return np.where(delta < omega, 0.0, -zeta * delta)


# --- ELBERT-PO -----------------------------------------------------------------------------------


def soft_bias(z: np.ndarray, sharpness: float) -> tuple[float, np.ndarray]:
    """Soft bias b = soft max z − soft min z, and its gradient.

    Soft max is log Σ exp(βz) / β and soft min log Σ exp(−βz) / −β; two groups are compared by max
    and min themselves. Xu et al. 2024 (arXiv 2309.03426), `sb3_ppo_fair/ppo_fair.py`.

    Args:
        z: long-term benefit rates of the groups, [M].
        sharpness: β.

    Returns:
        b and db/dz [M]; zeros for fewer than two groups.
    """
    if len(z) < 2:
        return 0.0, np.zeros(len(z))
    if len(z) == 2:
        low = int(np.argmin(z))
        return float(abs(z[0] - z[1])), np.where(np.arange(2) == low, -1.0, 1.0)
    top = np.logaddexp.reduce(sharpness * z)
    bottom = np.logaddexp.reduce(-sharpness * z)
    gradient = np.exp(sharpness * z - top) - np.exp(-sharpness * z - bottom)
    return float((top + bottom) / sharpness), gradient


def ratio_slope(
    ratio: np.ndarray, known: np.ndarray, identity: np.ndarray, sharpness: float
) -> np.ndarray:
    """∂h/∂z of h = Σ b² over identities and issues, ELBERT's penalty for each of them.

    Args:
        ratio: z = supply / demand of each group, [G, K].
        known: whether the ratio is known, bool [G, K]; others are left out.
        identity: number of the identity that a group belongs to, [G].
        sharpness: β of `soft_bias`.

    Returns:
        [G, K], 0 where not known.
    """
    slope = np.zeros(ratio.shape)
    for name in np.unique(identity):
        for k in range(ratio.shape[1]):
            chosen = np.flatnonzero((identity == name) & known[:, k])
            b, gradient = soft_bias(ratio[chosen, k], sharpness)
            slope[chosen, k] = 2.0 * b * gradient
    return slope


def elbert_credit(
    x: np.ndarray, inside: np.ndarray, ratio: np.ndarray, demand: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Σ ∂h/∂z (A^S / D − S A^D / D²): what each service adds to h. A' = A − α times this.

    Supply S is the issue, demand D what it applies to: the request for willingness and risk, the
    response for quality and priority. A service has one outcome, so that A^S and A^D are what it
    supplied and demanded minus the means S and D; since S = z D, the means cancel and
    1(i ∈ g) (x_ik − z_gk) / D_gk is left (0 where the issue does not apply).

    Args:
        x: indicators, [n, K].
        inside: membership, [n, G].
        ratio: z = S / D, [G, K].
        demand: D, mean over all services, [G, K]; nothing is said of groups with 0.
        slope: ∂h/∂z, [G, K].

    Returns:
        [n].
    """
    belongs = np.nan_to_num(inside)
    scale = np.where(demand > 0, slope / np.where(demand > 0, demand, 1.0), 0.0)
    supplied = (belongs @ scale) * np.nan_to_num(x)
    expected = (belongs @ (scale * ratio)) * ~np.isnan(x)
    return (supplied - expected).sum(axis=1)


# --- group DRO and GGF ---------------------------------------------------------------------------


def group_means(reward: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J_g, the mean reward of each group, and how many services it had.

    Args:
        reward: [n].
        inside: membership, [n, G].

    Returns:
        Mean (0 for an empty group) and number, both [G].
    """
    belongs = np.nan_to_num(inside)
    n = belongs.sum(axis=0)
    return reward @ belongs / np.maximum(n, 1.0), n


def service_weights(group_weight: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Gradient of Σ_g w_g J_g as a weight of each advantage: n Σ_g w_g 1(i ∈ g) / n_g.

    Weights of the services have the mean Σ w over the groups that are not empty.

    Args:
        group_weight: w, [G].
        inside: membership, [n, G].

    Returns:
        [n]; 0 for a person in no group.
    """
    belongs = np.nan_to_num(inside)
    return len(belongs) * (belongs @ (group_weight / np.maximum(belongs.sum(axis=0), 1.0)))


def dro_step(
    log_q: np.ndarray, loss: np.ndarray, n: np.ndarray, rate: float, adjustment: float
) -> np.ndarray:
    """Step of the adversary of group DRO: q_g ∝ q_g exp(η (loss_g + C / √n_g)), in logs.

    Sagawa et al. 2020 (arXiv 1911.08731), algorithm 1 with group adjustments;
    kohpangwei/group_DRO `loss.py`.

    Args:
        log_q: log of the shares so far, [G].
        loss: minus the mean reward of each group, [G].
        n: services of each group that its data set holds, [G]; a group with 0 keeps its share.
        rate: η.
        adjustment: C.

    Returns:
        [G].
    """
    seen = n > 0
    if not seen.any():
        return log_q
    moved = log_q[seen] + rate * (loss[seen] + adjustment / np.sqrt(n[seen]))
    result = log_q.copy()
    result[seen] = moved - np.logaddexp.reduce(moved) + np.logaddexp.reduce(log_q[seen])
    return result


def gini_weights(mean: np.ndarray, known: np.ndarray, decay: float) -> np.ndarray:
    """w_σ of the generalised Gini welfare Σ_i w_i J_(i), with J_(1) the least.

    w_i ∝ decay^(i−1), with sum 1: the worst-off group weighs most. Groups with the same J share
    their weights evenly (also a supergradient), so that no group is favoured by its place in a
    list. Siddique, Weng and Zimmer 2020 (ICML); their later code takes 1 / decay as
    `weight_coef`. It picks weights by argsort, which is the rank only if the order is its own
    inverse; here the rank is meant.

    Args:
        mean: J of each group, [G].
        known: whether it is known, bool [G].
        decay: in (0, 1]; 1 weighs all alike.

    Returns:
        [G], 0 where not known.
    """
    weight = np.zeros(len(mean))
    if known.any():
        _, place, ties = np.unique(mean[known], return_inverse=True, return_counts=True)
        geometric = decay ** np.arange(known.sum())
        first = np.concatenate([[0], np.cumsum(ties)[:-1]])
        shared = np.add.reduceat(geometric, first) / ties
        weight[known] = shared[place] / geometric.sum()
    return weight


# --- unawareness ---------------------------------------------------------------------------------


def unaware(observation: np.ndarray, groups: int) -> np.ndarray:
    """The observation without whom one serves: its first columns, the identities, are 0.

    Args:
        observation: [..., O], identities first.
        groups: number of identity columns, at most O.

    Returns:
        A copy, [..., O].

    Raises:
        InputError: when the observation has fewer columns.
    """
    seen = np.array(observation)
    if not 0 <= groups <= seen.shape[-1]:
        raise InputError(
            f"an observation of {seen.shape[-1]} numbers has no {groups} columns of identities: "
            "give the number of groups that it begins with"
        )
    seen[..., :groups] = 0
    return seen
