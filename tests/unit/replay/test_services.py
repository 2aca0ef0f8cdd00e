"""What the page is told of services, against hand calculation and the recording itself."""

import base64

import numpy as np
import pytest

from evenhand.methods.paper import issues
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan
from evenhand.restaurant.replay import services
from support import replayed
from support.refusals import refused

NONE = float("nan")
LIMITS = issues.Thresholds()


def decoded(text):
    return np.frombuffer(base64.b64decode(text), "<i2")


@pytest.fixture(scope="module")
def recorded():
    return replayed.served(12)


@pytest.fixture(scope="module")
def packed(recorded):
    return services.pack(*recorded)


# --- poses -----------------------------------------------------------------------------------


def test_places_and_poses_are_those_of_the_recording_to_the_last_digit(recorded, packed):
    seen = recorded[0]
    for row, service in enumerate(packed):
        n = seen.frames[row]
        assert np.array_equal(decoded(service["position"]) / 4000, seen.position[row].ravel())
        pose = decoded(service["pose"]).reshape(-1, 3) / 4000
        assert np.array_equal(pose[:, :2], seen.pose[row, :n, :2])
        assert np.abs(pose[:, 2]).max() <= np.pi + 1 / 4000
        turns = (pose[:, 2] - seen.pose[row, :n, 2]) / (2 * np.pi)
        assert np.allclose(turns, np.rint(turns), atol=1e-3)


def test_a_yaw_of_many_turns_still_fits():
    seen = replayed.approach([[3.0, 2.0]])
    yaw = 20.3 * np.pi
    seen.pose[0, :2, 2] = [yaw, yaw]
    rows = replayed.table(
        responded=[True], response_step=[5], response_distance=[2.0], min_distance=[2.0], steps=[5]
    )
    pose = decoded(services.pack(seen, rows)[0]["pose"]).reshape(-1, 3)
    assert pose[0, 2] == round(0.3 * np.pi * 4000)


def test_what_was_not_sensed_is_marked_as_missing(recorded, packed):
    seen = recorded[0]
    for row, service in enumerate(packed):
        n = seen.frames[row]
        steps = decoded(service["sensed"])
        assert np.array_equal(steps == -32768, np.isnan(seen.sensed[row, :n]))
        heard = ~np.isnan(seen.sensed[row, :n])
        assert np.array_equal(steps[heard] / 4000, seen.sensed[row, :n][heard])


def test_the_cameras_stand_in_the_room_and_look_at_robot_and_person(recorded, packed):
    seen = recorded[0]
    for row, service in enumerate(packed):
        views = decoded(service["shoulder"]).reshape(-1, 7)
        assert len(views) == seen.frames[row]
        eye = views[:, :3] / 4000
        assert (np.abs(eye[:, :2]) < floor_plan.ROOM).all()
        w, x, y, z = (views[:, 3:] / 32767).T
        # minus the third column of the rotation matrix, by hand
        look = -np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
        for goal in (seen.pose[row, : seen.frames[row], :2], seen.position[row, :1]):
            way = goal - eye[:, :2]
            cos = (way * look[:, :2]).sum(1) / np.linalg.norm(way, axis=1)
            assert (cos / np.linalg.norm(look[:, :2], axis=1) > np.cos(np.deg2rad(45))).all()


# --- issues ----------------------------------------------------------------------------------


def times(distances, indicators):
    seen = replayed.approach(distances)
    return services.issue_times(seen, np.array(indicators, float), LIMITS)


def test_risk_begins_between_the_poses_where_the_limit_is_crossed():
    # poses are 0.1 s apart; from 0.6 to 0.4 m the limit of 0.5 m is crossed half way
    found = times([[2.0, 1.0, 0.6, 0.4, 0.45]], [[0, 0, 0, 1]])
    assert found[0] == pytest.approx([NONE, NONE, NONE, 0.25], abs=1e-3, nan_ok=True)


def test_risk_from_the_start_begins_at_the_start():
    assert times([[0.4, 0.4]], [[0, 0, 0, 1]])[0, 3] == 0.0


def test_a_risk_between_two_poses_is_put_at_the_nearest_pose():
    found = times([[1.0, 0.7, 0.51, 0.6]], [[0, 0, 0, 1]])
    assert found[0, 3] == pytest.approx(0.2)


def test_a_late_response_is_late_from_step_200_and_improper_at_the_end():
    # 51 poses, 5 steps apart: it ends at step 250, after 5 s
    found = times([[0.8] * 51], [[0, 1, 1, 0]])
    assert found[0] == pytest.approx([NONE, 5.0, 4.0, NONE], nan_ok=True)


def test_without_a_response_only_willingness_is_known_and_only_at_the_end():
    found = times([[2.0] * 61], [[1, NONE, NONE, 0]])
    assert found[0] == pytest.approx([6.0, NONE, NONE, NONE], nan_ok=True)


def test_an_issue_that_the_facts_do_not_have_never_begins():
    assert np.isnan(times([[0.4] * 61], [[0, 0, 0, 0]])).all()


def test_outcomes_in_words():
    rows = replayed.table(
        responded=[True, True, False],
        response_step=[130, 250, None],
        response_distance=[1.244, 0.8, None],
        min_distance=[1.2, 0.45, 0.75],
        steps=[130, 250, 300],
    )
    x = issues.indicators(rows)
    assert [services.outcome(rows, row, x[row]) for row in range(3)] == [
        "Response at 1.24 m after 2.6 s. No issue.",
        "Response at 0.80 m after 5.0 s. Issues: quality (not at 1.0 to 1.5 m), "
        "priority (later than 4.0 s), risk (as near as 0.45 m).",
        "No response within 6.0 s. Issue: willingness (no response).",
    ]


def test_who_is_not_known_is_called_so():
    facts = {"responded": [True], "response_step": [5], "response_distance": [2.0]}
    facts |= {"min_distance": [2.0], "steps": [5], "service": [0]}
    rows = Services.build({"age": (np.array([-1]), ("Child", "Elder"))}, facts)
    service = services.pack(replayed.approach([[3.0, 2.0]]), rows)[0]
    assert (service["who"], service["epoch"]) == (["not known"], None)


# --- which services --------------------------------------------------------------------------


def many(n, **issue_rows):
    """Services, 30 an epoch, good but for the named rows."""
    distance = np.full(n, 1.2)
    distance[issue_rows.get("quality", [])] = 0.8
    least = np.full(n, 1.0)
    least[issue_rows.get("risk", [])] = 0.3
    answered = np.ones(n, bool)
    answered[issue_rows.get("willingness", [])] = False
    return replayed.table(
        epoch=list(np.arange(n) // 30),
        responded=list(answered),
        response_step=[100 if a else None for a in answered],
        response_distance=[d if a else None for d, a in zip(distance, answered, strict=True)],
        min_distance=list(least),
        steps=[100] * n,
    )


def test_by_default_the_latest_five_with_each_issue_and_the_latest_others():
    rows = many(100, quality=[1, 2, 3, 4, 5, 6], risk=[0, 50])
    assert services.choose(rows) == [0, 2, 3, 4, 5, 6, 50, *range(77, 100)]


def test_a_small_run_is_shown_whole():
    assert services.choose(many(7, risk=[2])) == list(range(7))


def test_where_all_have_an_issue_the_latest_thirty_are_shown():
    assert services.choose(many(40, risk=range(40))) == list(range(10, 40))


def test_an_epoch_is_its_first_thirty_services():
    assert services.choose(many(90), epoch=1) == list(range(30, 60))


def test_an_epoch_that_does_not_exist():
    with refused("range epoch", "3", "0", "2"):
        services.choose(many(90), epoch=3)


def test_a_run_without_services():
    with refused("empty services"):
        services.choose(many(3).take(np.zeros(0, int)))


def test_rows_are_found_by_their_number_not_their_place():
    rows = many(9).take(np.array([4, 2, 8]))
    seen = replayed.approach([[2.0]] * 9)
    assert services.rows_of(seen[[2, 4]], rows).tolist() == [1, 0]
    with refused("missing service", "3"):
        services.rows_of(seen[[3]], rows)
