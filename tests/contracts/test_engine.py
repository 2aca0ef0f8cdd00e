"""Services as machine code come out as when Python is asked at every decision."""

from dataclasses import fields, replace

import mujoco
import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import driving, engine, layout, route, scene, serve, task
from evenhand.restaurant.simulation.engine import Engine
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.restaurant.simulation.recording import Recording
from evenhand.training import train
from evenhand.training.observation import as_network, view
from evenhand.training.policy import Actor, PolicySettings, make_policy
from evenhand.training.settings import settings_of
from support.setups import bumping, drawn

SETTINGS = settings_of("service", "ppo", "service", epochs=2)
MISSING = sensing.SenseSettings(perception=0.8)
NEEDS = needs.NeedSettings(strength=0.8)


def policy(rate: float = 0.04, **settings):
    chosen = PolicySettings(initial_response_rate=rate, **settings)
    made = make_policy(task.OBSERVATION_SIZE, chosen, np.random.default_rng(3))
    # a head that listens to what is seen, unlike that of an untrained policy
    head = np.random.default_rng(4).normal(size=made.actor.weights[-1].shape) / 4
    weights = (*made.actor.weights[:-1], head.astype(np.float32))
    return replace(made, actor=replace(made.actor, weights=weights))


def both(
    setups: layout.Setups,
    *,
    settings=SETTINGS,
    made=None,
    sense=None,
    wanted=None,
    decide=None,
    threads=2,
):
    """The same services, asked for step by step and as machine code."""
    made = policy() if made is None else made
    decide = decide or task.TaskSettings()
    lanes, actor = Lanes(16, decide), Actor(made)
    ahead = serve.draw(
        lanes, setups, np.random.default_rng(9), sense or sensing.SenseSettings(), wanted
    )
    slow = serve.run(
        lanes, ahead, lambda seen, _: actor.probability(view(settings, seen)), recorded=True
    )
    network = as_network(settings, made)
    fast = Engine(decide, len(setups), task.N_GROUPS, threads).run(ahead, network, recorded=True)
    return slow, fast


def assert_same(slow: serve.Trajectories, fast: serve.Trajectories) -> None:
    for name in ("action", "mask", "observation"):
        np.testing.assert_array_equal(getattr(slow, name), getattr(fast, name), name)
    for field in fields(slow.facts):
        if not field.name.startswith("_"):
            np.testing.assert_array_equal(
                getattr(slow.facts, field.name), getattr(fast.facts, field.name), field.name
            )
    for field in fields(Recording):
        np.testing.assert_array_equal(
            getattr(slow.seen, field.name), getattr(fast.seen, field.name), field.name
        )


CASES = {
    "plain": {},
    "one thread": {"threads": 1},
    "more threads than services": {"threads": 64},
    "readings fail": {"sense": MISSING},
    "others need another service": {"wanted": NEEDS},
    "every step a decision": {"decide": task.TaskSettings(interval=1)},
    "fewer steps than commands last": {"decide": task.TaskSettings(interval=3)},
    "more steps than a command lasts": {"decide": task.TaskSettings(interval=12)},
    "unaware": {"settings": replace(SETTINGS, method="unaware")},
    "relu": {"made": policy(activation="relu")},
    "one layer": {"made": policy(hidden=(7,))},
    "three layers": {"made": policy(hidden=(5, 90, 3))},
    "nobody is answered": {"made": policy(rate=1e-7)},
}


@pytest.mark.parametrize("case", CASES)
def test_services_are_the_same_to_the_last_bit(case):
    slow, fast = both(drawn(37, 2), **CASES[case])
    assert_same(slow, fast)
    if case == "nobody is answered":
        assert not fast.facts.responded.any()
    elif case == "plain":
        assert 0.2 < fast.facts.responded.mean() < 1.0


def test_contacts_are_counted():
    slow, fast = both(bumping(6, 8), made=policy(rate=1e-7))
    assert fast.facts.contact_steps[0] > 0
    assert_same(slow, fast)


def test_the_sensor_counts_what_mujoco_found():
    model = scene.still_model()
    data = mujoco.MjData(model)
    found = set()
    for x in np.linspace(-4.0, 4.0, 60):
        data.qpos[:2] = x, 0.1
        mujoco.mj_step(model, data)
        assert data.sensordata[scene.SENSOR_CONTACTS] == data.ncon
        found.add(data.ncon)
    assert len(found) > 1


@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_the_network_says_what_the_actor_says(activation):
    made = policy(activation=activation)
    network = as_network(SETTINGS, made)
    seen = np.random.default_rng(0).uniform(0, 2, (300, task.OBSERVATION_SIZE)).astype(np.float32)
    seen[0], seen[1] = 1e3, -1e3  # saturated
    said = network(seen, np.arange(len(seen)))
    wanted = Actor(made).probability(view(SETTINGS, seen))
    np.testing.assert_allclose(said, wanted, atol=2e-6)


def test_both_files_call_the_same_the_front_of_a_seat():
    # kept machine code must not read a number from another file
    assert driving._FRONT == route._FRONT == np.cos(np.deg2rad(55.0))


def test_a_simulation_that_breaks_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where one stands
    lanes = Lanes(4, task.TaskSettings())
    ahead = serve.draw(lanes, drawn(4, 1), np.random.default_rng(0), sensing.SenseSettings())
    ahead.beginning.rows.state[2] = np.nan
    network = as_network(SETTINGS, policy())
    with pytest.raises(RuntimeError, match="unstable"):
        Engine(task.TaskSettings(), 4, task.N_GROUPS, 2).run(ahead, network)
    with pytest.raises(RuntimeError, match="unstable"):
        serve.run(lanes, ahead, network)


def test_training_is_the_same_where_the_functions_are_not_found(monkeypatch):
    detector = detector_file.load(detector_file.SHIPPED)

    def weights() -> list[np.ndarray]:
        last = list(train.train(SETTINGS, detector))[-1]
        return [np.asarray(w) for w in last.state.policy.actor.weights]

    quick = weights()
    assert engine.found() is not None
    monkeypatch.setattr(engine, "found", lambda: None)
    for ours, theirs in zip(quick, weights(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_where_there_is_no_library_nothing_is_found(monkeypatch, tmp_path):
    monkeypatch.setattr(engine.mujoco, "__file__", str(tmp_path / "__init__.py"))
    assert engine.found.__wrapped__() is None
    (tmp_path / "libmujoco.so").write_text("no library")
    assert engine.found.__wrapped__() is None
