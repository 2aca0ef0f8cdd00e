"""Forked processes and other threads get a sentence where they would wait for ever."""

import subprocess
import sys
import textwrap

from evenhand.core import forks
from support.refusals import refused

FORK = """
import os, sys, traceback
import numpy as np
from evenhand.core.errors import InputError
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.vector import RestaurantVectorEnv

def forked(do):
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        try:
            print(do())
        except InputError as error:
            print("refused:", error)
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        os._exit(0)
    os.waitpid(child, 0)
"""
NEVER = 300
"""Seconds after which something is taken to wait for ever."""


def run(program: str) -> list[str]:
    """What a program prints in a process of its own, line by line."""
    text = FORK + textwrap.dedent(program)
    ended = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, timeout=NEVER
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()


def test_an_environment_with_threads_is_refused_in_a_forked_process_and_a_new_one_works():
    refused, left, new, copied = run("""
        def served(envs):
            envs.reset(seed=0)
            return float(envs.step(np.zeros(4, int))[0].sum())

        envs = RestaurantVectorEnv(4, threads=2)
        envs.reset(seed=0)
        envs.step(np.zeros(4, int))
        forked(lambda: envs.step(np.zeros(4, int)))

        def leave():
            global envs
            del envs
            return "freed"

        forked(leave)
        right = served(RestaurantVectorEnv(4, threads=2))
        forked(lambda: served(RestaurantVectorEnv(4, threads=2)) == right)
        import copy
        forked(lambda: served(copy.deepcopy(envs)) == right)
    """)
    assert refused.startswith("refused: this environment was made before this process was forked")
    assert "make it in the new process, or start processes by the method 'spawn'" in refused
    assert left == "freed"
    assert [new, copied] == ["True", "True"]


def test_one_restaurant_and_one_thread_go_on_in_a_forked_process():
    one, many = run("""
        env, envs = RestaurantEnv(), RestaurantVectorEnv(4, threads=1)
        env.reset(seed=0), envs.reset(seed=0)
        import copy
        twin, twins = copy.deepcopy(env), copy.deepcopy(envs)
        right = twin.step(0)[0], twins.step(np.zeros(4, int))[0]
        forked(lambda: np.array_equal(env.step(0)[0], right[0]))
        forked(lambda: np.array_equal(envs.step(np.zeros(4, int))[0], right[1]))
    """)
    assert [one, many] == ["True", "True"]


def test_a_fork_while_others_simulate_leaves_the_child_able_to():
    assert run("""
        import threading
        from evenhand.restaurant.simulation import clock
        inside, over = threading.Event(), threading.Event()

        def simulate():
            with clock.untimed():
                inside.set()
                over.wait()

        other = threading.Thread(target=simulate)
        other.start()
        inside.wait()
        clock._lock.acquire()

        def step():
            env = RestaurantEnv()
            env.reset(seed=0)
            env.step(0)
            return clock._simulating

        forked(step)
        clock._lock.release()
        over.set()
        other.join()
    """) == ["0"]


def test_training_is_refused_in_a_process_that_was_forked_after_jax_was_used():
    before, begun, anew, made = run("""
        import warnings
        from evenhand.methods import detector_file
        from evenhand.training.settings import TrainSettings
        from evenhand.training.train import train, untrained

        warnings.filterwarnings("ignore", message="os.fork", category=RuntimeWarning)
        detector = detector_file.load(detector_file.SHIPPED)

        def learn():
            return len(list(train(TrainSettings(epochs=2), detector)))

        forked(learn)
        training = train(TrainSettings(epochs=2), detector, threads=2)
        next(training)
        forked(lambda: next(training))
        forked(learn)
        forked(lambda: untrained(TrainSettings()))
    """)
    assert before == "2"  # JAX was imported, and not used
    for said in (begun, anew, made):
        assert said.startswith("refused: JAX was used before this process was forked"), said


def test_machine_code_on_threads_is_refused_in_a_forked_process():
    said, alone = run("""
        from evenhand.restaurant import people
        from evenhand.restaurant.scenarios import sensing
        from evenhand.restaurant.simulation import layout, serve, task
        from evenhand.restaurant.simulation.driving import Network
        from evenhand.restaurant.simulation.engine import Engine
        from evenhand.restaurant.simulation.lanes import Lanes

        lanes, rng = Lanes(4, task.TaskSettings()), np.random.default_rng(0)
        setups = layout.draw(people.population("uniform"), 4, rng)
        drawn = serve.draw(lanes, setups, rng, sensing.SenseSettings())
        zeros = np.zeros(25, np.float32)
        network = Network(
            (np.zeros((25, 2), np.float32),), (np.zeros(2, np.float32),), zeros, zeros, True
        )
        for threads in (2, 1):
            engine = Engine(task.TaskSettings(), 4, 22, threads)
            engine.run(drawn, network)
            forked(lambda: len(engine.run(drawn, network).facts.steps))
    """)
    assert said.startswith("refused: these simulations were made before this process was forked")
    assert alone == "4"


def test_pictures_in_a_forked_process(opengl):
    first, refused, anew = run("""
        import gc
        env = RestaurantEnv(render_mode="rgb_array")
        env.reset(seed=0)
        forked(lambda: env.render().shape)
        picture = env.render()
        forked(env.render)

        def another():
            global env
            del env
            gc.collect()
            other = RestaurantEnv(render_mode="rgb_array")
            other.reset(seed=0)
            return other.render()

        forked(another)
    """)
    assert first == "(480, 640, 3)"  # nothing was opened before
    for said in (refused, anew):
        assert said.startswith("refused: OpenGL was opened before this process was forked"), said


def test_gymnasiums_forked_environments_work_after_threads_were_used_here(opengl):
    assert run("""
        import gymnasium as gym

        def made(**others):
            chosen = {"num_envs": 2, "max_episode_steps": 3, "render_mode": "rgb_array"}
            return gym.make_vec("evenhand.restaurant:evenhand/Restaurant-v0", **chosen, **others)

        envs = made(threads=2)
        envs.reset(seed=0)
        others = made(vectorization_mode="async", vector_kwargs={"context": "fork"})
        others.reset(seed=0)
        for _ in range(3):
            mine, theirs = envs.step(np.zeros(2, int)), others.step(np.zeros(2, int))
            print(np.array_equal(mine[0], theirs[0]), theirs[3].tolist() == mine[3].tolist())
        pictures = envs.render(), others.render()
        print(np.array_equal(*pictures), mine[3].all())
        others.close()
    """) == ["True True"] * 3 + ["True True"]


def test_home_by_itself(monkeypatch):
    home = forks.Home("it was made", "make it anew, or ")
    home.check()
    forks.check_jax()
    monkeypatch.setattr(forks, "_forks", forks._forks + 1)
    with refused("unsupported fork"):
        home.check()
    forks.Home("it was made").check()
