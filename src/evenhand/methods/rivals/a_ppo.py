"""A-PPO: advantages are lowered by the running unevenness (Yu et al. 2022)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import whole
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.paper.scores import count
from evenhand.methods.registry import method
from evenhand.methods.rivals.shared import Past, Rival, answer_scores, running_scores, within


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
    over, worse = _beyond(score[:-1], score[1:], omega)
    terms = (advantage, over[:, None], worse[:, None])
    result = sum(b * _unit(term, valid) for b, term in zip(beta, terms, strict=True))
    return np.where(valid, result, 0.0)


def _beyond(before: np.ndarray, delta: np.ndarray, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """min(0, ω − Δ_t) and min(0, −1[Δ_t > ω] δΔ_t)."""
    over = np.minimum(0.0, omega - delta)
    return over, np.minimum(0.0, np.where(delta > omega, before - delta, 0.0))


def _unit(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Scaled so that valid entries go from 0 to 1; all 0 if they are alike."""
    chosen = np.broadcast_to(values, valid.shape)[valid]
    if chosen.size == 0 or chosen.max() <= chosen.min():
        return np.zeros(valid.shape)
    return (values - chosen.min()) / (chosen.max() - chosen.min())


@method("a_ppo", label="A-PPO", colour=palette.PURPLE, marker="v", filled=False)
@dataclass(frozen=True)
class APPO(Rival):
    """A-PPO: advantages are lowered where unevenness is beyond ``omega``, and where it grows.

    β and ω are those of the source in its attention task. The source also shows Δ to the policy:
    here the services of an epoch run at once, with one Δ for all, which a policy could not use.
    """

    strength: float = 0.15
    """β₁ and β₂: weights of unevenness beyond omega, and of its growth there; β₀ is 1."""

    omega: float = 0.05
    """Total issue score that is allowed."""

    windows: int = 8
    """Epochs that the running score is pooled over, the running one included."""

    def __post_init__(self) -> None:
        for name in ("strength", "omega"):
            within(name, getattr(self, name), 0.0)
        whole("windows", self.windows, 1, 1000)

    def begin(self, scheme: Any) -> Past:
        """No epoch yet."""
        return Past.none(self.windows, len(scheme.groups), len(scheme.issues))

    def lesson(self, epoch: Epoch, memory: Past) -> tuple[np.ndarray, Past]:
        """All decisions of a service answer for the score after it, and for its change."""
        score = running_scores(epoch.x, epoch.inside, memory.kept)
        beta = (1.0, self.strength, self.strength)
        advantage = a_ppo_advantage(epoch.advantage, epoch.mask, score, self.omega, beta)
        now = count(epoch.x, epoch.inside)
        return advantage, memory.after(now, len(epoch.x))

    def value(self, answers: Answers, memory: Past) -> np.ndarray:
        """The three terms by the score that would have been there after each answer, [n, A].

        Each is scaled over all answers, as the source scales over its batch.
        """
        window, everywhere = answers.window, np.ones(answers.reward.shape, bool)
        before = running_scores(window.x, window.inside, memory.before)[:-1, None]
        delta = answer_scores(window.x, answers.x, window.inside, memory.before)
        over, worse = _beyond(before, delta, self.omega)
        quality, over, worse = (_unit(term, everywhere) for term in (answers.reward, over, worse))
        return quality + self.strength * (over + worse)
