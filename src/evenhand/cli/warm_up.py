"""Compile ahead what an experiment would compile first: run once after installation.

    python -m evenhand.cli.warm_up

Machine code is kept beside the files (Numba) and in the cache folder (JAX, see ``learn.runtime``);
where neither can be written, this costs half a minute and changes nothing.
"""

from dataclasses import replace

from evenhand.experiments.paper.reproduce import ARMS, arms_of
from evenhand.experiments.settings import ReproduceSettings
from evenhand.methods import detector_file
from evenhand.methods.guidance import SERVICE_KINDS
from evenhand.training import evaluate, train
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import settings_of


def warm() -> None:
    """Serve a window by a script, and learn one epoch in every arm of the paper's experiment."""
    set_up_jax()
    judge = detector_file.load(detector_file.SHIPPED)
    evaluate.serve_scripted("ageist", 1.0, "uniform", evaluate.WINDOW, 0)
    for preset in ReproduceSettings().preset:
        for arm in arms_of(preset):
            algorithm, kind = ARMS[arm]
            settings = settings_of(preset, algorithm, kind, epochs=1)
            settings = replace(settings, reflect=kind in SERVICE_KINDS)
            for _ in train.train(settings, judge):
                pass


if __name__ == "__main__":
    warm()
