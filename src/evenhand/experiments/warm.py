"""Compile ahead what an experiment would compile first: run once after installation.

    python -m evenhand.experiments.warm

Machine code is kept beside the files (Numba) and in the cache folder (JAX, see ``learn.runtime``);
where neither can be written, this costs half a minute and changes nothing.
"""

from __future__ import annotations

from dataclasses import replace

from evenhand import detector_io
from evenhand.experiments import measure
from evenhand.experiments.reproduce import ARMS, arms_of
from evenhand.experiments.settings import ReproduceSettings
from evenhand.guidance import SERVICE_KINDS
from evenhand.learn import train
from evenhand.learn.runtime import set_up_jax
from evenhand.learn.settings import settings_of


def warm() -> None:
    """Serve a window by a script, and learn one epoch in every arm of the paper's experiment."""
    set_up_jax()
    judge = detector_io.load(detector_io.SHIPPED)
    measure.serve_scripted("ageist", 1.0, "uniform", measure.WINDOW, 0)
    for preset in ReproduceSettings().preset:
        for arm in arms_of(preset):
            algorithm, kind = ARMS[arm]
            settings = settings_of(preset, algorithm, kind, epochs=1)
            settings = replace(settings, reflect=kind in SERVICE_KINDS)
            for _ in train.train(settings, judge):
                pass


if __name__ == "__main__":
    warm()
