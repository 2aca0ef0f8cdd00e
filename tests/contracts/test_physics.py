"""The physics: a plain loop of MuJoCo is the oracle, and nobody stands where nobody can."""

import copy

import mujoco
import numpy as np
import pytest
from scipy import stats

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.simulation import layout, scene
from evenhand.restaurant.simulation.physics import Physics, simulation_of
from support.setups import bumping, crowded, drawn

LEAN = scene.model()
KINDS = {
    "body": (mujoco.mjtObj.mjOBJ_BODY, "nbody"),
    "joint": (mujoco.mjtObj.mjOBJ_JOINT, "njnt"),
    "actuator": (mujoco.mjtObj.mjOBJ_ACTUATOR, "nu"),
    "sensor": (mujoco.mjtObj.mjOBJ_SENSOR, "nsensor"),
    "geom": (mujoco.mjtObj.mjOBJ_GEOM, "ngeom"),
    "site": (mujoco.mjtObj.mjOBJ_SITE, "nsite"),
    "camera": (mujoco.mjtObj.mjOBJ_CAMERA, "ncam"),
}


def names(model: mujoco.MjModel, kind: str) -> list[str | None]:
    code, size = KINDS[kind]
    return [mujoco.mj_id2name(model, code, i) for i in range(getattr(model, size))]


class Plain:
    """One simulation as MuJoCo's own documentation would step it."""

    def __init__(self, setups: layout.Setups, row: int) -> None:
        self.model = copy.copy(LEAN)
        for i in range(floor_plan.N_GUESTS):
            self.model.geom(f"guest{i}_footprint").size[0] = setups.radius[row, i]
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = (*setups.start[row], setups.heading[row])
        for i in range(floor_plan.N_GUESTS):
            half = setups.facing[row, i] / 2
            self.data.mocap_pos[i] = (*setups.position[row, i], 0.30)
            self.data.mocap_quat[i] = (np.cos(half), 0, 0, np.sin(half))
        self.person = setups.position[row, 0]
        self.least = self.far()
        self.path, self.touched, self.steps = 0.0, 0, 0

    def far(self) -> float:
        return float(np.hypot(*(self.person - self.data.qpos[:2])))

    def step(self, command: np.ndarray, steps: int) -> None:
        self.data.ctrl[:] = command
        for _ in range(steps):
            before = self.data.qpos[:2].copy()
            mujoco.mj_step(self.model, self.data)
            self.path += float(np.hypot(*(self.data.qpos[:2] - before)))
            self.least = min(self.least, self.far())
            self.touched += self.data.ncon > 0
            self.steps += 1


class TestPlainLoop:
    @pytest.mark.parametrize(("steps", "threads"), [(1, 1), (5, 1), (5, 3)])
    def test_bit_by_bit_to_the_end_of_every_service(self, steps, threads):
        setups = bumping(7, seed=3)
        world = Physics(4, threads)
        assert world._batch.nthread == threads
        fields = {name: world._batch.bind(name) for name in ("qpos", "qvel", "ncon")}
        fields["sensordata"] = world._batch.bind("sensordata")[:, : LEAN.nsensordata]
        rows = world.prepare(setups)

        def place(ids: list[int], services: list[int]) -> None:
            world.place(np.array(ids), rows, np.array(services))
            for sim, service in zip(ids, services, strict=True):
                plain[sim] = Plain(setups, service)

        def drive(ids: list[int] | None, until: int) -> None:
            for _ in range(until // steps):
                world.walk(None if ids is None else np.array(ids), steps)
                for sim in plain if ids is None else ids:
                    one = plain[sim]
                    one.step(world.command[sim], steps)
                    for name, values in fields.items():
                        np.testing.assert_array_equal(values[sim], getattr(one.data, name), name)
                    assert world.truth["steps"][sim] == one.steps
                    assert world.truth["distance"][sim] == pytest.approx(one.far(), abs=1e-12)
                    assert world.truth["min_distance"][sim] == pytest.approx(one.least, abs=1e-12)
                    assert world.truth["path_length"][sim] == pytest.approx(one.path, abs=1e-12)
                    assert world.truth["contact_steps"][sim] == one.touched

        plain: dict[int, Plain] = {}
        place([0, 1, 2, 3], [0, 1, 2, 3])
        drive(None, 100)
        assert world.truth["contact_steps"][0] > 0  # the oracle has seen contact, too
        place([1, 3], [6, 4])  # in another order, while the others go on
        drive([0, 2, 3], 200)
        place([2], [5])
        drive(None, 300)

    def test_pushes_by_several_at_once(self):
        # the order of contacts counts, too
        setups = crowded(300, seed=4)
        world = Physics(len(setups))
        world.place(np.arange(len(setups)), world.prepare(setups), np.arange(len(setups)))
        plain = [Plain(setups, row) for row in range(len(setups))]
        at_once = set()
        for _ in range(40):
            world.walk(None, 5)
            for row, one in enumerate(plain):
                one.step(world.command[row], 5)
                at_once.add(one.data.ncon)
        for row, one in enumerate(plain):
            np.testing.assert_array_equal(world.state[row], one.data.qpos)
            assert world.truth["contact_steps"][row] == one.touched
        assert {0, 1, 2} <= at_once

    def test_what_a_simulation_did_before_leaves_no_trace(self):
        setups = bumping(2, seed=5)
        fresh, used = Physics(1), Physics(1)
        first, second = setups[:1], setups[1:]
        used.place(np.array([0]), used.prepare(first), np.array([0]))
        used.walk(None, 150)
        for world in (fresh, used):
            world.place(np.array([0]), world.prepare(second), np.array([0]))
            world.walk(None, 300)
        np.testing.assert_array_equal(used.state, fresh.state)
        np.testing.assert_array_equal(used._batch.bind("qvel"), fresh._batch.bind("qvel"))
        np.testing.assert_array_equal(used.truth, fresh.truth)

    def test_a_simulation_of_its_own_is_the_plain_one(self):
        setups = drawn(3, seed=6)
        plain = Plain(setups, 1)
        model, data = simulation_of(setups, 1)
        for field in ("qpos", "qvel", "mocap_pos"):
            np.testing.assert_array_equal(getattr(data, field), getattr(plain.data, field), field)
        np.testing.assert_allclose(data.mocap_quat, plain.data.mocap_quat, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(model.geom_size, plain.model.geom_size)
        assert not np.array_equal(LEAN.geom_size, model.geom_size)  # the shared one is as it was


DRIVEN = 200


@pytest.fixture(scope="module")
def driven():
    """Speeds, commands and facts of robots that walk for 300 steps and never respond."""
    setups = drawn(DRIVEN, seed=11)
    world = Physics(DRIVEN)
    velocity = world._batch.bind("qvel")
    world.place(np.arange(DRIVEN), world.prepare(setups), np.arange(DRIVEN))
    speeds, commands = [velocity.copy()], []
    distances = [world.truth["distance"].copy()]
    seen, clock = [], []
    for _ in range(300):
        world.walk(None, 1)
        speeds.append(velocity.copy())
        commands.append(world.command.copy())
        distances.append(world.truth["distance"].copy())
        seen.append(np.hypot(*world.sensed.T))
        clock.append(world.clock.copy())
    return (
        setups,
        world,
        *(np.array(x) for x in (speeds, commands, distances, seen, clock)),
    )


class TestDriving:
    def test_commands_keep_to_the_top_speed(self, driven):
        _, _, _, commands, *_ = driven
        speed = np.hypot(commands[..., 0], commands[..., 1])
        assert speed.max() == pytest.approx(1.0)  # and it is used
        assert np.abs(commands[..., 2]).max() <= 3.0

    def test_the_robot_keeps_to_the_top_speed(self, driven):
        speeds = driven[2]
        assert np.abs(speeds[..., :2]).max() <= 1.0 + 1e-9
        # Each axis has a servo of its own. While the robot turns, one may be done before the
        # other: from 45° to 0° the speed is at most |(1, √2 - 1)|.
        assert np.hypot(speeds[..., 0], speeds[..., 1]).max() <= np.sqrt(4 - 2 * np.sqrt(2))

    def test_acceleration_and_braking_are_those_of_a_limited_force(self, driven):
        change = np.abs(np.diff(driven[2], axis=0)).max(axis=(0, 1)) / 0.02
        assert change[:2] == pytest.approx([2.5, 2.5])  # reached, and never more
        assert change[2] <= 12.0 + 1e-6
        force = LEAN.actuator("drive_x").forcerange
        assert force.tolist() == [-100.0, 100.0]  # 40 kg · 2.5 m/s²

    def test_it_sets_off_with_the_greatest_acceleration(self, driven):
        speeds = driven[2]
        # after 0.1 s at 2.5 m/s² along one axis at least
        assert (np.abs(speeds[5, :, :2]).max(axis=1) > 0.15).all()

    def test_the_sensor_says_the_truth_of_one_step_before(self, driven):
        _, _, _, _, distances, seen, _ = driven
        np.testing.assert_allclose(seen, distances[:-1], rtol=0, atol=1e-12)

    def test_the_clock_counts_the_seconds_until_one_step_before(self, driven):
        steps = np.repeat(np.arange(300)[:, None], DRIVEN, axis=1)
        np.testing.assert_allclose(driven[6], steps * 0.02, rtol=0, atol=1e-9)

    def test_it_arrives_and_stops_before_the_person_without_a_push(self, driven):
        setups, world, speeds, *_ = driven
        gap = world.truth["distance"] - setups.radius[:, 0] - floor_plan.ROBOT_RADIUS
        assert gap == pytest.approx(np.full(DRIVEN, 0.02), abs=1e-3)
        assert world.truth["contact_steps"].sum() == 0
        assert np.hypot(speeds[-1, :, 0], speeds[-1, :, 1]).max() < 1e-3

    def test_it_drives_no_shorter_way_than_the_straight_one(self, driven):
        setups, world, *_ = driven
        straight = setups.start_distance - world.truth["distance"]
        assert (world.truth["path_length"] >= straight - 1e-9).all()
        assert (world.truth["path_length"] > straight + 0.1).any()  # someone was driven around

    def test_the_least_distance_is_the_least_of_all_steps(self, driven):
        _, world, _, _, distances, *_ = driven
        np.testing.assert_allclose(
            world.truth["min_distance"], distances.min(axis=0), rtol=0, atol=1e-12
        )


class TestScene:
    @pytest.mark.parametrize("dressed", [False, True])
    @pytest.mark.parametrize("kind", KINDS)
    def test_everything_has_a_name_of_its_own(self, kind, dressed):
        given = names((dressing.model() if dressed else scene.model()), kind)
        assert None not in given
        assert len(set(given)) == len(given)

    def test_the_lean_model_holds_what_it_should(self):
        assert names(LEAN, "body") == ["world", "robot", *(f"guest{i}" for i in range(12))]
        assert names(LEAN, "joint") == ["robot_x", "robot_y", "robot_yaw"]
        assert names(LEAN, "actuator") == ["drive_x", "drive_y", "drive_yaw"]
        assert names(LEAN, "sensor") == ["person_position", "timer"]
        assert names(LEAN, "site") == ["robot_sensor"]
        # 4 walls, 8 tables, 16 chairs, the robot, 12 guests
        assert LEAN.ngeom == 4 + 8 + 16 + 1 + 12
        assert LEAN.opt.timestep == 0.02

    def test_the_still_model_has_the_same_footprints(self):
        still = scene.still_model()
        assert names(still, "body") == ["world", "robot"]
        for kind in ("joint", "actuator", "site"):
            assert names(still, kind) == names(LEAN, kind)
        assert names(still, "sensor") == [*names(LEAN, "sensor"), "contacts"]
        assert {*names(still, "geom")} == {*names(LEAN, "geom")}
        ours, theirs = (mujoco.MjData(model) for model in (still, LEAN))
        for model, data in ((still, ours), (LEAN, theirs)):
            mujoco.mj_forward(model, data)
        for name in names(LEAN, "geom"):
            a, b = still.geom(name), LEAN.geom(name)
            assert a.type == b.type
            for field in ("size", "condim", "solref", "solimp", "friction", "margin", "gap"):
                np.testing.assert_array_equal(getattr(a, field), getattr(b, field), field)
            np.testing.assert_array_equal(ours.geom(name).xpos, theirs.geom(name).xpos)

    def test_the_dressed_model_has_the_same_state(self):
        dressed = dressing.model()
        for size in ("nq", "nv", "nu", "na", "nmocap", "nsensor", "nsensordata", "nbody", "njnt"):
            assert getattr(dressed, size) == getattr(LEAN, size), size
        for kind in ("body", "joint", "actuator", "sensor"):
            assert names(dressed, kind) == names(LEAN, kind)
        assert dressed.ngeom > LEAN.ngeom
        assert dressed.ncam > 0

    def test_the_dressed_model_moves_alike(self):
        setups = bumping(2, seed=8)
        dressed = copy.copy(dressing.model())
        for row in range(2):
            plain = Plain(setups, row)
            data = mujoco.MjData(dressed)
            data.qpos[:] = plain.data.qpos
            data.mocap_pos[:] = plain.data.mocap_pos
            for i in range(floor_plan.N_GUESTS):
                dressed.geom(f"guest{i}_footprint").size[0] = setups.radius[row, i]
            for step in range(150):
                command = np.array([np.cos(step / 30), np.sin(step / 30), 0.5])
                plain.step(command, 1)
                data.ctrl[:] = command
                mujoco.mj_step(dressed, data)
                assert data.ncon == plain.data.ncon
            np.testing.assert_allclose(data.qpos, plain.data.qpos, rtol=0, atol=1e-9)
            assert row == 1 or plain.touched > 0

    def test_robot_touches_everything_but_nothing_else_touches(self):
        robot = LEAN.geom("robot_base")
        for name in names(LEAN, "geom"):
            other = LEAN.geom(name)
            if name == "robot_base":
                assert (other.contype, other.conaffinity) == (1, 0)
            else:
                assert (other.contype, other.conaffinity) == (0, 1)
            if name != "robot_base" and not str(name).startswith("wall"):
                # discs: all centres at the height of the robot's own
                data = mujoco.MjData(LEAN)
                mujoco.mj_forward(LEAN, data)
                assert data.geom(name).xpos[2] == pytest.approx(0.30)
        assert robot.size[0] == floor_plan.ROBOT_RADIUS

    def test_the_robot_weighs_what_the_plan_says(self):
        assert LEAN.body("robot").mass == pytest.approx(40.0)


def gaps(a: np.ndarray, b: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Air between discs: [n, i, 2] and [n, j, 2] with summed radii [n, i, j]."""
    apart = a[:, :, None] - b[:, None]
    return np.hypot(apart[..., 0], apart[..., 1]) - reach


@pytest.mark.parametrize("population", list(people.POPULATIONS))
class TestSetups:
    N = 2000

    @pytest.fixture
    def setups(self, population) -> layout.Setups:
        return drawn(self.N, 21, population)

    def test_guests_do_not_overlap(self, setups):
        air = gaps(
            setups.position, setups.position, setups.radius[:, :, None] + setups.radius[:, None]
        )
        assert air[:, ~np.eye(12, dtype=bool)].min() > 0.0

    def test_guests_do_not_stand_in_furniture_or_walls(self, setups):
        furniture = np.concatenate([floor_plan.TABLES, floor_plan.CHAIRS])
        radius = np.concatenate([np.full(8, 0.40), np.full(16, 0.20)])
        air = gaps(setups.position, furniture[None], setups.radius[:, :, None] + radius)
        assert air.min() > 0.0
        assert (np.abs(setups.position) + setups.radius[..., None] < (7.0, 4.3)).all()

    def test_the_robot_starts_free(self, setups):
        start = setups.start[:, None]
        furniture = np.concatenate([floor_plan.TABLES, floor_plan.CHAIRS])
        radius = np.concatenate([np.full(8, 0.40), np.full(16, 0.20)])
        assert gaps(start, furniture[None], radius[None, None] + 0.20).min() > 0.0
        assert gaps(start, setups.position, setups.radius[:, None] + 0.20).min() > 0.0
        assert (np.abs(setups.start) + 0.20 < (7.0, 4.3)).all()

    def test_the_robot_starts_at_a_walk_from_the_person(self, setups):
        distance = np.hypot(*(setups.position[:, 0] - setups.start).T)
        np.testing.assert_allclose(setups.start_distance, distance, rtol=1e-12)
        assert distance.min() >= 2.0
        assert distance.max() <= 4.5
        assert distance.min() < 2.1  # near and far both occur
        assert distance.max() > 4.2

    def test_who_asks_may_sit_or_stand_anywhere(self, setups):
        seated = (setups.table[:, 0] >= 0).mean()
        assert 0.3 < seated < 0.8
        assert set(setups.table[:, 0].tolist()) == {-1, *range(8)}

    def test_guests_take_places_in_no_order(self, setups):
        # the guests who do not ask are all alike: none is seated more often than another
        seated = (setups.table[:, 1:] >= 0).sum(axis=0)
        table = np.stack([seated, self.N - seated])
        assert np.asarray(stats.chi2_contingency(table)[1]) > 1e-3

    def test_seats_are_at_their_tables(self, setups):
        seated = setups.table >= 0
        away = setups.position[seated] - floor_plan.TABLES[setups.table[seated]]
        np.testing.assert_allclose(np.hypot(*away.T), 0.72, atol=0.05)
        # and look at them
        looks = np.stack([np.cos(setups.facing[seated]), np.sin(setups.facing[seated])], axis=1)
        assert ((looks * away).sum(axis=1) < 0).all()

    def test_everybody_has_the_shape_of_their_identities(self, setups):
        age, disability = setups.people[..., 2], setups.people[..., 3]
        expected = np.select([disability == 0, age == 0, age == 4], [3, 0, 2], 1)
        np.testing.assert_array_equal(setups.shape, expected)
        np.testing.assert_array_equal(setups.radius, np.array([0.15, 0.20, 0.20, 0.26])[expected])

    def test_who_asks_is_drawn_like_everybody(self, setups, population):
        shares = np.array(people.population(population).marginal("race"))
        seen = np.bincount(setups.asking[:, 0], minlength=6) / self.N
        assert seen == pytest.approx(shares, abs=4 * np.sqrt(0.25 / self.N))
        np.testing.assert_array_equal(setups.one_hot, people.encode(setups.people[:, 0]))

    def test_same_seed_same_set_ups(self, setups, population):
        again = drawn(self.N, 21, population)
        for name, value in vars(setups).items():
            np.testing.assert_array_equal(getattr(again, name), value)


def test_one_set_up_can_be_drawn():
    setups = drawn(1, 0)
    assert len(setups) == 1
    assert np.isfinite(setups.start).all()


def test_rows_of_set_ups():
    setups = drawn(5, 1)
    picked = setups[np.array([4, 1])]
    np.testing.assert_array_equal(picked.start, setups.start[[4, 1]])
    assert len(setups[:3]) == 3
