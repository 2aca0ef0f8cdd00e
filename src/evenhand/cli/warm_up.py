"""Compile ahead what an experiment would compile first: run once after installation.

    python -m evenhand.cli.warm_up

Machine code is kept beside the files (Numba) and in the cache folder (JAX, see ``learn.runtime``);
where neither can be written, this costs half a minute and changes nothing.
"""

from evenhand.experiments.paper.reproduce import arms_of, training_of
from evenhand.experiments.settings import ReproduceSettings
from evenhand.methods import detector_file
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.worlds import World
from evenhand.training import evaluate, train
from evenhand.training.jax_setup import set_up_jax


def warm() -> None:
    """Serve a window by a script, and learn one epoch in every arm of the paper's experiment."""
    set_up_jax()
    judge = detector_file.load(detector_file.SHIPPED)
    evaluate.serve_scripted(ScriptedRobot("ageist"), World(), evaluate.WINDOW, 0)
    for preset in ReproduceSettings().preset:
        for arm in arms_of(preset):
            for _ in train.train(training_of(preset, arm, 0, 1, "uniform"), judge):
                pass


if __name__ == "__main__":
    warm()
