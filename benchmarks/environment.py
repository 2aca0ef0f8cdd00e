"""Speed, measured side by side in one run: every number is a median over rounds that take turns.

The environments are measured twice: as they come, with a thread for each processor, by the clock;
and on one thread, by the processor time of this process, which other work on the machine disturbs
little. The bare loop and SyncVectorEnv know one thread only.

The bare loop steps one ``MjData`` of ``scene.model()`` with ``mj_step`` through services that the
environment has served before: the same places and drive commands, and nothing else. It is what
anybody would write. The environment can be faster than that on one thread: it steps a model with
fewer bodies, whose states are the same, without MuJoCo's clock.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any

import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from evenhand.core import terminal as display
from evenhand.core.errors import InputError
from evenhand.core.processors import CORES
from evenhand.methods import detector_file
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.scenarios import sensing
from evenhand.restaurant.simulation import layout, scene, task
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.restaurant.simulation.physics import simulation_of
from evenhand.restaurant.vector import RestaurantVectorEnv
from evenhand.training import train
from evenhand.training.evaluate import WINDOW
from evenhand.training.policy import Actor
from evenhand.training.settings import TrainSettings, settings_of
from evenhand.training.train import begin

_TURN = 0.25
"""Seconds of one turn: short, so that both sides of a ratio meet the same moments."""
_SERVICES = 40
_EPOCHS, _ROUNDS = 20, 7
_INTERVAL = 5
_KEPT = (
    "responded", "response_step", "response_distance", "min_distance", "steps", "start_distance",
    "path_length", "contact_steps", "sensed_error",
)  # fmt: skip
Stepper = Callable[[float], tuple[int, int]]
"""Run for so many seconds; returns physics steps and finished services."""


def measure(seconds: float) -> dict[str, Any]:
    """All measurements.

    Args:
        seconds: for each thing that is measured, in turns.

    Returns:
        ``bare_steps_per_s``, ``env_steps_per_s_30``, ``env_steps_per_s_240``,
        ``sync_steps_per_s``, services a second likewise, ``ratio_30`` and ``ratio_240`` (to the
        bare loop), ``ratio_sync`` (30 at a time, to SyncVectorEnv), all by the clock; the ratios
        on one thread (``..._one_thread``); ``epoch_share``, ``reflection_ratio``, and the
        circumstances.
    """
    if not 0.01 <= seconds <= 600:
        raise InputError("range seconds", f"seconds is {seconds}: give 0.01 to 600")
    actor = Actor(begin(settings_of("service", "ppo", "penalty")).policy)
    works: dict[str, Stepper] = {
        "bare": bare(),
        "30": _vector(30, actor, CORES),
        "240": _vector(240, actor, CORES),
        "30_one_thread": _vector(30, actor, 1),
        "240_one_thread": _vector(240, actor, 1),
        "sync": _sync(30, actor),
    }
    rates: dict[str, list[tuple[float, float, float]]] = {name: [] for name in works}
    for work in works.values():
        work(min(seconds, 0.3))  # warm
    rounds = max(1, round(seconds / _TURN))
    for _ in range(rounds):
        for name, work in works.items():
            clock, processor = perf_counter(), process_time()
            steps, services = work(seconds / rounds)
            clock, processor = perf_counter() - clock, process_time() - processor
            rates[name].append((steps / clock, services / clock, steps / processor))
    speed = {name: np.array(rate) for name, rate in rates.items()}
    by_clock, served, by_processor = range(3)

    def median(name: str, what: int) -> float:
        return float(np.median(speed[name][:, what]))

    def ratio(a: str, b: str, what: int = by_clock) -> float:
        """Median over rounds, so that a slow moment hits both."""
        return round(float(np.median(speed[a][:, what] / speed[b][:, what])), 3)

    shares, reflection = epoch_share()
    return {
        "bare_steps_per_s": round(median("bare", by_clock)),
        "env_steps_per_s_30": round(median("30", by_clock)),
        "env_steps_per_s_240": round(median("240", by_clock)),
        "env_steps_per_s_30_one_thread": round(median("30_one_thread", by_clock)),
        "env_steps_per_s_240_one_thread": round(median("240_one_thread", by_clock)),
        "sync_steps_per_s": round(median("sync", by_clock)),
        "services_per_s_30": round(median("30", served), 1),
        "services_per_s_240": round(median("240", served), 1),
        "sync_services_per_s": round(median("sync", served), 1),
        "ratio_30": ratio("30", "bare"),
        "ratio_240": ratio("240", "bare"),
        "ratio_sync": ratio("30", "sync"),
        "ratio_30_one_thread": ratio("30_one_thread", "bare", by_processor),
        "ratio_240_one_thread": ratio("240_one_thread", "bare", by_processor),
        "ratio_sync_one_thread": ratio("30_one_thread", "sync", by_processor),
        "threads": CORES,
        "epoch_share": shares,
        "reflection_ratio": reflection,
        "rounds": rounds,
        "seconds": seconds,
        "cpus": os.cpu_count(),
        "mujoco": mujoco.__version__,
    }


def bare() -> Stepper:
    """One MjData stepped through recorded services."""
    recorded = _record_drives()
    model = copy.copy(scene.model())
    data = mujoco.MjData(model)

    def run(seconds: float) -> tuple[int, int]:
        end, steps, services = perf_counter() + seconds, 0, 0
        step = mujoco.mj_step
        while perf_counter() < end:
            state, sizes, commands = recorded[services % len(recorded)]
            model.geom_size[:] = sizes
            mujoco.mj_setState(model, data, state, int(mujoco.mjtState.mjSTATE_INTEGRATION))
            for command in commands:
                data.ctrl[:] = command
                for _ in range(_INTERVAL):
                    step(model, data)
            steps += _INTERVAL * len(commands)
            services += 1
        return steps, services

    return run


def _record_drives() -> list[tuple[np.ndarray, np.ndarray, list[np.ndarray]]]:
    """State at the start, sizes of the guests, and drive commands of some proper services."""
    rng = np.random.default_rng(0)
    settings = task.TaskSettings(_INTERVAL)
    lanes = Lanes(_SERVICES, settings)
    ids = np.arange(_SERVICES)
    setups = layout.draw(people.population("uniform"), _SERVICES, rng)
    chances = sensing.draw(
        sensing.SenseSettings(),
        setups.asking,
        settings.decisions + 1,
        _INTERVAL * floor_plan.TIMESTEP,
        rng,
    )
    lanes.begin(ids, lanes.prepare(setups, chances), ids)
    kept = []
    for lane in ids:
        model, data = simulation_of(setups, int(lane))
        state = np.empty(mujoco.mj_stateSize(model, int(mujoco.mjtState.mjSTATE_INTEGRATION)))
        mujoco.mj_getState(model, data, state, int(mujoco.mjtState.mjSTATE_INTEGRATION))
        kept.append((state, model.geom_size.copy(), []))
    active = ids
    while len(active):
        active = active[lanes.perceived["reading"][active] > 1.25]
        if not len(active):
            break
        ended = lanes.walk(active)
        for lane in active:
            kept[lane][2].append(lanes.physics.command[lane].copy())
        active = active[~ended]
    return kept


class _Records:
    """Facts of finished services, made into tables thirty at a time, as an epoch is."""

    def __init__(self) -> None:
        self._kept: list[tuple[dict[str, np.ndarray], np.ndarray]] = []
        self._waiting = 0

    def add(self, facts: dict[str, np.ndarray], ended: np.ndarray) -> int:
        """Keep the facts of the lanes that ended; returns how many did."""
        self._kept.append((facts, ended))
        count = int(np.count_nonzero(ended))
        self._waiting += count
        if self._waiting >= WINDOW:
            columns = {
                name: np.concatenate([facts[name][ended] for facts, ended in self._kept])
                for name in _KEPT
            }
            Services.build({}, columns)
            self._kept, self._waiting = [], 0
        return count


def _vector(n: int, actor: Actor, threads: int) -> Stepper:
    """The vector environment with policy, observations and records."""
    return _stepper(RestaurantVectorEnv(n, AutoresetMode.SAME_STEP, threads), n, actor)


def _sync(n: int, actor: Actor) -> Stepper:
    """The same work by Gymnasium's SyncVectorEnv over the single environment."""
    env = SyncVectorEnv([RestaurantEnv] * n, autoreset_mode=AutoresetMode.SAME_STEP)
    return _stepper(env, n, actor)


def _stepper(env: VectorEnv, n: int, actor: Actor) -> Stepper:
    rng = np.random.default_rng(0)
    records = _Records()
    seen = env.reset(seed=0)[0]

    def run(seconds: float) -> tuple[int, int]:
        nonlocal seen
        end, steps, services = perf_counter() + seconds, 0, 0
        while perf_counter() < end:
            actions = (rng.random(n) < actor.probability(seen)).astype(np.int64)
            seen, _, ended, _, info = env.step(actions)
            steps += _INTERVAL * (n - int(np.count_nonzero(actions)))
            if "final_info" in info:
                services += records.add(info["final_info"]["facts"], ended)
        return steps, services

    return run


def epoch_share() -> tuple[dict[str, float], float]:
    """Shares of an epoch of PPO on the service preset: serving, update, rest.

    Runs with and without self-reflection take turns.

    Returns:
        The shares, with self-reflection, and the time of an epoch relative to one without.
    """
    settings = settings_of("service", "ppo", "penalty", epochs=_EPOCHS)
    each: list[dict[bool, np.ndarray]] = []
    for _ in range(_ROUNDS + 1):
        each.append({on: _epoch(replace(settings, reflect=on)) for on in (True, False)})
    each = each[1:]  # the first ones compile
    whole, serving, update = np.sum([one[True] for one in each], axis=0)
    shares = {"serving": serving / whole, "update": update / whole}
    shares["rest"] = 1.0 - sum(shares.values())
    rounded = {name: round(float(share), 3) for name, share in shares.items()}
    return rounded, round(float(np.median([one[True][0] / one[False][0] for one in each])), 3)


def _epoch(settings: TrainSettings) -> np.ndarray:
    """Seconds of a run: all, serving, update."""
    began, parts = perf_counter(), np.zeros(2)
    for record in train.train(settings, detector_file.load(detector_file.SHIPPED), threads=CORES):
        parts += [record.numbers["time_serving"], record.numbers["time_updating"]]
    return np.array([perf_counter() - began, *parts])


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    display.table(
        f"Physics steps of {floor_plan.TIMESTEP} s, median of {found['rounds']} rounds",
        ("what", "steps/s", "services/s"),
        [
            ("bare mj_step loop", found["bare_steps_per_s"], None),
            ("30 services at a time", found["env_steps_per_s_30"], found["services_per_s_30"]),
            ("the same on one thread", found["env_steps_per_s_30_one_thread"], None),
            ("240 services at a time", found["env_steps_per_s_240"], found["services_per_s_240"]),
            ("the same on one thread", found["env_steps_per_s_240_one_thread"], None),
            ("SyncVectorEnv, 30", found["sync_steps_per_s"], found["sync_services_per_s"]),
        ],
    )
    display.table(
        "Ratios",
        ("threads", "30 to bare", "240 to bare", "30 to SyncVectorEnv"),
        [
            (threads, *(found[f"ratio_{what}{key}"] for what in ("30", "240", "sync")))
            for threads, key in ((found["threads"], ""), (1, "_one_thread"))
        ],
    )
    display.table(
        "Share of an epoch (PPO, service preset)",
        (*found["epoch_share"], "with self-reflection, to without"),
        [(*found["epoch_share"].values(), found["reflection_ratio"])],
    )
