"""What a figure shows of a person, and what it does not; and that looks change nothing."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.guests import Figures
from evenhand.restaurant.drawing.props import INDOORS
from evenhand.restaurant.simulation import layout, scene

AGES = people.IDENTITIES[2].groups
STANDING, SEATED = -1, 0


@pytest.fixture(scope="module")
def setups():
    return layout.draw(people.population("uniform"), 2, np.random.default_rng(5))


def looking(setups, age=2, wheelchair=False, table=STANDING, skin=0, race=0, gender=0):
    """The first set-up with twelve guests who all are and sit like this."""
    codes = np.tile([race, gender, age, 0 if wheelchair else 1, skin], (1, floor_plan.N_GUESTS, 1))
    return dataclasses.replace(
        setups[:1],
        people=codes,
        shape=layout.shape_of(codes),
        table=np.full((1, floor_plan.N_GUESTS), table),
    )


def dressed_for(setups, row=0):
    """A dressed model that shows one service, and its data with the guests at the origin."""
    model = copy.copy(dressing.model())
    Figures(model, scene.PERSON).show(setups, row)
    data = mujoco.MjData(model)
    data.mocap_pos[:] = [0.0, 0.0, scene.FOOTPRINT_HEIGHT]
    data.mocap_quat[:] = [1.0, 0.0, 0.0, 0.0]
    mujoco.mj_kinematics(model, data)
    return model, data


def part(model, guest, name):
    return model.geom(f"look_guest{guest}_{name}").id


def top_of_head(model, data, guest):
    head = part(model, guest, "head")
    return data.geom_xpos[head, 2] + model.geom_size[head, 2]


def seen(model, guest, prop):
    """Whether a guest's chair, wheelchair or cane is drawn: all of it or none of it."""
    name = f"look_guest{guest}_{prop}_"
    alpha = {
        model.geom_rgba[g, 3] for g in range(model.ngeom) if model.geom(g).name.startswith(name)
    }
    assert len(alpha) == 1
    return alpha == {1.0}


# --- figures ---------------------------------------------------------------------------------


@pytest.mark.parametrize("table", [STANDING, SEATED])
@pytest.mark.parametrize("wheelchair", [False, True])
def test_a_child_is_drawn_lower_than_a_teenager_and_that_one_lower_than_an_adult(
    setups, table, wheelchair
):
    tops = [
        top_of_head(*dressed_for(looking(setups, age, wheelchair, table)), guest=4)
        for age in range(3)
    ]
    assert tops[0] < tops[1] - 0.1
    assert tops[1] < tops[2] - 0.05


@pytest.mark.parametrize(("age", "tall"), [(0, 1.16), (1, 1.52), (2, 1.70), (3, 1.70)])
def test_who_stands_is_as_tall_as_people_are(setups, age, tall):
    assert top_of_head(*dressed_for(looking(setups, age)), guest=4) == pytest.approx(tall, abs=0.06)


@pytest.mark.parametrize("age", range(5), ids=AGES)
def test_feet_stand_on_the_floor(setups, age):
    model, data = dressed_for(looking(setups, age))
    shoe = part(model, 2, "shoe_left")
    assert data.geom_xpos[shoe, 2] - model.geom_size[shoe, 2] == pytest.approx(0.0, abs=0.01)


def test_an_elder_is_grey_and_stoops(setups):
    old, at_old = dressed_for(looking(setups, age=4))
    adult, at_adult = dressed_for(looking(setups, age=2))
    assert old.geom_rgba[part(old, 3, "hair"), :3].min() > 0.8
    assert adult.geom_rgba[part(adult, 3, "hair"), :3].max() < 0.3
    neck_old, neck = (at.geom_xpos[part(old, 3, "head"), 0] for at in (at_old, at_adult))
    assert neck_old > neck + 0.1


@pytest.mark.parametrize("age", range(5), ids=AGES)
@pytest.mark.parametrize("wheelchair", [False, True])
@pytest.mark.parametrize("table", [STANDING, SEATED])
def test_the_one_who_asks_and_nobody_else_raises_an_arm(setups, age, wheelchair, table):
    model, data = dressed_for(looking(setups, age, wheelchair, table))
    above = [
        max(data.geom_xpos[part(model, guest, f"hand_{side}"), 2] for side in ("left", "right"))
        > top_of_head(model, data, guest)
        for guest in range(floor_plan.N_GUESTS)
    ]
    assert above == [guest == scene.PERSON for guest in range(floor_plan.N_GUESTS)]


@pytest.mark.parametrize("age", range(5), ids=AGES)
@pytest.mark.parametrize("table", [STANDING, SEATED])
def test_wheelchair_chair_and_cane_are_drawn_for_those_who_use_them(setups, age, table):
    on_foot, _ = dressed_for(looking(setups, age, False, table))
    wheels, _ = dressed_for(looking(setups, age, True, table))
    for guest in (scene.PERSON, 11):
        assert [seen(wheels, guest, prop) for prop in ("wheels", "chair", "cane")] == [1, 0, 0]
        assert [seen(on_foot, guest, prop) for prop in ("wheels", "chair", "cane")] == [
            False,
            table == SEATED,
            table == STANDING and AGES[age] == "Elder",
        ]


def test_skin_types_are_told_apart_from_light_to_dark(setups):
    light = []
    for skin in range(6):
        model, _ = dressed_for(looking(setups, skin=skin))
        faces = model.geom_rgba[[part(model, guest, "head") for guest in range(12)], :3]
        hands = model.geom_rgba[[part(model, guest, "hand_left") for guest in range(12)], :3]
        assert np.array_equal(faces, hands)
        assert (faces == faces[0]).all()
        light.append(faces[0] @ [0.2126, 0.7152, 0.0722])
    assert (np.diff(light) < -0.05).all()


def test_race_and_gender_are_not_drawn_and_clothes_say_nothing(setups):
    plain, _ = dressed_for(looking(setups))
    for race, gender in ((5, 0), (0, 2), (3, 1)):
        other, _ = dressed_for(looking(setups, race=race, gender=gender))
        for field in ("geom_size", "geom_pos", "geom_quat", "geom_rgba"):
            assert np.array_equal(getattr(plain, field), getattr(other, field))
    other, _ = dressed_for(looking(setups, age=4, wheelchair=True, skin=5))
    for name in ("torso", "thigh_left", "shoe_left"):
        for guest in range(floor_plan.N_GUESTS):
            g = part(plain, guest, name)
            assert np.array_equal(plain.geom_rgba[g], other.geom_rgba[g])


def test_the_robot_looks_where_it_heads():
    model = dressing.model()
    data = mujoco.MjData(model)
    data.qpos[:] = [1.0, -2.0, np.pi / 2]
    mujoco.mj_kinematics(model, data)
    for name in ("eye_left", "eye_right", "tray"):
        x, y, _ = data.geom_xpos[model.geom(f"look_robot_{name}").id]
        assert y > -2.0 + 0.1
        assert abs(x - 1.0) < 0.1


# --- looks change nothing --------------------------------------------------------------------


def test_lean_and_dressed_models_have_the_same_state():
    lean, dressed = scene.model(), dressing.model()
    for count in ("nq", "nv", "nu", "na", "nbody", "njnt", "nmocap", "nsensor", "nsensordata"):
        assert getattr(lean, count) == getattr(dressed, count)
    for kind, n in (("body", lean.nbody), ("joint", lean.njnt), ("actuator", lean.nu)):
        assert [getattr(lean, kind)(i).name for i in range(n)] == [
            getattr(dressed, kind)(i).name for i in range(n)
        ]
    for field in ("body_mass", "body_inertia", "body_ipos", "body_mocapid", "sensor_adr"):
        assert np.array_equal(getattr(lean, field), getattr(dressed, field))
    every = mujoco.mjtState.mjSTATE_INTEGRATION
    assert mujoco.mj_stateSize(lean, every) == mujoco.mj_stateSize(dressed, every)


def test_a_state_of_the_lean_model_goes_on_alike_in_the_dressed_one(setups):
    every = mujoco.mjtState.mjSTATE_INTEGRATION
    lean = scene.model()
    dressed, shown = dressed_for(setups)
    data = mujoco.MjData(lean)
    # a guest in the way of the robot: contact must be alike too
    data.mocap_pos[:, :2] = setups.position[0]
    data.mocap_pos[1, :2] = [0.8, 0.05]
    data.ctrl[:] = [1.0, 0.0, 0.7]
    for _ in range(20):
        mujoco.mj_step(lean, data)
    state = np.empty(mujoco.mj_stateSize(lean, every))
    mujoco.mj_getState(lean, data, state, every)
    mujoco.mj_setState(dressed, shown, state, every)
    touched = 0
    for _ in range(40):
        mujoco.mj_step(lean, data)
        mujoco.mj_step(dressed, shown)
        touched += data.ncon
        assert np.array_equal(data.qpos, shown.qpos)
        assert np.array_equal(data.qvel, shown.qvel)
        assert np.array_equal(data.sensordata, shown.sensordata)
        assert data.ncon == shown.ncon
    assert touched > 0


def test_looks_are_named_and_touch_nothing_and_footprints_are_hidden():
    lean, dressed = scene.model(), dressing.model()
    footprints = {lean.geom(g).name for g in range(lean.ngeom)}
    for g in range(dressed.ngeom):
        name = dressed.geom(g).name
        assert name
        if name in footprints:
            assert dressed.geom_group[g] == 3
        else:
            assert dressed.geom_contype[g] == dressed.geom_conaffinity[g] == 0
            assert dressed.geom_group[g] in (1, INDOORS)
    shown = mujoco.MjvOption()
    assert not shown.geomgroup[3]
