"""Steps of many lanes, noted in as little time as possible, and cut into episodes afterwards.

A step only copies its rewards; one in which an episode ends keeps its flags, last observations and
info as well. Sums, lengths and order are worked out for some hundred steps at once.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from evenhand.adapters.episodes import FINAL_INFO, FINAL_OBS, Info, together
from evenhand.adapters.sampler import BLOCK
from evenhand.core.errors import InputError, unknown

STEPS = BLOCK
"""Steps that are noted before they are cut into episodes, at most."""

SMALL = 1 << 13
"""Bytes of observations up to which keeping those of all lanes is quicker than choosing."""


End = tuple[int, bytes, bytes, Any, Info]
"""A step in which episodes ended: its number since the last cut, the flags terminated and truncated
of all lanes, the last observations of those that ended (None where ``Track.seen`` holds them), and
the info of the ends. A bare tuple, since one is made every few steps."""


class Cut(NamedTuple):
    """Episodes that have ended, in that order; fields as those of ``Ended``.

    Attributes:
        rank: how many of the others were in the same lane before it, int64 [m].
    """

    lane: np.ndarray
    rank: np.ndarray
    reward: np.ndarray
    steps: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    observation: Any
    raw: list[tuple[Info, Info, int]]


class Track:
    """What has happened in n lanes since the last cut, and what the episodes before had.

    Attributes:
        rewards: of each step since the last cut, float64 [STEPS, n].
        step: how many there are.
        ends: steps in which episodes ended.
        seen: observations of all lanes in these, [STEPS, n, ...]; None where they are large.
        later: infos of the beginnings after these, by the number of the step after the end.
    """

    def __init__(self, lanes: int, mode: AutoresetMode) -> None:
        """Begin with nothing."""
        self.rewards = np.empty((STEPS, lanes))
        self.step = 0
        self.ends: list[End] = []
        self.later: dict[int, Info] = {}
        self.seen: np.ndarray | None = None
        self._gap = 1 if mode is AutoresetMode.NEXT_STEP else 0
        self._lanes = lanes
        self._total, self._steps = np.zeros(lanes), np.zeros(lanes, np.int64)
        self._idle = np.zeros(0, np.int64)
        self._first: list[Info] = [{}] * lanes

    def ended(self) -> np.ndarray:
        """How many episodes of each lane have ended since the last cut, int64 [n]."""
        found = np.zeros(self._lanes, np.int64)
        for end in self.ends:
            found += _over(end)
        return found

    def begins(self) -> bool:
        """Whether the next step only begins anew in some lane whose end was cut."""
        return len(self._idle) > 0

    def just_ended(self) -> np.ndarray:
        """Lanes whose episodes ended in the last step and were not cut yet, bool [n]."""
        if not self.ends or self.ends[-1][0] != self.step - 1:
            return np.zeros(self._lanes, bool)
        return _over(self.ends[-1])

    def begin(self, lanes: np.ndarray, info: Info) -> None:
        """Lanes begin an episode after a reset; whatever ended in them has been cut."""
        self._total[lanes], self._steps[lanes] = 0.0, 0
        self._idle = self._idle[~np.isin(self._idle, lanes)]
        self.begin_with(lanes, info)

    def begin_with(self, lanes: np.ndarray, info: Info) -> None:
        """Keep the info that lanes began with."""
        for lane in lanes.tolist():
            self._first[lane] = info

    def cut(self) -> Cut | None:
        """The episodes that have ended since the last cut; None if there is none."""
        size, ends, lanes = self.step, self.ends, self._lanes
        if not size:
            return None
        rewards = self.rewards[:size]
        if len(self._idle):  # their first step only began anew
            rewards[0, self._idle] = 0.0
            self.begin_with(self._idle, self.later.get(0, {}))
        terminated, truncated = (
            np.frombuffer(b"".join(flags), bool).reshape(-1, lanes)
            for flags in ([end[1] for end in ends], [end[2] for end in ends])
        )
        row, lane = (terminated | truncated).nonzero()
        at = np.array([end[0] for end in ends], np.int64)[row]
        if self._gap:
            inner = at + 1 < size
            rewards[at[inner] + 1, lane[inner]] = 0.0
            self._idle = lane[~inner]
        order = np.argsort(lane, kind="stable")
        by_lane, stop = lane[order], at[order] + 1
        new = np.append(True, by_lane[1:] != by_lane[:-1])[: len(lane)]
        start = np.where(new, 0, np.append(0, stop[:-1])[: len(lane)])
        places = np.arange(len(lane))
        rank, reward, steps = np.empty_like(lane), np.empty(len(lane)), np.empty_like(lane)
        rank[order] = places - np.maximum.accumulate(np.where(new, places, 0))
        # lane after lane in one row, and one number more for an end at the very last
        flat = np.append(rewards.T.ravel(), 0.0)
        earlier = np.where(new, self._total[by_lane], 0.0)
        reward[order] = earlier + _sums(flat, by_lane * size + start, by_lane * size + stop)
        steps[order] = stop - start + np.where(new, self._steps[by_lane], -self._gap)
        self._carry(flat, by_lane, stop)
        found = Cut(
            lane,
            rank,
            reward,
            steps,
            terminated[row, lane],
            truncated[row, lane],
            self._observed(row, lane),
            self._infos(row, lane),
        )
        self.step, self.ends, self.later = 0, [], {}
        return found if len(lane) else None

    def _carry(self, flat: np.ndarray, by_lane: np.ndarray, stop: np.ndarray) -> None:
        begin = np.zeros(self._lanes, np.int64)
        begin[by_lane] = stop  # of several in a lane the last one stays
        fresh = np.zeros(self._lanes, bool)
        fresh[by_lane] = True
        whole = np.arange(self._lanes) * self.step
        rest = _sums(flat, whole + begin, whole + self.step)
        self._total = np.where(fresh, 0.0, self._total) + np.where(begin < self.step, rest, 0.0)
        self._steps = np.where(fresh, -self._gap, self._steps) + self.step - begin

    def _infos(self, row: np.ndarray, lane: np.ndarray) -> list[tuple[Info, Info, int]]:
        """Infos that episodes ended and began with; those of the episodes that go on are kept."""
        raw = []
        for place, one in zip(row.tolist(), lane.tolist(), strict=True):
            step, _, _, _, last = self.ends[place]
            raw.append((last, self._first[one], one))
            self._first[one] = self.later.get(step + 1, {})
        return raw

    def _observed(self, row: np.ndarray, lane: np.ndarray) -> Any:
        """The last observation of each episode; ends and lanes are in order."""
        if self.seen is not None:
            return self.seen[row, lane]
        return together([one for end in self.ends for one in end[3]])


def _over(end: End) -> np.ndarray:
    return np.frombuffer(end[1], bool) | np.frombuffer(end[2], bool)


def _sums(flat: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Sums from each begin to before its end, [m]; meaningless where these are the same."""
    if not len(begin):
        return np.zeros(0)
    return np.add.reduceat(flat, np.stack([begin, end], axis=1).ravel())[::2]


def mode_of(env: VectorEnv[Any, Any, Any]) -> AutoresetMode:
    """What a vector environment does after the end of an episode.

    Raises:
        InputError: when its metadata do not say, or name no such mode.
    """
    said = env.metadata.get("autoreset_mode")
    if said is None:
        raise InputError(
            "missing autoreset_mode",
            f"{env} does not say how it resets: set metadata['autoreset_mode'] to its "
            "gymnasium.vector.AutoresetMode",
        )
    try:
        return AutoresetMode(said)
    except ValueError:
        modes = [mode.value for mode in AutoresetMode]
        raise unknown("autoreset mode", str(said), modes, "autoreset_mode") from None


def statistics_of(env: VectorEnv[Any, Any, Any]) -> tuple[str, ...]:
    """Names under which Gymnasium's ``RecordEpisodeStatistics`` around an environment tells."""
    found: list[str] = []
    while isinstance(env, VectorWrapper):
        if isinstance(env, RecordEpisodeStatistics):
            found.append(env._stats_key)
        env = env.env
    return tuple(found)


def parted(info: Info, statistics: Collection[str] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is said of the episodes that ended in a step, and of those that began in the same one.

    Args:
        info: of a step of an environment that resets in the step in which an episode ends.
        statistics: names beside the final info that are of the end.
    """
    last = dict(info.get(FINAL_INFO, {}))
    begun = {
        name: value
        for name, value in info.items()
        if name.removeprefix("_") not in (FINAL_INFO, FINAL_OBS)
    }
    for name in statistics:
        for one in (name, f"_{name}"):
            if one in begun:
                last.setdefault(one, begun.pop(one))
    return last, begun
