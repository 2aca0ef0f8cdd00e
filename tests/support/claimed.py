"""Made-up results whose claims have a known outcome."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from evenhand.experiments.paper.demonstrations import Demos, Study
from evenhand.methods.services import Services
from evenhand.restaurant.people import IDENTITIES
from evenhand.statistics.detector_accuracy import wilson
from evenhand.study.simulated.respondents import NAMEABLE, Questionnaire

SEEDS, EPOCHS = (0, 1, 2), 60


def learned(preset: str, **changed: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of epochs and of the test in which guidance does exactly what the paper says."""
    is_ = {"total": 0.7, "biased": 39, "early": 0.2, "late": 0.6, "swing": 0.1, "apart": 1}
    is_ |= changed
    epochs, test = [], []
    for arm in ("reinforce", "reinforce+guidance", "ppo", "ppo+guidance"):
        guided = arm.endswith("guidance")
        for seed in SEEDS:
            biased = is_["biased"] if guided else 54 + is_["apart"] * (seed - 1)
            test.append(
                {
                    "preset": preset,
                    "arm": arm,
                    "seed": seed,
                    "total": (is_["total"] if guided else 1.0) * (1 + 0.1 * seed),
                    "corrected_total": (is_["total"] if guided else 1.0) * (1 + 0.1 * seed),
                    "floor": 0.4,
                    "perfect_rate": 0.5,
                }
            )
            for epoch in range(EPOCHS):
                quality = is_["early"] if epoch < 10 else is_["late"]
                epochs.append(
                    {
                        "preset": preset,
                        "arm": arm,
                        "seed": seed,
                        "epoch": epoch,
                        "biased_detector": epoch < biased,
                        # up and down by so much in the second half, wildly before
                        "total": (is_["swing"] if guided else 0.2)
                        * (1 + 0.1 * seed)
                        * (-1) ** epoch
                        * (9.0 if epoch < EPOCHS // 2 else 1.0),
                        # 10 epochs in between, which count for neither end
                        "perfect_rate": 9.0 if 10 <= epoch < 20 else quality * (1 + 0.1 * seed),
                    }
                )
    return epochs, test[::-1]  # in whatever order


def made_demos(ignored: int = 6) -> Demos:
    """Two windows of each biased robot at full strength, and one of the even robot.

    The ableist robot serves disabled people from 2 m. The ageist robot serves children late. The
    racist robot ignores the first ``ignored`` Black people of each window.
    """
    robot, strength = [0, 1, 1, 2, 2, 3, 3], [0.0, 1, 1, 1, 1, 1, 1]
    person = np.tile(np.arange(30), 7)
    kind = np.repeat(robot, 30)
    codes = {
        "race": person // 5,
        "gender": person % 3,
        "age": person // 6,
        "disability": person % 2,
    }
    codes["skin"] = person // 5
    responded = ~((kind == 1) & (codes["race"] == 1) & (person % 5 < ignored))
    responded &= ~((kind == 1) & (codes["race"] == 2) & (person % 5 < ignored - 5))
    step = np.where((kind == 2) & (codes["age"] == 0), 250, 100)
    distance = np.where((kind == 3) & (codes["disability"] == 0), 2.0, 1.25)
    table = Services.build(
        {one.name: (codes[one.name], one.groups) for one in IDENTITIES},
        {
            "responded": responded,
            "response_step": np.ma.array(step, mask=~responded),
            "response_distance": np.ma.array(distance, mask=~responded),
            "min_distance": np.where(responded, distance, 0.42),
        },
    )
    return Demos(table, np.array(robot), np.array(strength, float))


def made_study(agree: int = 980, race: int = 9, disability: int = 5) -> Study:
    """A study whose detector agrees in ``agree`` of 1,000 judgements; 24 respondents."""
    named = ["race"] * race + ["gender"] * (24 - race)
    named += ["age"] * 48
    named += ["disability"] * disability + [NAMEABLE[0]] * (24 - disability)
    answers = Questionnaire(
        np.repeat([1, 2, 3, 4], 24), np.tile(np.arange(24), 4), tuple(named), ("risk",) * 96
    )
    evaluation = SimpleNamespace(
        n=1000,
        folds=5,
        agreement=wilson(agree, 1000),
        accuracy=wilson(900, 1000),
        manual_accuracy=wilson(890, 1000),
        baseline=0.6,
    )
    return cast(Study, SimpleNamespace(questionnaire=answers, evaluation=evaluation))
