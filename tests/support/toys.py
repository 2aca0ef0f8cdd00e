"""A small environment that knows nothing of Evenhand, and what a plain loop sees of it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from evenhand.adapters import Ended, Fact, Identity, Scheme, own_issue

SCHEME = Scheme(
    identities=(Identity("who", ("a", "b", "c")), Identity("side", ("left", "right"))),
    facts=(
        Fact("lane", int, 0),
        Fact("steps", int, 1),
        Fact("total", float),
        Fact("cut", bool),
        Fact("seen", float),
        Fact("delay", float, 0, may_miss=True),
    ),
    issues=(
        own_issue("long", ["steps"], lambda steps: steps > 3),
        own_issue("cut", ["cut"], lambda cut: cut == 1),
        own_issue("delayed", ["delay"], lambda delay: delay > 0.5),
    ),
)


class Toy(gym.Env[Any, int]):
    """Episodes of 1 to 6 steps; those of 6 are cut off. Infos say who asked, and how it ended."""

    observation_space: gym.Space[Any] = gym.spaces.Box(-1.0, 10.0, (2,))
    action_space: gym.Space[Any] = gym.spaces.Discrete(2)

    def __init__(self, kind: str = "box") -> None:
        self.kind = kind
        if kind == "dict":
            part = gym.spaces.Box(-1.0, 10.0, (2,))
            self.observation_space = gym.spaces.Dict({"part": part})

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.length = int(self.np_random.integers(1, 7))
        self.who = int(self.np_random.integers(0, 3))
        self.at = 0
        return self._seen(), {"who": "abc"[self.who]}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.at += 1
        over = self.at == self.length
        info = {}
        if over:
            info = {"end": {"delay": 0.2 * self.length, "known": self.length % 2}}
        return self._seen(), 0.1 * self.at, over and self.at < 6, over and self.at == 6, info

    def _seen(self) -> Any:
        seen = np.array([self.at, self.who], np.float32)
        return seen if self.kind == "box" else {"part": seen}


def facts_of(ended: Ended) -> dict[str, Any]:
    """Facts of toy episodes; identities come from a sampler, or else from infos."""
    seen = ended.observation
    if isinstance(seen, list):
        seen = np.array([one["part"] for one in seen]).reshape(-1, 2)
    known = ended.info("end.known")
    facts = {
        "lane": ended.lane,
        "steps": ended.steps,
        "total": ended.reward,
        "cut": ended.truncated,
        "seen": seen[:, 0],
        "delay": np.where(known == 1, ended.info("end.delay"), np.nan),
    }
    if ended.people is None:
        facts["who"] = ended.first_info("who")
        facts["side"] = np.where(ended.lane % 2 == 0, "left", "right").tolist()
    return facts


def plainly(seed: int, lane: int, steps: int) -> list[tuple[Any, ...]]:
    """Episodes of one lane that end in so many steps: who, step of the end, and the facts."""
    env = Toy()
    _, info = env.reset(seed=seed)
    found, at, total, began = [], 0, 0.0, 0
    while at < steps:
        seen, reward, over, cut, last = env.step(0)
        at, total = at + 1, total + reward
        if over or cut:
            end = last["end"]
            delay = end["delay"] if end["known"] == 1 else None
            found.append((info["who"], at, lane, at - began, total, cut, float(seen[0]), delay))
            _, info = env.reset()
            total, began = 0.0, at
    return found
