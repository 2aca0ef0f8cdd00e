"""What episodes ended with: all that a function needs to tell the facts of services."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

Info = Mapping[str, Any]
FINAL_OBS, FINAL_INFO = "final_obs", "final_info"
_LACKS: Any = object()


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
            missing: what stands where an info lacks it; instead of NaN it is None beside text
                and arrays.

        Returns:
            Numbers; arrays of one shape as one array [m, ...]; text, and arrays of several
            shapes or of some episodes only, as objects.
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


def kept(info: Info) -> dict[str, Any]:
    """A copy of an info that its environment cannot write into; what has no copy stays."""
    return {name: _copied(value) for name, value in info.items()}


def together(observations: Sequence[Any]) -> Any:
    """Arrays or numbers of one shape as one array [m, ...], anything else as a list."""
    if not all(isinstance(one, np.ndarray | int | float | np.number) for one in observations):
        return list(observations)
    alike = len({np.shape(one) for one in observations}) <= 1
    return np.array(observations) if alike else list(observations)


def _copied(value: Any) -> Any:
    if isinstance(value, str | int | float | np.generic | None):
        return value
    if isinstance(value, dict):
        return kept(value)
    try:
        return deepcopy(value)
    except Exception:  # infos hold anything: generators, locks, handles
        return value


def _values(infos: Sequence[Info], name: str, missing: Any) -> np.ndarray:
    found = [_found(info, name) for info in infos]
    values = [missing if one is _LACKS else one for one in found]
    if not any(isinstance(one, str) for one in values):
        try:
            return np.array(values)
        except ValueError:
            pass  # arrays of several shapes, or some where others have none
    if isinstance(missing, float) and np.isnan(missing):
        values = [None if one is _LACKS else one for one in found]
    out = np.empty(len(values), object)
    for place, value in enumerate(values):
        out[place] = value
    return out


def _found(info: Info, name: str) -> Any:
    """A value by its whole name, else by the names in nested infos."""
    if name in info:
        return info[name]
    first, _, rest = name.partition(".")
    inner = info.get(first)
    return _found(inner, rest) if rest and isinstance(inner, Mapping) else _LACKS
