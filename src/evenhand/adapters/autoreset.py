"""What vector environments of Gymnasium say of the ends and beginnings of episodes, and where."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from evenhand.adapters.episodes import FINAL_INFO, FINAL_OBS, Info
from evenhand.core.errors import InputError, unknown


def mode_of(env: VectorEnv[Any, Any, Any]) -> AutoresetMode:
    """What a vector environment does after the end of an episode.

    Raises:
        InputError: when its metadata do not say, or name no such mode.
    """
    said = env.metadata.get("autoreset_mode")
    if said is None:
        raise InputError(
            f"{env} does not say how it resets: set metadata['autoreset_mode'] to its "
            "gymnasium.vector.AutoresetMode"
        )
    try:
        return AutoresetMode(said)
    except ValueError:
        raise unknown("autoreset mode", str(said), [m.value for m in AutoresetMode]) from None


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
