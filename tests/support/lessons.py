"""An epoch of five services by hand; see ``test_lesson``."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evenhand.methods import detector_file, registry
from evenhand.methods.epoch import Epoch
from evenhand.methods.guard import Held, Watch
from evenhand.methods.paper.detector import WindowVerdict
from evenhand.restaurant import people
from evenhand.restaurant.simulation import layout, serve
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.training import advantages, train
from evenhand.training.advantages import Advantages
from evenhand.training.epoch import epoch_of
from evenhand.training.memory import Memory
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


def services(x: np.ndarray = X) -> serve.Trajectories:
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
    return serve.Trajectories(facts, CODES, seen, np.zeros((5, 6), np.int32), MASK)


@dataclass(frozen=True)
class Spec:
    """An epoch to be made: issues of its services, and what the detector says."""

    x: np.ndarray = field(default_factory=lambda: X)
    biased: bool = False


CALM = Spec(np.zeros((5, 4)))
"""Everybody is served perfectly."""
EPOCH, BIASED = Spec(), Spec(biased=True)


def settings(name: str = "service", shrink: float = 0.0, **changes: Any) -> TrainSettings:
    told = {n: changes.pop(n) for n in ("when", "guarded", "strength", "windows") if n in changes}
    if name in ("levelup", "influence", "surgery"):
        told = {"guarded": False, "strength": 1.0, "shrink": shrink} | told
        if name == "levelup":
            told["cost"] = 0.0
    elif name in ("score", "penalty"):
        told = {"strength": 1.0} | told
    return TrainSettings(
        preset="service",
        method=registry.create(name, **told),
        # reward-to-go: what a service earned is the target at all its decisions
        update=UpdateSettings(gamma=1.0, gae_lambda=1.0),
        people=5,
        **changes,
    )


def made(chosen: TrainSettings, spec: Spec, memory: Memory) -> tuple[Epoch, Watch, np.ndarray]:
    """An epoch, what becomes of the guard, and the critic's values."""
    none = np.zeros(0)
    said = WindowVerdict(np.array(spec.biased), none, none.astype(bool), none.astype(np.int64))
    done = services(spec.x)
    value = np.asarray(state_values(train.untrained(chosen).policy, done.observation))
    detector = detector_file.load(detector_file.SHIPPED)
    epoch, _ = epoch_of(chosen, done, detector, value, memory.guard)
    # in place of what would be counted: nobody is late
    watch = Watch(memory.guard, spec.x, epoch.inside)
    return replace(epoch, x=spec.x, judge=lambda _: said, guard=watch), watch, value


def learn(
    chosen: TrainSettings, *specs: Spec, memory: Any = None, guard: float | None = None
) -> tuple[Advantages, Memory, np.ndarray]:
    """What the last of these epochs gives, the memory after it, and the critic's values.

    Args:
        chosen: settings.
        specs: the epochs.
        memory: of the method before the last of them.
        guard: the guard's strength after the last of them.
    """
    policy = train.untrained(chosen).policy
    following = layout.draw(people.population("uniform"), 1, np.random.default_rng(0))
    kept = Memory.begin(chosen)
    for number, spec in enumerate(specs, 1):
        last = number == len(specs)
        if last and memory is not None:
            kept = replace(kept, method=memory)
        epoch, watch, value = made(chosen, spec, kept)
        after = watch.after
        if last and guard is not None:
            after = replace(after, strength=guard)
            epoch = replace(epoch, guard=Held(after))
        taught, method = advantages.learn_from(chosen, policy, value, epoch, kept.method, following)
        kept = replace(kept, guard=after, method=method)
    return taught, kept, value


def evenness(chosen: TrainSettings, *specs: Spec, **others: Any) -> np.ndarray:
    """What it adds to the rewards of the last of these epochs."""
    return learn(chosen, *specs, **others)[0].evenness


def assert_at_decisions(found: Any, each: np.ndarray) -> None:
    """The same number at all decisions of a service."""
    valid = MASK > 0
    wanted = np.broadcast_to(each[:, None], MASK.shape)
    np.testing.assert_allclose(np.asarray(found)[valid], wanted[valid], rtol=1e-5, atol=1e-5)
