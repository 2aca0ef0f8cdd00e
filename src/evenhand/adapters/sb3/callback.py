"""A callback for PPO and A2C: writes services down, pays for evenness, examines every update.

A rollout is what an epoch is in the paper. A method that can pay before an epoch is over (``pay``)
pays each service by its window where that is over too, else by the one before; every other method
is taught the services of the rollout and gives their rewards or advantages. Then the update
follows. When the next rollout begins, the update is examined along
the bias gradient of the services that ended in this one. Of a service that began in the rollout
before, the decisions of this rollout count. A service whose beginning was not seen is left out.
"""

# pyright: reportMissingImports=false
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import DictRolloutBuffer, RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from evenhand.adapters.episodes import FactsOf, Info, kept, together
from evenhand.adapters.guidance import JudgeSettings
from evenhand.adapters.judging import Judging
from evenhand.adapters.ledger import Ledger
from evenhand.adapters.sampler import Sampler
from evenhand.adapters.sb3.gradients import Weights, examine, weights_of
from evenhand.core import tree
from evenhand.core.errors import InputError
from evenhand.methods.beyond import reflection
from evenhand.methods.beyond.influence import CreditSettings, influence
from evenhand.methods.beyond.reflection import Directions, Reflection, ReflectionSettings
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import count, scores_of
from evenhand.methods.scheme import Scheme

if TYPE_CHECKING:
    from evenhand.adapters.page import Examined

_REFLECT = ReflectionSettings()


@dataclass(frozen=True, eq=False)
class _End:
    """How one episode ended: at which step of the rollout, where, and with what."""

    step: int
    lane: int
    reward: float
    steps: int
    truncated: bool
    observation: Any
    info: Info
    first: Info


@dataclass(frozen=True, eq=False)
class _Rollout:
    """What is needed to examine the update that follows a rollout."""

    before: Weights
    observations: Any
    actions: np.ndarray
    service: np.ndarray
    directions: Directions


class EvennessCallback(BaseCallback):
    """Judges, guides and examines the learning of PPO or A2C on any environment.

    Services of a rollout that another callback breaks off are left out, as that rollout is not
    learned from.

    Attributes:
        ledger: all services of training, with windows and what was paid.
        reflections: what each update was along the bias gradient; none for an update in whose
            rollout no service ended.
    """

    def __init__(
        self,
        scheme: Scheme,
        facts: FactsOf,
        *,
        sampler: Sampler | None = None,
        rng: np.random.Generator | None = None,
        settings: JudgeSettings | None = None,
        detector: Detector | None = None,
        reflect: ReflectionSettings | None = _REFLECT,
        verbose: int = 0,
    ) -> None:
        """Make a callback for one call of ``learn``, or for several in a row.

        Args:
            scheme: identities, facts and issues.
            facts: from ended episodes to facts, see ``adapters.FactsOf``.
            sampler: draws who is served, for environments that know nobody.
            rng: source of randomness of the sampler.
            settings: of windows and guidance.
            detector: judges windows.
            reflect: when an update is abnormal; None examines no update.
            verbose: 1 prints alarms.

        Raises:
            InputError: for what does not fit together.
        """
        super().__init__(verbose)
        self._parts = (scheme, facts, sampler, rng, settings, detector)
        self._judging = Judging(0, scheme, facts, sampler, rng, settings, detector)
        self._reflect = reflect
        self._tau = self.ledger.settings.weights(scheme)
        self.reflections: list[Reflection] = []
        if reflect is not None:
            self._past = reflection.Past.empty(len(scheme.identities), len(scheme.issues), reflect)
        self._lanes = 0
        self._saved: Mapping[str, np.ndarray] | None = None
        self._ends: list[_End] | None = None
        self._left: Any = None
        self._pending: _Rollout | None = None

    @property
    def ledger(self) -> Ledger:
        """All services that have ended, with verdicts, rows and what was paid."""
        return self._judging.ledger

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint of guided training needs beside the model, for ``np.savez``.

        Take it when ``learn`` has returned; episodes under way are not in it.
        """
        past = {} if self._reflect is None else tree.leaves(self._past, "reflection")
        return self._judging.state() | past

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on in the next ``learn`` where another callback of the same settings stood.

        Args:
            state: what its `state` gave; an opened ``.npz`` file will do.

        Raises:
            InputError: now or when learning begins, when it was of other settings.
        """
        if self._reflect is not None:
            self._past = tree.fill(self._past, dict(state), "reflection")
        self._saved, self._lanes = dict(state), 0
        if self._judging.queue is None:
            self._judging.restore(self._saved)

    @property
    def examined(self) -> Examined:
        """The updates with the settings by which they were examined, for ``page.write``.

        Raises:
            InputError: when the callback was told to examine none.
        """
        from evenhand.adapters.page import Examined  # brings Matplotlib

        if self._reflect is None:
            raise InputError(
                "unsupported reflect", "the callback examines no update: leave reflect as it is"
            )
        return Examined(self.reflections, self._reflect)

    def _init_callback(self) -> None:
        if not isinstance(self.model, OnPolicyAlgorithm):
            raise InputError(
                "unsupported model",
                f"{type(self.model).__name__} keeps no rollouts: the callback works with PPO and "
                "A2C",
            )
        if type(self.model.rollout_buffer) not in (RolloutBuffer, DictRolloutBuffer):
            raise InputError(
                "unsupported model",
                f"{type(self.model).__name__} has a {type(self.model.rollout_buffer).__name__}: "
                "the callback works with the rollout buffers of PPO and A2C",
            )

    def _on_training_start(self) -> None:
        lanes = self.training_env.num_envs
        if not self._lanes:
            self._judging = Judging(lanes, *self._parts)
            if self._saved is not None:
                self._judging.restore(self._saved)
        elif lanes != self._lanes:
            raise InputError(
                "changed callback",
                f"the callback has watched {self._lanes} environments and is given {lanes}: make a "
                "new callback, or keep the number",
            )
        model: Any = self.model
        if self.locals["reset_num_timesteps"] or model._last_obs is not self._left:
            # the environments were reset, or have gone on unseen
            self._total, self._steps = np.zeros(lanes), np.zeros(lanes, np.int64)
            self._seen = model._last_episode_starts.astype(bool)
            self._first = [kept(info) for info in self.training_env.unwrapped.reset_infos]
        self._lanes = lanes
        self._ends = None
        self._norm = model.get_vec_normalize_env()

    def _on_rollout_start(self) -> None:
        self._look_back()
        self._ends = []

    def _on_step(self) -> bool:
        if self._ends is None:
            raise InputError(
                "unsupported callback",
                "the callback is told of steps and of no rollout, as inside EveryNTimesteps: give "
                "it to learn itself, or in a list of callbacks",
            )
        norm = self._norm
        self._total += self.locals["rewards"] if norm is None else norm.get_original_reward()
        self._steps += 1
        dones, infos = self.locals["dones"], self.locals["infos"]
        begun = self.training_env.unwrapped.reset_infos
        for lane in np.flatnonzero(dones).tolist():
            if self._seen[lane]:
                self._ends.append(self._end(lane, kept(infos[lane])))
            self._first[lane] = kept(begun[lane])
            self._total[lane], self._steps[lane], self._seen[lane] = 0.0, 0, True
        return True

    def _end(self, lane: int, info: dict[str, Any]) -> _End:
        observation = info.get("terminal_observation")
        if self._norm is not None and observation is not None:
            observation = info["terminal_observation"] = self._norm.unnormalize_obs(observation)
        return _End(
            self.locals["n_steps"],
            lane,
            float(self._total[lane]),
            int(self._steps[lane]),
            bool(info.get("TimeLimit.truncated", False)),
            observation,
            info,
            self._first[lane],
        )

    def _on_rollout_end(self) -> None:
        if not self._ends:
            return
        first = len(self.ledger)
        guide, columns = self.ledger.guide, _columns(self._ends)
        taught = self.ledger.guided and not guide.looks_ahead
        paid = self._judging.write(*columns, afterwards=True, later=taught)
        model: Any = self.model
        buffer = model.rollout_buffer
        if taught:
            paid = self._teach(buffer, first)
        if paid.any():
            at = ([end.step for end in self._ends], [end.lane for end in self._ends])
            buffer.rewards[at] += paid
            buffer.compute_returns_and_advantage(self.locals["values"], self.locals["dones"])
        x, inside = self.ledger.rows(first)
        scheme = self.ledger.scheme
        scores = scores_of(count(x, inside), scheme.groups, scheme.issue_names)
        self.logger.record("evenness/total", scores.total)
        self.logger.record("evenness/without_issue", float((x != 1.0).all(axis=1).mean()))
        self.logger.record("evenness/services", len(self.ledger))
        self.logger.record("evenness/paid", float(paid.mean()))
        if self._reflect is not None:
            exact = CreditSettings(shrink=0.0)
            found = influence(x, inside, self._tau, settings=exact)
            seen = buffer.observations
            self._pending = _Rollout(
                weights_of(model.policy),
                # the buffer changes its dict while it is learned from, but not the arrays
                dict(seen) if isinstance(seen, dict) else seen,
                buffer.actions,
                _services(self._ends, buffer.rewards.shape),
                Directions.of(found, scheme.groups, scheme.issue_names, self._tau),
            )

    def _teach(self, buffer: Any, first: int) -> np.ndarray:
        """Teach the method the services of the rollout, all their decisions in it.

        Decisions of services that have not ended keep their advantages.

        Args:
            buffer: of the rollout; advantages that the method gives are written into it.
            first: of these services in the ledger.

        Returns:
            What is added to their rewards, [n].
        """
        ends, guide = self._ends or [], self.ledger.guide
        lane = np.array([end.lane for end in ends])[:, None]
        stop = np.array([end.step + 1 for end in ends])[:, None]
        begin = np.maximum(0, stop - np.array([end.steps for end in ends])[:, None])
        at = begin + np.arange(int((stop - begin).max()))
        mask = at < stop
        advantage = np.where(mask, buffer.advantages[np.minimum(at, stop - 1), lane], 0.0)
        reward = np.array([end.reward for end in ends])
        x, inside = self.ledger.rows(first)
        epoch, watch = guide.epoch(x, inside, reward, mask.astype(float), advantage.astype(float))
        given = guide.teach(epoch, watch)
        if given.advantages is not None:
            lanes = np.broadcast_to(lane, at.shape)
            buffer.advantages[at[mask], lanes[mask]] = given.advantages[mask]
            return np.zeros(len(reward))
        paid = given.added(reward)
        self.ledger.pay(paid)
        return paid

    def _on_training_end(self) -> None:
        self._look_back()
        model: Any = self.model
        self._left = model._last_obs

    def _look_back(self) -> None:
        """Examine the update that was made since the last rollout."""
        if self._pending is None or self._reflect is None:
            return
        last, self._pending = self._pending, None
        policy: Any = self.model.policy
        observations = last.observations
        seen = (
            {name: _flat(one, policy) for name, one in observations.items()}
            if isinstance(observations, dict)
            else _flat(observations, policy)
        )
        actions = _flat(last.actions, policy)
        if isinstance(self.model.action_space, spaces.Discrete):
            actions = actions.long().flatten()
        directions = last.directions
        found = examine(policy, last.before, seen, actions, last.service.ravel(), directions.flat)
        told, self._past = reflection.conclude(directions, *found, self._past, self._reflect)
        self.reflections.append(told)
        self.logger.record("evenness/reflection_cosine", float(told.cosine[-1, -1]))
        self.logger.record("evenness/reflection_alarm", float(told.alarm))
        if told.alarm and self.verbose:
            print(
                f"update {len(self.reflections)} is abnormal: it raises {told.issue} by "
                f"{told.identity}, in favour of {', '.join(told.favoured)} (p = {told.p_value:.3f})"
            )


def _columns(ends: list[_End]) -> tuple[Any, ...]:
    lane = np.array([end.lane for end in ends], np.int64)
    order = np.argsort(lane, kind="stable")
    rank = np.empty_like(lane)
    rank[order] = np.arange(len(lane)) - np.searchsorted(lane[order], lane[order])
    truncated = np.array([end.truncated for end in ends], bool)
    return (
        lane,
        rank,
        np.array([end.reward for end in ends], float),
        np.array([end.steps for end in ends], np.int64),
        ~truncated,
        truncated,
        together([end.observation for end in ends]),
        [(end.info, end.first, -1) for end in ends],
    )


def _services(ends: list[_End], shape: tuple[int, int]) -> np.ndarray:
    """Which of the services that have ended each decision belongs to, -1 for none, [T, n]."""
    service = np.full(shape, -1)
    for number, end in enumerate(ends):
        stop = end.step + 1
        service[max(0, stop - end.steps) : stop, end.lane] = number
    return service


def _flat(values: np.ndarray, policy: Any) -> torch.Tensor:
    """[T, n, ...] as a tensor [T n, ...], a step after the other."""
    return torch.as_tensor(values.reshape(-1, *values.shape[2:]), device=policy.device)
