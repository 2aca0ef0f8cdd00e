"""Pictures and PyTorch in one process: they work, or it is said why not."""

import subprocess
import sys

from support.extras import wanted

wanted("stable_baselines3", "the extra sb3")

DRAW = """
from evenhand.restaurant.env import RestaurantEnv
env = RestaurantEnv(render_mode="rgb_array")
env.reset(seed=0)
print("drawn", env.render().shape)
"""
LEARN = """
import evenhand.adapters.sb3
from stable_baselines3 import A2C
A2C("MlpPolicy", evenhand.adapters.sb3.restaurant(2), device="cpu")
print("learner")
"""


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)


def test_pictures_after_learning():
    done = run(LEARN + DRAW)
    assert done.stdout.splitlines() == ["learner", "drawn (480, 640, 3)"], done.stderr


def test_learning_after_pictures_is_refused_where_it_would_end_the_process():
    done = run(
        DRAW + "import evenhand.adapters.sb3.loading as it\nprint('libLLVM' in it._loaded())"
    )
    told = run(DRAW + LEARN)
    if done.returncode == 0 and done.stdout.splitlines()[-1] == "False":
        assert told.stdout.splitlines()[-1] == "learner"  # another driver draws here
        return
    assert told.returncode == 1
    assert told.stderr.splitlines()[-1].endswith(
        "import evenhand.adapters.sb3 before anything is rendered"
    )
