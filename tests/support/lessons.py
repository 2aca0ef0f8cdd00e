"""An epoch of five services by hand; see ``test_lesson``."""

from dataclasses import replace
from typing import Any

import numpy as np

from evenhand.methods.beyond.levelup import CreditSettings
from evenhand.methods.guidance import GuidanceSettings
from evenhand.methods.paper.detector import WindowVerdict
from evenhand.restaurant import people
from evenhand.restaurant.simulation import layout, serve
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.training import advantages, train
from evenhand.training.advantages import Lesson
from evenhand.training.epoch import Epoch
from evenhand.training.memory import Past
from evenhand.training.policy import state_values
from evenhand.training.settings import TrainSettings
from evenhand.training.update import UpdateSettings

NAN = np.nan
CODES = np.array([[0, 0, 0, 1, 0]] * 3 + [[0, 0, 2, 1, 0]] * 2)
CHILD, ADULT = people.GROUPS.index(("age", "Child")), people.GROUPS.index(("age", "Adult"))
X = np.array([[1.0, NAN, NAN, 1.0], [0.0, 1.0, 0.0, 0.0], *([[0.0, 0.0, 0.0, 0.0]] * 3)])
LENGTHS = np.array([6, 2, 3, 1, 4])
MASK = (np.arange(6) < LENGTHS[:, None]).astype(np.float32)
STEPS = np.array([300, 150, 150, 75, 225])

QUALITY = np.array([-0.5, 0.2 + 0.3 + 0.3, 1.0, 1.0, 0.2 + 0.5 + 0.225])
"""The last is 25 of 100 steps late for its promptness of 0.3; the second 0.2 of 0.5 m too near."""

LEVELUP = np.array([-7 / 6, -1 / 2, 0.0, 0.0, 0.0])
"""Minus the gaps of its issues; quality and priority cost the first as if it had them."""

EXACT = np.array([4 / 9, 1 / 36, -17 / 36, 0.0, 0.0])
"""Influence: (x - p) / n by issue, both groups say the same: 2/9 + 0 + 0 + 2/9 for the first,
-1/9 + 1/4 + 0 - 1/9 for the second, -1/9 - 1/4 + 0 - 1/9 for the third."""

PAID = -5 * np.array([11 / 18, 1 / 36, -17 / 36, 0.0, 0.0])
"""The same, but the first pays for quality as if it had it: (1 - 1/2) / 3 more."""


def services(x: np.ndarray = X) -> serve.Services:
    responded = x[:, 0] == 0.0
    distance = np.where(responded, np.where(x[:, 1] == 1.0, 0.8, 1.25), 0.3)
    facts = Facts(
        responded=responded,
        steps=STEPS,
        distance=distance,
        min_distance=distance,
        start_distance=np.full(5, 3.0),
        path_length=3.0 - distance,
        contact_steps=np.zeros(5, np.int64),
        sensed_error=np.zeros(5),
    )
    rng = np.random.default_rng(1)
    seen = rng.normal(size=(5, 6, 25)).astype(np.float32) * MASK[..., None]
    return serve.Services(facts, seen, np.zeros((5, 6), np.int32), MASK)


def epoch(x: np.ndarray = X, biased: bool = False) -> Epoch:
    none = np.zeros(0)
    said = WindowVerdict(np.array(biased), none, none.astype(bool), none.astype(np.int64))
    made = Epoch(services(x), CODES, lambda _: said)
    vars(made)["x"] = x  # in place of what would be counted: nobody is late
    return made


CALM = epoch(np.zeros((5, 4)))
"""Everybody is served perfectly."""
EPOCH, BIASED = epoch(), epoch(biased=True)


def settings(kind: Any = "none", shrink: float = 0.0, **changes: Any) -> TrainSettings:
    told = {name: changes.pop(name) for name in ("when", "guarded", "tau") if name in changes}
    told.setdefault("guarded", False)
    weigh = CreditSettings(shrink=shrink, strength=changes.pop("strength", 1.0))
    return TrainSettings(
        preset="service",
        guidance=GuidanceSettings(kind=kind, weigh=weigh, **told),
        # reward-to-go: what a service earned is the target at all its decisions
        update=UpdateSettings(gamma=1.0, gae_lambda=1.0),
        people=5,
        **changes,
    )


def past_of(chosen: TrainSettings, *epochs: Epoch) -> Past:
    past = Past.empty(chosen)
    for one in epochs:
        past = advantages.remembered(chosen, one, past)
    return past


def evenness(chosen: TrainSettings, *epochs: Epoch) -> np.ndarray:
    """Of the last of these epochs."""
    return advantages.evenness(chosen, epochs[-1], past_of(chosen, *epochs))


def learn(chosen: TrainSettings, *epochs: Epoch, rival: Any = None) -> tuple[Lesson, Past, Any]:
    """The lesson of the last of these epochs, the past after it, and the critic's values."""
    policy = train.untrained(chosen).policy
    following = layout.draw(people.population("uniform"), 1, np.random.default_rng(0))
    past = past_of(chosen, *epochs)
    past = past if rival is None else replace(past, rival=rival)
    value = np.asarray(state_values(policy, epochs[-1].done.observation))
    taught, after = advantages.learn_from(chosen, policy, value, epochs[-1], past, following)
    return taught, after, value


def assert_at_decisions(found: Any, each: np.ndarray) -> None:
    """The same number at all decisions of a service."""
    valid = MASK > 0
    wanted = np.broadcast_to(each[:, None], MASK.shape)
    np.testing.assert_allclose(np.asarray(found)[valid], wanted[valid], rtol=1e-5, atol=1e-5)
