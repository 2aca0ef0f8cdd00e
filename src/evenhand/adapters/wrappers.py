"""Gymnasium wrappers that judge any environment: an episode is a service.

The environment need not know anything of Evenhand. The facts function is asked at once about the
first episodes that end, so that nonsense is found early, and about every one where guidance has to
be paid. Else it is asked about many together, so that a step costs hardly more than without. What
an episode began and ended with is copied, for environments go on with their arrays and dicts. An
episode that a reset cuts short is no service; where people are drawn, its person is the next one
served in that lane.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Generic, SupportsFloat

import gymnasium as gym
import numpy as np
from gymnasium.core import ActType, ObsType
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import iterate

from evenhand.adapters.episodes import FINAL_OBS, FactsOf, Info, kept, together
from evenhand.adapters.guidance import JudgeSettings
from evenhand.adapters.judging import Judged, Judging
from evenhand.adapters.lane_log import SMALL, STEPS, Track, mode_of, parted, statistics_of
from evenhand.adapters.sampler import Sampler
from evenhand.core.errors import InputError
from evenhand.methods.paper.detector import Detector
from evenhand.methods.scheme import Scheme

TOGETHER = 128
"""Ended episodes that the facts function is asked about together, where that can wait."""


class JudgeServices(
    Judged,
    gym.Wrapper[ObsType, ActType, ObsType, ActType],
    RecordConstructorArgs,
    Generic[ObsType, ActType],
):
    """Judges one environment; put it inside a wrapper that resets by itself."""

    def __init__(
        self,
        env: gym.Env[ObsType, ActType],
        scheme: Scheme,
        facts: FactsOf,
        *,
        sampler: Sampler | None = None,
        rng: np.random.Generator | None = None,
        settings: JudgeSettings | None = None,
        detector: Detector | None = None,
    ) -> None:
        """Wrap an environment.

        Args:
            env: any.
            scheme: identities, facts and issues.
            facts: from ended episodes to facts, see ``episodes.FactsOf``.
            sampler: draws who is served, for environments that know nobody.
            rng: source of randomness of the sampler; ``reset`` does not seed it.
            settings: of windows and guidance.
            detector: judges windows.

        Raises:
            InputError: for what does not fit together.
        """
        RecordConstructorArgs.__init__(
            self,
            scheme=scheme,
            facts=facts,
            sampler=sampler,
            rng=rng,
            settings=settings,
            detector=detector,
        )
        gym.Wrapper.__init__(self, env)
        self._judging = Judging(1, scheme, facts, sampler, rng, settings, detector)
        self._total, self._steps = 0.0, 0
        self._first: Info = {}
        self._waiting: list[tuple[Any, ...]] = []

    @property
    def people(self) -> np.ndarray | None:
        """Who is served now, codes int64 [D]; None where the facts tell."""
        queue = self._judging.queue
        return None if queue is None else queue.now(len(self._waiting))[0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObsType, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._total, self._steps, self._first = 0.0, 0, kept(info)
        return observation, info

    def step(self, action: ActType) -> tuple[ObsType, SupportsFloat, bool, bool, dict[str, Any]]:
        """One step; at the end of an episode its reward is shaped by the guidance.

        Raises:
            InputError: for facts that make no sense.
        """
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._total += reward  # pyright: ignore[reportOperatorIssue] - rewards are numbers
        self._steps += 1
        if terminated or truncated:
            # copies, for the environment may go on with the same array and dict
            seen, last = deepcopy(observation), kept(info)
            self._waiting.append(
                (_number(self._total), self._steps, terminated, truncated, seen, last, self._first)
            )
            self._total, self._steps = 0.0, 0
            if self._judging.ledger.guided:
                paid = self._write()
                if paid.any():
                    reward = _number(reward) + float(paid[0])
            elif len(self._waiting) >= TOGETHER or not len(self._judging.ledger):
                self._write()
        return observation, reward, terminated, truncated, info

    def write(self) -> None:
        """Ask for the facts of the episodes that wait.

        Raises:
            InputError: for facts that make no sense.
        """
        if self._waiting:
            self._write()

    def _write(self) -> np.ndarray:
        waiting, self._waiting = self._waiting, []
        totals, steps, terminated, truncated, observations, infos, firsts = zip(
            *waiting, strict=True
        )
        number = len(waiting)
        return self._judging.write(
            np.zeros(number, np.int64),
            np.arange(number),
            np.array(totals, float),
            np.array(steps, np.int64),
            np.array(terminated, bool),
            np.array(truncated, bool),
            together(observations),
            [(info, first, -1) for info, first in zip(infos, firsts, strict=True)],
        )


class JudgeVectorServices(
    Judged,
    VectorWrapper[ObsType, ActType, ObsType, ActType, np.ndarray],
    Generic[ObsType, ActType],
):
    """Judges many environments at once, in each of Gymnasium's autoreset modes.

    In mode SAME_STEP Gymnasium's own vector environments hand out the array of the last
    observation: what a single environment writes into it at its reset stands there.
    """

    def __init__(
        self,
        env: VectorEnv[ObsType, ActType, np.ndarray],
        scheme: Scheme,
        facts: FactsOf,
        *,
        sampler: Sampler | None = None,
        rng: np.random.Generator | None = None,
        settings: JudgeSettings | None = None,
        detector: Detector | None = None,
    ) -> None:
        """Wrap a vector environment; arguments and errors as for :class:`JudgeServices`.

        Raises:
            InputError: also when the metadata of the environment do not say its autoreset mode.
        """
        super().__init__(env)
        self._mode = mode_of(env)
        self._statistics = statistics_of(env)
        self._judging = Judging(env.num_envs, scheme, facts, sampler, rng, settings, detector)
        self._track = Track(env.num_envs, self._mode)
        self._same = self._mode is AutoresetMode.SAME_STEP
        self._next = self._mode is AutoresetMode.NEXT_STEP
        self._after = self._checked = False
        self._at_once = True

    @property
    def people(self) -> np.ndarray | None:
        """Who is served in each lane now, codes int64 [n, D]; None where the facts tell."""
        queue = self._judging.queue
        return None if queue is None else queue.now(self._track.ended())

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObsType, dict[str, Any]]:
        """Begin episodes in every lane, or in those of ``options["reset_mask"]``."""
        mask = None if options is None else options.get("reset_mask")
        observations, infos = self.env.reset(seed=seed, options=options)  # pyright: ignore[reportArgumentType] - lists of seeds too
        lanes = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        track = self._track
        over = self._mode is AutoresetMode.DISABLED and track.just_ended()[lanes].all()
        if over and track.step not in track.later:
            # the cut will find the lanes' next episodes here by itself
            track.later[track.step] = kept(infos)
            return observations, infos
        self._write()
        track.begin(lanes, kept(infos))
        self._after = track.begins()
        return observations, infos

    def step(
        self, actions: ActType
    ) -> tuple[ObsType, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step in every lane; where episodes end, guidance shapes their rewards.

        Raises:
            InputError: for facts that make no sense.
        """
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        if not self._checked:
            self._check(observations, rewards, terminated, truncated)
        track = self._track
        step = track.step
        track.rewards[step] = rewards
        track.step = step + 1
        if self._after:
            track.later[step] = kept(infos)
            self._after = False
        # the quickest way to ask whether any is true
        ended, cut_off = terminated.tobytes(), truncated.tobytes()
        if 1 in ended or 1 in cut_off:
            seen = None
            if track.seen is not None:
                track.seen[len(track.ends)] = observations
            else:
                seen = self._seen(observations, terminated | truncated, infos)
            last = infos
            if self._same:
                last, begun = parted(infos, self._statistics)
                track.later[step + 1] = kept(begun)
            track.ends.append((step, ended, cut_off, seen, kept(last)))
            self._after = self._next
            if self._at_once:
                rewards = self._shaped(rewards)
        if track.step == STEPS:
            self._write()
        return observations, rewards, terminated, truncated, infos

    def write(self) -> None:
        """Ask for the facts of the episodes that wait.

        Raises:
            InputError: for facts that make no sense.
        """
        if self._track.ends:
            self._write()

    def _write(self) -> tuple[np.ndarray, np.ndarray]:
        """Cut what happened into episodes; their lanes, and what evenness pays for them."""
        cut = self._track.cut()
        if cut is None:
            return np.zeros(0, np.int64), np.zeros(0)
        return cut.lane, self._judging.write(*cut)

    def _shaped(self, rewards: np.ndarray) -> np.ndarray:
        lanes, paid = self._write()
        self._at_once = self._judging.ledger.guided
        if not paid.any():
            return rewards
        shaped = rewards.astype(rewards.dtype if rewards.dtype.kind == "f" else np.float64)
        shaped[lanes] += paid
        return shaped

    def _seen(self, observations: Any, over: np.ndarray, infos: dict[str, Any]) -> list[Any]:
        """Copies of the last observations of lanes whose episodes are over."""
        lanes = over.nonzero()[0].tolist()
        if self._same:
            observations = infos.get(FINAL_OBS, [None] * self.num_envs)
        elif _plain(observations):
            return list(observations[lanes])
        elif not isinstance(observations, np.ndarray):
            observations = list(iterate(self.env.observation_space, observations))
        return [deepcopy(observations[lane]) for lane in lanes]

    def _check(self, observations: Any, rewards: Any, terminated: Any, truncated: Any) -> None:
        """Once: whether this is an environment as Gymnasium wants it, and what it shows."""
        for name, values in (("terminated", terminated), ("truncated", truncated)):
            if not isinstance(values, np.ndarray) or values.dtype != bool:
                raise InputError(
                    "type environment",
                    f"the environment's {name} are no NumPy array of True and False: wrap it so "
                    "that they are, for instance with gymnasium.wrappers.vector.JaxToNumpy",
                )
        if not isinstance(rewards, np.ndarray) or rewards.shape != (self.num_envs,):
            raise InputError(
                "shape environment",
                f"the environment's rewards are no NumPy array of {self.num_envs} numbers: give "
                "one a lane",
            )
        if not self._same and _plain(observations) and observations.nbytes <= SMALL:
            self._track.seen = np.empty((STEPS, *observations.shape), observations.dtype)
        self._checked = True


def _plain(observations: Any) -> bool:
    return isinstance(observations, np.ndarray) and observations.dtype != object


def _number(reward: Any) -> float:
    """A reward as a number, also where the environment gives an array of one."""
    found = np.asarray(reward, float)
    if found.size != 1:
        raise InputError(
            "shape environment",
            f"the environment's reward is an array of shape {found.shape}: give one number a step",
        )
    return found.item()
