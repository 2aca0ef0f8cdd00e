"""The paper's study names clips of `evenhand film study` as that command makes them."""

import numpy as np
import pytest

from evenhand.experiments.paper import questionnaire_clips as questionnaire
from evenhand.methods.paper.scores import score
from evenhand.restaurant import people
from evenhand.study.design import protocol_file

pytestmark = pytest.mark.slow

SEED = 0
WORDS = {"Other": "another", "Middle Aged": "middle-aged", "Elder": "elderly"}


@pytest.fixture(scope="module")
def served():
    return questionnaire.serve(SEED)


@pytest.fixture(scope="module")
def made(served):
    """File -> what is in it, as the command names them."""
    choices = questionnaire.choose(served)
    order = np.random.default_rng(SEED).permutation(len(choices))
    return {f"clip-{n + 1:02d}.mp4": choices[i] for n, i in enumerate(order)}


@pytest.fixture(scope="module")
def study():
    found, wrong = protocol_file.examine(protocol_file.PAPER, look=False)
    assert found is not None, wrong
    return found


def test_scenarios_show_somebody_served_worse_and_controls_do_not(study, made):
    for one in study.sets:
        shown = [made[name] for name in one.clips]
        roles = {choice.role for choice in shown}
        assert roles == ({"worse", "other"} if one.kind == "scenario" else {"even", "other"})
        [number] = {(choice.scene.number, choice.triple) for choice in shown}
        assert f"scenario {number[0]}" in one.note
        if one.kind == "scenario":
            assert f"{shown[0].scene.issue}: " in one.note
            assert f"the {shown[0].robot} robot" in one.note


def test_captions_say_who_asks(study, made, served):
    for one in study.sets:
        for name, caption in zip(one.clips, one.captions, strict=True):
            choice = made[name]
            codes = served[choice.robot].seen.people[choice.service, :1]
            person = {key: labels[0] for key, labels in people.labels(codes).items()}
            wheels = "in a wheelchair" if person["disability"] == "Yes" else "no wheelchair"
            race, gender, age = (WORDS.get(person[key], person[key]) for key in
                                 ("race", "gender", "age"))  # fmt: skip
            race += " race" * (race == "another")
            gender = gender + " gender" if gender == "another" else gender.lower()
            age = age.lower()
            assert caption == f"Who asks: {race}, {gender}, {age}, {wheels}."


def test_scores_are_those_of_the_robots(study, made, served):
    for one in study.sets:
        [robot] = {made[name].robot for name in one.clips if made[name].role != "other"}
        found = score(served[robot].facts).by_identity
        for identity, scores in one.scores.items():
            assert scores == pytest.approx(found[identity], abs=0.005)
