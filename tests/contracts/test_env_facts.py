"""The facts that an environment tells of a finished service are true, and its reward follows."""

from typing import Any

import numpy as np
import pytest

from evenhand.methods.services import FACTS, Services
from evenhand.restaurant.env import RestaurantEnv


def by_hand(facts: dict[str, Any]) -> float:
    """The reward as the environment's documentation says it, from the facts alone."""
    reward = -0.5 if facts["min_distance"] < 0.5 else 0.0
    if facts["responded"]:
        reward += 0.2
        d, t = facts["response_distance"], facts["response_step"]
        if 1.0 <= d <= 1.5:
            reward += 0.5
        elif 0.5 < d < 1.0:
            reward += 0.5 * (d - 0.5) / 0.5
        elif 1.5 < d < 3.0:
            reward += 0.5 * (3.0 - d) / 1.5
        reward += 0.3 if t <= 200 else 0.3 * (300 - t) / 100
    return reward


class TestFacts:
    """One physics step a decision, so that every step can be watched from outside."""

    @pytest.fixture(scope="class")
    @staticmethod
    def services() -> list[tuple[dict[str, Any], dict[str, Any]]]:
        """(facts, what was seen from outside) of services that end in all sorts of ways."""
        env = RestaurantEnv(interval=1, noise=0.05, dropout=0.1)
        out = []
        for service, end in enumerate([0, 3, 90, 160, 201, 240, 299, None, None]):
            observation, _ = env.reset(seed=100 + service)
            world = env._lanes.physics

            setups, row = env._source.current(0)
            person = setups.position[row, 0]
            places = [world.state[0, :2].copy()]
            ended, step, reward, info = False, 0, 0.0, {}
            while not ended:
                responds = step == end
                observation, reward, ended, _, info = env.step(int(responds))
                if not responds:
                    step += 1
                    places.append(world.state[0, :2].copy())
                assert ended or reward == 0.0
            legs = np.diff(np.array(places), axis=0)
            out.append(
                (
                    info["facts"],
                    {
                        "steps": step,
                        "responded": end is not None,
                        "distances": np.hypot(*(np.array(places) - person).T),
                        "path": float(np.hypot(legs[:, 0], legs[:, 1]).sum()),
                        "sensed": float(observation[22]) * 5.0,
                        "reward": reward,
                    },
                )
            )
        return out

    def test_all_facts_are_told(self, services):
        for facts, _ in services:
            assert set(facts) == {
                *(set(FACTS) - {"epoch", "service", "scenario", "robot"}),
                "perfect",
                *(f"reward_{name}" for name in ("response", "distance", "promptness", "safety")),
            }
            for name, value in facts.items():
                yes_or_no, whole = ("responded", "perfect"), ("steps", "contact_steps")
                assert type(value) is (
                    bool if name in yes_or_no else int if name in whole else float
                ), name

    def test_they_are_true(self, services):
        for facts, seen in services:
            distances = seen["distances"]
            assert facts["steps"] == seen["steps"]
            assert facts["responded"] is seen["responded"]
            assert facts["start_distance"] == pytest.approx(distances[0], abs=1e-9)
            assert facts["min_distance"] == pytest.approx(distances.min(), abs=1e-9)
            assert facts["path_length"] == pytest.approx(seen["path"], abs=1e-9)
            error = seen["sensed"] - distances[-1]
            assert facts["sensed_error"] == pytest.approx(error, abs=1e-5)  # seen as float32
            if seen["responded"]:
                assert facts["response_step"] == seen["steps"]
                assert facts["response_distance"] == pytest.approx(distances[-1], abs=1e-9)
            else:
                assert facts["steps"] == 300
                assert np.isnan(facts["response_step"])
                assert np.isnan(facts["response_distance"])

    def test_the_reward_follows_from_them(self, services):
        rewards = []
        for facts, seen in services:
            assert seen["reward"] == pytest.approx(by_hand(facts), abs=1e-9)
            terms = [value for name, value in facts.items() if name.startswith("reward_")]
            assert seen["reward"] == pytest.approx(sum(terms), abs=1e-9)
            assert facts["perfect"] is (seen["reward"] == pytest.approx(1.0))
            rewards.append(seen["reward"])
        assert min(rewards) == -0.5  # walked up to the person and never responded
        assert len({round(reward, 6) for reward in rewards}) > 4

    def test_they_make_interactions(self, services):
        named = [{k: v for k, v in facts.items() if k in FACTS} for facts, _ in services]
        table = Services.build({}, {name: [one[name] for one in named] for name in named[0]})
        ended = [seen["responded"] for _, seen in services]
        assert np.isnan(table.fact("response_step")).tolist() == [not one for one in ended]
        assert table.to_arrow()["response_step"].null_count == ended.count(False)
