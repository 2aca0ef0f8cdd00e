"""Walks to the end, which tell what every moment of responding would have come to.

A response ends a service and changes nothing before it. So one simulation of a robot that never
responds holds the services of all robots that respond at some decision: those before it are the
same, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evenhand.restaurant.serve_people import Ahead
from evenhand.restaurant.simulation import driving, serve
from evenhand.restaurant.simulation.engine import Engine
from evenhand.restaurant.simulation.lanes import Facts

_NEVER = 1.0
"""A random number that no probability is above."""


def _still(size: int) -> driving.Network:
    """A network as small as can be, of the usual depth: it is asked, and never answers."""
    shapes = ((size, 1), (1, 1), (1, 2))
    return driving.Network(
        weights=tuple(np.zeros(shape, np.float32) for shape in shapes),
        biases=tuple(np.zeros(shape[1], np.float32) for shape in shapes),
        centre=np.zeros(size, np.float32),
        scale=np.zeros(size, np.float32),
        relu=False,
    )


@dataclass(frozen=True, eq=False)
class Walks:
    """N services of L decisions, walked to their end.

    Attributes:
        drawn: as they began.
        kept: what was written down at every decision.
        unanswered: facts of the services without any response, [N] each.
        engine: that ran them.
    """

    drawn: serve.Drawn
    kept: driving.Kept
    unanswered: Facts
    engine: Engine

    @property
    def observation(self) -> np.ndarray:
        """At every decision, whether or not it is reached, float32 [N, L, O]."""
        return self.kept.observation

    @cached_property
    def facts(self) -> Facts:
        """Of every service with a response at each decision, and without any last, [N (L + 1)]."""
        moment, end = self.kept.moment, self.unanswered
        sensed = moment["reading"] - moment["distance"]
        begun = np.broadcast_to(end.start_distance[:, None], moment.shape)

        def both(each: np.ndarray, last: np.ndarray) -> np.ndarray:
            return np.concatenate([each, last[:, None]], axis=1).ravel()

        return Facts(
            **{
                name: both(moment[name], getattr(end, name))
                for name in moment.dtype.names or ()
                if name != "reading"
            },
            start_distance=both(begun, end.start_distance),
            sensed_error=both(sensed, end.sensed_error),
        )

    def answers(self, robot: serve.Robot) -> np.ndarray:
        """At which decision a robot responds in each service, L if at none, int64 [N].

        Args:
            robot: from observations as they are kept.
        """
        n, length = self.kept.mask.shape
        rows = np.repeat(np.arange(n), length)
        chance = robot(self.observation.reshape(n * length, -1), rows).reshape(n, length)
        responds = self.drawn.uniform < chance
        return np.where(responds.any(axis=1), responds.argmax(axis=1), length)

    def given(self, answer: np.ndarray) -> serve.Trajectories:
        """The services as they went with these responses.

        Args:
            answer: at which decision, L for none, int [N].
        """
        n, length = self.kept.mask.shape
        at = np.arange(length)
        happened = at <= answer[:, None]
        kept = self.kept._replace(
            observation=np.where(happened[..., None], self.kept.observation, np.float32(0.0)),
            action=(at == answer[:, None]).astype(np.int32),
            mask=happened.astype(np.float32),
            pose=np.where(
                (np.arange(length + 1) <= answer[:, None])[..., None], self.kept.pose, np.nan
            )
            if len(self.kept.pose)
            else self.kept.pose,
        )
        chosen = np.arange(n) * (length + 1) + answer
        return serve.services(self.drawn, _of(self.facts, chosen), kept, self.engine.settings)

    @cached_property
    def every(self) -> serve.Trajectories:
        """Each service with each response, and without any last, as N (L + 1) services.

        They hold what facts and issues are told from: no observations and decisions.
        """
        n, length = self.kept.mask.shape
        codes = np.repeat(self.drawn.setups.codes, length + 1, axis=0)
        total = n * (length + 1)
        return serve.Trajectories(
            self.facts,
            codes,
            np.zeros((total, 0, self.observation.shape[2]), np.float32),
            np.zeros((total, 0), np.int32),
            np.zeros((total, 0), np.float32),
        )


def walk(engine: Engine, ahead: Ahead, *, recorded: bool = False) -> Walks:
    """Walk services that have been drawn to their end.

    Args:
        engine: runs them.
        ahead: the services.
        recorded: keep what was to be seen.

    Raises:
        InputError: as ``Engine.run``.
        RuntimeError: when a simulation became unstable.
    """
    drawn = ahead.drawn
    kept = serve.empty(drawn, recorded=recorded, moments=True)
    silent = replace(drawn, uniform=np.full_like(drawn.uniform, _NEVER))
    done = engine.run(silent, _still(kept.observation.shape[2]), kept=kept)
    return Walks(drawn, kept, done.facts, engine)


def _of(facts: Facts, rows: np.ndarray) -> Facts:
    return Facts(**{name: getattr(facts, name)[rows] for name in Facts.__dataclass_fields__})
