"""Simulated crowds that mind one thing: their weights are recovered, and they steer training."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from evenhand.experiments import tastes
from evenhand.methods import asked, issue_weights, registry
from evenhand.methods.paper.detector import complete
from evenhand.methods.vocabulary import SIMULATED
from evenhand.restaurant import robots
from evenhand.training import run_folder, train
from evenhand.training.settings import TrainSettings, settings_of
from support.refusals import refused


@pytest.fixture(scope="module")
def seen():
    return tastes.serve(600, seed=1)


def weights(seen, *minds, seed=2):
    biased = tastes.judge(seen, minds, seed)
    whole = complete(seen.scores)
    return issue_weights.fit(
        seen.scores[whole], biased[whole], source=SIMULATED, issues=tastes.MINDED
    )


@pytest.mark.slow
@pytest.mark.parametrize("minded", asked.ASKED)
def test_what_a_crowd_minds_is_recovered(seen, minded):
    tau = dict(zip(asked.ASKED, weights(seen, minded).tau, strict=True))
    assert max(tau, key=lambda name: tau[name]) == minded
    assert tau[minded] > 3.5  # of 5


@pytest.mark.slow
def test_who_minds_nothing_weighs_nothing(seen):
    assert weights(seen).tau == (0.0,) * 5


@pytest.mark.slow
def test_each_manner_raises_its_own_issue(seen):
    highest = {
        manner: asked.ASKED[int(np.nanmean(seen.scores[seen.manner == code], axis=0).argmax())]
        for code, manner in enumerate(robots.MANNERS)
        if manner in ("far", "near", "late", "ignore")
    }
    assert highest == {
        "far": "too_far", "near": "too_near", "late": "priority", "ignore": "willingness",
    }  # fmt: skip


def test_odd_minds_are_refused():
    seen = tastes.Windows(np.zeros(1, int), np.zeros(1, int), np.zeros((1, 5)))
    with refused("unknown minds"):
        tastes.judge(seen, ["closeness"], 0)
    with refused("duplicate minds"):
        tastes.judge(seen, ["risk", "risk"], 0)


# --- in training ---


def judged(tau, names=asked.ASKED):
    return issue_weights.IssueWeights(names, tau, tau, 0.001, 300, SIMULATED)


def chosen(method="levelup", learner="ppo-all", **changes) -> TrainSettings:
    base = settings_of("service", learner, method, seed=4, epochs=3)
    return replace(base, scenario="hidden", people=12, **changes)


def weights_of(settings):
    last = list(train.train(settings, train.shipped_detector(settings)))[-1]
    return np.concatenate([np.ravel(x) for x in jax.tree.leaves(last.state.policy)]), last


NOTHING = (0.0,) * 5


@pytest.mark.slow
@pytest.mark.parametrize("learner", ["ppo", "ppo-all", "reinforce", "reinforce-all"])
@pytest.mark.parametrize("method", ["levelup", "influence", "score", "blind"])
def test_who_minds_nothing_trains_for_service_alone_to_the_bit(method, learner):
    ours, _ = weights_of(chosen(method, learner, judges=judged(NOTHING)))
    theirs, _ = weights_of(chosen("service", learner))
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["levelup", "influence", "surgery", "score", "penalty"])
def test_what_people_mind_reaches_the_policy(method):
    near, _ = weights_of(chosen(method, "ppo", judges=judged((0.0, 5.0, 0.0, 0.0, 0.0))))
    far, last = weights_of(chosen(method, "ppo", judges=judged((0.0, 0.0, 5.0, 0.0, 0.0))))
    assert not np.array_equal(near, far)
    # what is scored and judged stays what it was
    assert {"willingness", "quality", "priority", "risk"} <= last.numbers.keys()
    assert last.numbers["probability"] is not None


@pytest.mark.slow
def test_a_run_notes_who_judged_and_comes_back(tmp_path):
    settings = chosen(judges=judged((1.0, 2.0, 0.5, 1.0, 0.5)))
    run_folder.execute(tmp_path / "run", settings, train.shipped_detector(settings))
    back, _ = run_folder.load_policy(tmp_path / "run")
    assert back == settings
    assert back.judges == settings.judges
    with refused("conflict folder", "judges"):
        run_folder.execute(tmp_path / "run", replace(settings, judges=None, tau=(1.0,) * 4), None)


def test_weights_are_given_once():
    with refused("conflict tau"):
        chosen(tau=(1.0, 1.0, 1.0, 2.0), judges=judged((1.0, 2.0, 0.5, 1.0, 0.5)))
    assert chosen(judges=judged((1.0, 2.0, 0.5, 1.0, 0.5))).tau == (1.0, 2.0, 0.5, 1.0, 0.5)


@pytest.mark.parametrize("method", [n for n in registry.BUILT_IN if n != "penalty"])
def test_a_detector_that_steers_nothing_is_refused(method):
    with refused("unsupported detector", method):
        train.check_steering(chosen(method, "ppo"))
    train.check_steering(chosen("penalty", "ppo"))
    train.check_steering(chosen(registry.create("levelup", when="biased"), "ppo"))
