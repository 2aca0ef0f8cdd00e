"""What episodes ended with: all that a function needs to tell the facts of services."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

Info = Mapping[str, Any]
FINAL_OBS, FINAL_INFO = "final_obs", "final_info"


@dataclass(frozen=True)
class Ended:
    """m episodes in the order in which they ended; several lanes may end in one step.

    Attributes:
        episode: number, from 0, int64 [m].
        lane: in which environment, int64 [m].
        reward: all that the environment paid, without what evenness added, float64 [m].
        steps: how many it took, int64 [m].
        terminated: bool [m].
        truncated: bool [m].
        observation: the last one of each, [m, ...]; a list where observations are no arrays.
        people: groups of those served, codes int64 [m, D]; None where the facts tell them.
        raw: for each, the info that it ended with, that it began with, and where in these it
            stands; -1 where an info is of one environment.
    """

    episode: np.ndarray
    lane: np.ndarray
    reward: np.ndarray
    steps: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    observation: Any
    people: np.ndarray | None
    raw: Sequence[tuple[Info, Info, int]]

    def __len__(self) -> int:
        return len(self.episode)

    @cached_property
    def infos(self) -> list[dict[str, Any]]:
        """The info of each episode's last step, as its own environment would give it."""
        return [of_lane(last, place) for last, _, place in self.raw]

    @cached_property
    def first_infos(self) -> list[dict[str, Any]]:
        """The info that each episode began with."""
        return [of_lane(first, place) for _, first, place in self.raw]

    def info(self, name: str, missing: Any = np.nan) -> np.ndarray:
        """One value of the last info of each episode, [m].

        Args:
            name: in the info; names in nested infos are parted by dots.
            missing: what stands where an info lacks it.
        """
        return _values(self.infos, name, missing)

    def first_info(self, name: str, missing: Any = np.nan) -> np.ndarray:
        """The same of the info that each episode began with, [m]."""
        return _values(self.first_infos, name, missing)


Told = Mapping[str, Any]
FactsOf = Callable[[Ended], Told]
"""From m ended episodes to facts: name -> m values. Identities are facts too where nobody is drawn:
m names of groups, or their codes; None or -1 where one is not known."""


def of_lane(info: Info, lane: int) -> dict[str, Any]:
    """One environment's own info from that of a vector environment.

    Args:
        info: values [n] by name, beside each a mask of the lanes that have it under the name with
            an underscore; dicts are such infos again.
        lane: which; -1 for an info of one environment, which is given back.
    """
    if lane < 0:
        return dict(info)
    out: dict[str, Any] = {}
    for name, value in info.items():
        if name.startswith("_") and name[1:] in info:
            continue
        has = info.get(f"_{name}")
        if has is not None and not has[lane]:
            continue
        if isinstance(value, Mapping):
            out[name] = of_lane(value, lane)
        else:
            out[name] = value[lane] if isinstance(value, np.ndarray | list) else value
    return out


def _values(infos: Sequence[Info], name: str, missing: Any) -> np.ndarray:
    found = []
    for info in infos:
        value: Any = info
        for part in name.split("."):
            value = value.get(part, missing) if isinstance(value, Mapping) else missing
        found.append(value)
    return np.array(found)
