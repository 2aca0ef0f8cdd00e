"""Every registered method: what it gives and remembers, in every learner that takes it."""

import pickle
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from evenhand.adapters import JudgeServices, JudgeSettings, JudgeVectorServices, Ledger
from evenhand.core import tree
from evenhand.core.errors import InputError
from evenhand.methods import guidance, registry
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.guard import GUARD, Guard, Watch
from evenhand.methods.paper import detector
from evenhand.methods.paper.detector import WindowVerdict
from evenhand.methods.scheme import Identity, Scheme, paper_scheme
from support import ledgers
from support.refusals import refused
from support.toys import SCHEME, Toy, facts_of

NAMES = registry.names()
REWARDS = [name for name in NAMES if name not in ("surgery", "unaware", "counterfactual")]
"""Methods that a learner can follow which takes nothing but rewards."""
SMALL = paper_scheme(
    [Identity("a", ("x", "y", "z")), Identity("b", ("u", "v")), Identity("c", ("p", "q"))]
)
N, LENGTH = 12, 7
A, GIVEN = 6, 4
"""Answers of a service; which of them it was."""


def epoch(
    rng: np.random.Generator, scheme: Scheme = SMALL, biased: bool = False, **changes: Any
) -> Epoch:
    """A made-up epoch, in which some groups are empty and some people unknown."""
    sizes = [len(one.groups) for one in scheme.identities]
    inside = np.concatenate([np.eye(k)[rng.integers(0, k, N)] for k in sizes], axis=1)
    inside[0, : sizes[0]] = np.nan
    x = (rng.random((N, len(scheme.issues))) < 0.3).astype(float)
    x[x[:, 0] == 1, 1:3] = np.nan
    mask = (np.arange(LENGTH) < rng.integers(1, LENGTH + 1, N)[:, None]).astype(float)
    advantage = np.where(mask > 0, rng.normal(size=mask.shape), 0.0)
    reward = rng.uniform(-0.5, 1.0, N)
    none = np.zeros(0)
    said = WindowVerdict(np.array(biased), none, none.astype(bool), none.astype(np.int64))
    made: dict[str, Any] = {
        "x": x, "inside": inside, "reward": reward, "mask": mask, "groups": scheme.groups,
        "issues": scheme.issue_names, "tau": np.ones(len(scheme.issues)),
        "advantages_of": lambda r: np.where(mask > 0, advantage + (r - reward)[:, None], 0.0),
        "corrected_of": lambda counts: 0.3, "judge": lambda scores: said,
    }  # fmt: skip
    made |= changes
    guard = Guard.new(len(scheme.groups) + 1, 1, GUARD)
    return Epoch(**made, guard=Watch(guard, made["x"], made["inside"]))


def as_it_comes(rng: np.random.Generator) -> Epoch:
    return epoch(rng)


def no_responses(rng: np.random.Generator) -> Epoch:
    return epoch(rng, x=np.tile([1.0, np.nan, np.nan, 0.0], (N, 1)))


def one_group(rng: np.random.Generator) -> Epoch:
    return epoch(rng, inside=np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], (N, 1)))


def nobody_known(rng: np.random.Generator) -> Epoch:
    return epoch(rng, inside=np.full((N, 7), np.nan))


def biased(rng: np.random.Generator) -> Epoch:
    return epoch(rng, biased=True)


def chance_unknown(rng: np.random.Generator) -> Epoch:
    return epoch(rng, corrected_of=lambda counts: np.nan)


EDGES = [as_it_comes, no_responses, one_group, nobody_known, biased, chance_unknown]


def taught(name: str, edge: Any, seed: int = 3) -> list[tuple[guidance.Guidance, Any]]:
    """Guidance and memory after each of four epochs."""
    rng, method = np.random.default_rng(seed), registry.create(name)
    found, memory = [], guidance.begin(method, SMALL)
    for _ in range(4):
        given, memory = guidance.teach(method, edge(rng), memory)
        found.append((given, memory))
    return found


def answers(found: Epoch, rng: np.random.Generator) -> Answers:
    """Answers of the epoch, the last but one as the services were."""
    x = (rng.random((N, A, len(found.issues))) < 0.3).astype(float)
    x[x[..., 0] == 1, 1:3] = np.nan
    reward = rng.uniform(-0.5, 1.0, (N, A))
    x[:, GIVEN], reward[:, GIVEN] = found.x, found.reward
    return Answers(x, reward, found)


def arrays(given: guidance.Guidance) -> list[np.ndarray]:
    found = [getattr(given, one.name) for one in fields(given)]
    return [values for values in found if values is not None]


@pytest.mark.parametrize("name", NAMES)
class TestEvery:
    def test_it_says_what_it_is(self, name):
        entry = registry.entry(name)
        method = registry.create(name)
        assert is_dataclass(entry.kind)
        assert entry.label
        assert entry.kind.__doc__
        assert registry.as_method(method) is method
        assert registry.name_of(method) == name
        assert registry.needs_of(method) <= {
            registry.VERDICT, registry.DIRECTION, registry.BLINDNESS, registry.PREPROCESSING,
        }  # fmt: skip

    def test_its_strength_is_set_by_an_at(self, name):
        strength = registry.strength_of(registry.create(name))
        if strength is None:
            with refused("unsupported strength"):
                registry.create(f"{name}@1")
        else:
            assert registry.strength_of(registry.create(f"{name}@0.5")) == 0.5
            assert registry.create(registry.spelled(name, strength)) == registry.create(name)

    def test_it_is_written_down_and_comes_back(self, name):
        method = registry.create(name)
        assert registry.restored(registry.described(method)) == method
        assert pickle.loads(pickle.dumps(method)) == method
        assert hash(registry.create(name)) == hash(method)

    @pytest.mark.parametrize("edge", EDGES)
    def test_what_it_gives_is_finite_whatever_happens(self, name, edge):
        for given, memory in taught(name, edge):
            assert all(np.isfinite(values).all() for values in arrays(given))
            assert all(not np.isnan(leaf).any() for leaf in tree.leaves(memory).values())

    def test_the_same_epochs_teach_the_same(self, name):
        for (a, kept), (b, also) in zip(
            taught(name, as_it_comes), taught(name, as_it_comes), strict=True
        ):
            for one, other in zip(arrays(a), arrays(b), strict=True):
                np.testing.assert_array_equal(one, other)
            for path, leaf in tree.leaves(kept).items():
                np.testing.assert_array_equal(leaf, tree.leaves(also)[path])

    def test_it_goes_on_from_what_was_saved(self, name, tmp_path):
        method, rng = registry.create(name), np.random.default_rng(4)
        first = guidance.begin(method, SMALL)
        _, memory = guidance.teach(method, epoch(rng), first)
        np.savez(tmp_path / "memory.npz", allow_pickle=False, **tree.leaves(memory, "memory"))
        with np.load(tmp_path / "memory.npz") as saved:
            back = tree.fill(first, dict(saved), "memory")
        assert type(back) is type(memory)
        following = epoch(rng)
        for one, other in zip(
            *(arrays(guidance.teach(method, following, kept)[0]) for kept in (memory, back)),
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)

    def test_a_wrapper_takes_it_or_says_why_not(self, name):
        if name in REWARDS:
            assert JudgeSettings(method=name).method == registry.create(name)
        else:
            with pytest.raises(InputError, match=f"method {name!r} .*no wrapper.*: choose another"):
                JudgeSettings(method=name)


# --- beside other learners ---


def judge(scheme: Scheme) -> Any:
    """Calls biased what has a sum of scores above one half of the greatest."""
    k = len(scheme.issues)
    scores = np.random.default_rng(0).uniform(0, 1, (200, k))
    return detector.fit(
        scores, scores.sum(axis=1) > k / 2, source="simulated respondents", seed=0,
        issues=scheme.issue_names, identities=scheme.names,
    )  # fmt: skip


def rewards(name: str) -> tuple[np.ndarray, Ledger]:
    """Of a vector of environments, and the ledger of the wrapper."""
    envs = SyncVectorEnv([Toy] * 3, autoreset_mode=AutoresetMode.SAME_STEP)
    settings = JudgeSettings(8, name)
    env = JudgeVectorServices(envs, SCHEME, facts_of, settings=settings, detector=judge(SCHEME))
    env.reset(seed=1)
    found = np.array([env.step(np.zeros(3, int))[1] for _ in range(150)])
    return found, env.ledger


@pytest.mark.parametrize("name", REWARDS)
class TestWrapped:
    def test_what_is_paid_is_what_rewards_gain(self, name):
        found, ledger = rewards(name)
        plain, _ = rewards("service")
        assert np.isfinite(found).all()
        assert (ledger.paid[:8] == 0.0).all()  # before any window is over
        assert (np.abs(ledger.paid).sum() > 0) == (name != "service")
        np.testing.assert_allclose((found - plain).sum(), ledger.paid.sum())
        again, _ = rewards(name)
        assert again.tobytes() == found.tobytes()

    def test_it_resumes_from_a_checkpoint_to_the_bit(self, name, tmp_path):
        """Episode i is the one of seed i; the second half runs in another wrapper."""

        def made() -> JudgeServices:
            chosen = JudgeSettings(8, name)
            return JudgeServices(Toy(), SCHEME, facts_of, settings=chosen, detector=judge(SCHEME))

        def served(env: JudgeServices, seeds: range) -> list[float]:
            found = []
            for seed in seeds:
                env.reset(seed=seed)
                over = False
                while not over:
                    _, reward, terminated, truncated, _ = env.step(0)
                    over = terminated or truncated
                    found.append(float(reward))
            return found

        whole = made()
        wanted = served(whole, range(60))
        half = made()
        got = served(half, range(29))
        np.savez(tmp_path / "half.npz", allow_pickle=False, **half.state())
        resumed = made()
        with np.load(tmp_path / "half.npz") as saved:
            resumed.restore(saved)
        got += served(resumed, range(29, 60))
        assert got == wanted
        np.testing.assert_array_equal(resumed.ledger.paid, whole.ledger.paid)
        assert len(resumed.services) == 60
        assert (np.array(resumed.windows.biased) == np.array(whole.windows.biased)).all()


@pytest.mark.parametrize("name", [n for n in NAMES if hasattr(registry.create(n), "pay")])
def test_services_at_once_are_paid_as_one_by_one(name):
    rng = np.random.default_rng(1)
    rows = rng.integers(0, 2, (3, 40))
    ledger, also = (
        Ledger(ledgers.SCHEME, JudgeSettings(7, name), judge(ledgers.SCHEME)) for _ in "ab"
    )
    singly = [ledgers.add(ledger, *(rows[:, [i]]))[0] for i in range(40)]
    np.testing.assert_allclose(ledgers.add(also, *rows), singly, atol=1e-12)


@pytest.mark.parametrize(
    ("saved", "wanted"), [("service", "elbert"), ("ggf", "group_dro"), ("a_ppo", "elbert")]
)
def test_the_state_of_another_method_is_refused(saved, wanted):
    def ledger(name: str) -> Ledger:
        made = Ledger(ledgers.SCHEME, JudgeSettings(4, name))
        ledgers.add(made, *ledgers.FIRST)
        return made

    with refused("changed state"):
        ledger(wanted).restore(ledger(saved).state())


def test_a_state_of_something_else_is_refused():
    ledger = Ledger(ledgers.SCHEME, JudgeSettings(4, "levelup"))
    with refused("changed state"):
        ledger.restore({"codes": np.zeros((3, 1))})
    assert len(ledger) == 0


# --- what other answers would have been worth ---

BY_REWARDS = [
    name for name in NAMES if name not in ("a_ppo", "surgery", "influence", "lagrangian", "elbert")
]
"""Methods whose ``teach`` says of a service alone what it is worth, up to a common constant.

A-PPO scales over its batch, which with all answers is another, the Lagrangian and ELBERT-PO
standardise their parts before they combine them, and influence pays by the mean window where the
running one is not over.
"""


@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("name", NAMES)
def test_every_method_weighs_answers(name, edge):
    method, rng = registry.create(name), np.random.default_rng(5)
    memory = guidance.begin(method, SMALL)
    for _ in range(3):
        found = edge(rng)
        _, memory = guidance.teach(method, found, memory)
        worth = guidance.worth(method, answers(found, rng), memory)
        assert worth.shape == (N, A)
        assert np.isfinite(worth).all()
        if registry.DIRECTION in registry.needs_of(method):
            assert np.isfinite(guidance.direction(method, answers(found, rng), memory)).all()


@pytest.mark.parametrize("name", BY_REWARDS)
def test_the_answer_that_was_given_is_worth_what_the_method_taught(name):
    method, rng = registry.create(name), np.random.default_rng(6)
    memory = guidance.begin(method, SMALL)
    for _ in range(3):
        mask = np.ones((N, 1))
        found = epoch(rng, mask=mask, advantages_of=lambda r: np.asarray(r)[:, None])
        given, memory = guidance.teach(method, found, memory)
        taught = given.earned(found.reward)
        if given.advantages is not None:
            taught = given.advantages[:, 0]
        worth = guidance.worth(method, answers(found, rng), memory)[:, GIVEN]
        # what all services have alike moves no policy
        np.testing.assert_allclose(worth - worth.mean(), taught - taught.mean(), atol=1e-12)


def test_elbert_weighs_answers_by_the_credit_that_it_taught():
    method, rng = registry.create("elbert", standardise=False), np.random.default_rng(6)
    memory = guidance.begin(method, SMALL)
    for _ in range(3):
        found = epoch(rng, mask=np.ones((N, 1)), advantages_of=lambda r: np.asarray(r)[:, None])
        given, memory = guidance.teach(method, found, memory)
        worth = guidance.worth(method, answers(found, rng), memory)[:, GIVEN]
        assert given.advantages is not None
        np.testing.assert_allclose(worth, given.advantages[:, 0], atol=1e-12)


def test_the_lagrangian_weighs_answers_by_the_cost_that_it_taught():
    method, rng = registry.create("lagrangian", limit=0.0, start=2.0), np.random.default_rng(6)
    memory = guidance.begin(method, SMALL)
    for _ in range(3):
        found = epoch(rng, mask=np.ones((N, 1)), advantages_of=lambda r: np.asarray(r)[:, None])
        given, memory = guidance.teach(method, found, memory)
        worth = guidance.worth(method, answers(found, rng), memory)[:, GIVEN]
        # apart from the scale of the reward, the same cost
        assert given.advantages is not None
        plain = (found.reward - found.reward.mean()) / found.reward.std()
        cost = plain - (1.0 + memory.lam) * given.advantages[:, 0]
        ours = found.reward - (1.0 + memory.lam) * worth
        np.testing.assert_allclose(ours - ours.mean(), cost - cost.mean(), atol=1e-12)


def test_surgery_weighs_by_the_influence_that_it_taught():
    method, rng = registry.create("surgery"), np.random.default_rng(7)
    memory = guidance.begin(method, SMALL)
    for _ in range(3):
        found = epoch(rng, mask=np.ones((N, 1)))
        given, memory = guidance.teach(method, found, memory)
        assert given.fair is not None
        weighed = guidance.direction(method, answers(found, rng), memory)
        np.testing.assert_allclose(weighed[:, GIVEN], given.fair[:, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "kind"),
    [
        (np.zeros((N, A - 1)), "shape method"),
        (np.full((N, A), np.nan), "range method"),
        ("good", "type method"),
    ],
)
def test_a_worth_that_is_none_is_refused(wrong, kind):
    @registry.method("odd_worth")
    class Odd:
        def begin(self, scheme):
            return None

        def teach(self, epoch, memory):
            return epoch.reward, memory

        def worth(self, answers, memory):
            return wrong

    found = epoch(np.random.default_rng(1))
    with refused(kind):
        guidance.worth(Odd(), answers(found, np.random.default_rng(2)), None)
