"""The restaurant as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from evenhand.core.errors import InputError
from evenhand.restaurant import state as states
from evenhand.restaurant.env_base import FACT_NAMES, Source, lanes_of, settings_from
from evenhand.restaurant.observation import observation_space
from evenhand.restaurant.pictures import RENDERING, Pictures, rendering
from evenhand.restaurant.simulation import task


class RestaurantEnv(gym.Env[np.ndarray, np.integer[Any]]):
    """A robot serves one person in a restaurant; an episode is a service.

    Someone raises an arm 2.0-4.5 m away. The robot walks there, around tables and guests, and
    responds. A service ends with the response, or after 300 physics steps (6 s) without one;
    both are terminal, for the time is part of the state.

    ### Action space

    ``Discrete(2)``, taken every ``interval`` physics steps (0.1 s by default):

    | action | meaning |
    |---|---|
    | 0 | walk: drive towards the person until the next decision, at up to 1.0 m/s |
    | 1 | respond: end the service here and now |

    ### Observation space

    ``Box(25,)`` of float32; all in [0, 1], the distance in [0, 2]:

    | index | meaning | unit |
    |---|---|---|
    | 0-5 | race: White, Black, American Indian, Asian, Native Hawaiian, Other | one-hot |
    | 6-8 | gender: Female, Male, Other | one-hot |
    | 9-13 | age: Child, Teenager, Adult, Middle Aged, Elder | one-hot |
    | 14-15 | disability: Yes, No | one-hot |
    | 16-21 | skin type: I to VI | one-hot |
    | 22 | distance to the person as last sensed | 5 m |
    | 23 | physics steps since the service began, from the timer | 300 |
    | 24 | age of the last reading | 1 s |

    ### Reward

    Service quality only, at the end of the service: 0.2 for a response, up to 0.5 for its
    distance (all of it at 1.0-1.5 m), up to 0.3 for its promptness (all of it within 200 steps),
    -0.5 if the robot was ever nearer than 0.5 m. A perfect service earns 1. Fairness is no
    property of one service and therefore no part of this reward. Where people tip differently
    (scenario ``tips``), the reward is what the operator makes of the service, as in training.

    ### Information

    ``reset`` gives ``identities`` (codes of the identities). The last step gives ``facts``:
    the true facts of the service and every reward term by name; what a service without a
    response lacks is NaN.

    ### Arguments

    Those of :class:`RestaurantSettings`, and ``render_mode="rgb_array"`` with ``camera``:
    ``gymnasium.make("evenhand/Restaurant-v0", scenario="tips")``, or ``scenario=`` a ``World``.
    With identities of its own, the columns before the last three are their groups.

    ### Networks

    :class:`ScaleObservation` spreads distance and time out, as Evenhand's own learner takes them.
    Without it, networks need many times more services to learn where to respond.

    ### Copies and states

    ``copy.deepcopy`` and ``pickle`` copy everything, wrappers included: a copy goes on bit for bit
    like the original. ``get_state`` and ``set_state`` do so for the environment without wrappers:
    ``env.unwrapped.get_state()``.
    """

    metadata: dict[str, Any] = RENDERING

    def __init__(
        self, render_mode: str | None = None, camera: str = "room", **settings: Any
    ) -> None:
        """Make the environment.

        Args:
            render_mode: None or "rgb_array".
            camera: which camera ``render`` shows, see ``dressing.CAMERAS``.
            **settings: of :class:`RestaurantSettings`.

        Raises:
            InputError: for an unknown setting, scenario, population, camera or render mode.
        """
        self.settings = settings_from(settings)
        self._pictures = Pictures(render_mode, camera)
        self.render_mode = render_mode
        self.metadata = rendering(self.settings)
        self.observation_space = observation_space(len(self.settings.world.groups))
        self.action_space = gym.spaces.Discrete(2)
        self._running = self._begun = False
        self._ids = np.zeros(1, np.int64)
        self._furnish()

    def _furnish(self) -> None:
        world = self.settings.world
        self._lanes = lanes_of(world, 1)
        self._source = Source(self._lanes, world)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin the next service; a seed begins the sequence of services anew."""
        super().reset(seed=seed)
        if seed is not None:
            self._source.forget(0)
        asking = self._source.begin(self._ids, [self.np_random])
        self._running = self._begun = True
        return self._lanes.observe(self._ids)[0], {"identities": asking[0]}

    def step(
        self, action: np.integer[Any] | int
    ) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Walk until the next decision, or respond.

        Raises:
            InputError: for an action other than 0 and 1.
            RuntimeError: when the service has ended, or none has begun, and ``reset`` was not
                called.
        """
        if not self._begun:
            raise RuntimeError("call reset() before step()")
        if not self._running:
            raise RuntimeError("the service has ended: call reset() before the next step()")
        if not self.action_space.contains(action):
            raise InputError("range action", f"action is {action!r}: give 0 (walk) or 1 (respond)")
        if action == task.RESPOND:
            self._lanes.respond(self._ids)
            ended = True
        else:
            ended = bool(self._lanes.walk(self._ids)[0])
        observation = self._lanes.observe(self._ids)[0]
        if not ended:
            return observation, 0.0, False, False, {}
        self._running = False
        facts, reward = self._source.finished(self._ids)
        plain = {name: facts[name][0].item() for name in FACT_NAMES}
        return observation, float(reward[0]), True, False, {"facts": plain}

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The picture of one camera, uint8 [height, width, 3], or None without a render mode."""
        if self.render_mode is None or not self._begun:
            return None
        return self._pictures.of(self._source, 0)

    def close(self) -> None:
        """Free the renderer."""
        self._pictures.close()

    def get_state(self) -> dict[str, Any]:
        """The state as numbers, texts, lists and dictionaries, which JSON can hold.

        It has all that comes, wrappers and ``action_space`` apart.

        Raises:
            InputError: when ``np_random`` was replaced by a generator of an unusual kind.
        """
        running = states.Running([self.np_random], self._begun, np.array([not self._running]))
        return states.save(self._source, self._common(), running)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from a state as the environment did that it was taken from, bit for bit.

        Args:
            state: from ``get_state`` of an environment with the same settings.

        Raises:
            InputError: for a state of another version, of other settings, or a damaged one;
                nothing is changed then.
        """
        running = states.restore(state, self._source, self._common())
        self.np_random = running.generators[0]
        self._begun, self._running = running.begun, not running.ended[0]

    def _common(self) -> dict[str, Any]:
        return {"environment": type(self).__name__, **self.settings.plain()}

    def __getstate__(self) -> dict[str, Any]:
        state = self.get_state()
        return {k: v for k, v in vars(self).items() if k not in ("_lanes", "_source")} | {
            "state": state
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        vars(self).update({name: value for name, value in kept.items() if name != "state"})
        self._furnish()
        self.set_state(kept["state"])
        self._np_random_seed = kept["_np_random_seed"]
