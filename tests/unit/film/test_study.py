"""The clips of the questionnaire: what is chosen, by facts; and what raters must not see."""

import contextlib
import json

import numpy as np
import pytest

from evenhand.experiments.paper import questionnaire_clips
from evenhand.methods.vocabulary import ISSUES
from evenhand.restaurant import people, robots
from evenhand.restaurant.film import clip
from evenhand.study.simulated.respondents import SCENARIOS

SEED = 0


@pytest.fixture(scope="module")
def served():
    return questionnaire_clips.serve(SEED)


@pytest.fixture(scope="module")
def choices(served):
    return questionnaire_clips.choose(served)


def person(served, choice):
    row = served[choice.robot].seen.people[choice.service, :1]
    return {name: labels[0] for name, labels in people.labels(row).items()}


def test_there_is_a_scenario_for_each_issue_as_in_the_questionnaire():
    assert tuple(scene.issue for scene in questionnaire_clips.SCENES) == ISSUES
    for scene, asked in zip(questionnaire_clips.SCENES, SCENARIOS, strict=True):
        assert scene.number == asked.number
        assert scene.robot in asked.title
        # its own issue is what is seen most of in the paper's scenario
        assert int(np.argmax(asked.seen)) == ISSUES.index(scene.issue)
        assert scene.manner in robots.MANNERS


def test_every_scenario_has_two_triples(choices):
    for scene in questionnaire_clips.SCENES:
        own = [choice for choice in choices if choice.scene is scene]
        assert [choice.role for choice in own] == list(questionnaire_clips.ROLES) * 2
        assert [choice.triple for choice in own] == [0, 0, 0, 1, 1, 1]


def test_who_is_treated_worse_has_the_issue_and_nobody_else_has_any(served, choices):
    for choice in choices:
        found = clip.issues_of(served[choice.robot].facts, choice.service)
        if choice.role == "worse":
            assert choice.scene.issue in found
            assert set(found) <= {choice.scene.issue, *choice.scene.also}
        else:
            assert found == []


def test_only_what_the_robot_goes_by_sets_them_apart(served, choices):
    for worse, other, even in zip(choices[::3], choices[1::3], choices[2::3], strict=True):
        one, another = person(served, worse), person(served, other)
        for name, categories in worse.scene.worse.items():
            assert one[name] in categories
            assert another[name] not in categories
        assert {n for n in one if one[n] != another[n]} == set(worse.scene.worse)
        assert person(served, even) == one
        # the same place, the same start
        first, second = served[worse.robot].seen, served["even"].seen
        np.testing.assert_array_equal(first.position[worse.service], second.position[even.service])
        np.testing.assert_array_equal(first.start[worse.service], second.start[even.service])


def test_two_triples_are_of_different_people(served, choices):
    for first, second in zip(choices[::6], choices[3::6], strict=True):
        assert person(served, first) != person(served, second)
        assert first.service != second.service


def test_the_choice_is_the_same_each_time(served, choices):
    assert questionnaire_clips.choose(served) == choices


def test_raters_are_not_primed():
    style = questionnaire_clips.STYLE
    assert (style.timer, style.rings, style.caption) == (False, False, "response")


@pytest.mark.slow
def test_the_clips_and_their_manifest(opengl, tmp_path, served):
    scene = questionnaire_clips.SCENES[3]
    small = questionnaire_clips.Style(
        camera="guest", width=320, height=240, timer=False, rings=False, caption="response"
    )
    paths = questionnaire_clips.film(tmp_path, SEED, small, (scene,))
    names = [path.name for path in paths]
    assert sorted(names) == [f"clip-{i:02d}.mp4" for i in range(1, 7)] + ["clips.json"]
    manifest = json.loads((tmp_path / "clips.json").read_text())
    clips = manifest["clips"]
    assert [one["file"] for one in clips] == names[:-1]
    assert sorted(one["role"] for one in clips) == sorted(questionnaire_clips.ROLES * 2)
    assert [one["role"] for one in clips] != list(questionnaire_clips.ROLES) * 2, (
        "their order tells nothing"
    )
    for one in clips:
        facts = served[one["robot"]].facts
        assert one["outcome"]["min_distance"] == facts.fact("min_distance")[one["service"]]
        assert one["issue"] == "risk"
        assert one["seconds"] > 0
        assert set(one["person"]) == {"race", "gender", "age", "disability", "skin"}
    assert len({one["pictures_sha256"] for one in clips}) == 6
    # what the manifest says can be filmed again
    first = clips[0]
    with contextlib.closing(small.screen()) as screen:
        footage = served[first["robot"]]
        again = tmp_path / "again.mp4"
        shot = clip.shoot(again, footage, first["service"], small, screen)
    assert shot.sha256 == first["pictures_sha256"]
    assert again.read_bytes() == (tmp_path / first["file"]).read_bytes()
