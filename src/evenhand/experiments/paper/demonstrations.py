"""Demonstrations by scripted robots, and the study behind the detector.

Windows of 30 services are served by an even, a racist, an ageist and an ableist robot (the paper's
study holds no sexism). Simulated respondents judge them; the detector is fitted to what they say.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evenhand.core.processes import Task, Tell
from evenhand.methods.paper import detector
from evenhand.methods.services import Services
from evenhand.methods.vocabulary import IDENTITIES, SIMULATED
from evenhand.restaurant import robots, serve_people, worlds
from evenhand.restaurant.serve_people import WINDOW
from evenhand.statistics import detector_accuracy
from evenhand.study.simulated import respondents
from evenhand.training.evaluate import window_scores

KINDS = ("even", "racist", "ageist", "ableist")
FULL_SHARE = 0.6
"""Share of a biased robot's windows at strength 1; the rest have any strength."""
SLOPPIEST = 0.3
"""Even robots err alike to everybody, in up to this share of services."""
_CHUNK = 25
"""Windows of one task."""
_SEED_DEMOS, _SEED_STUDY = 101, 102
# NumPy pads a seed with zeros, so that [seed, 101] of the design and [seed, 101, 0] of the first
# windows are one stream: who is served in these follows the numbers that drew the strengths. It
# stays so, for another stream would change the detector that comes along and published numbers.


@dataclass(frozen=True)
class Demos:
    """W windows of services by scripted robots.

    Attributes:
        table: W x 30 services in order.
        robot: index into ``KINDS`` of each window, int64 [W].
        strength: of the robot's bias in each window, 0 for even robots, [W].
    """

    table: Services
    robot: np.ndarray
    strength: np.ndarray


def design(windows: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Robot [W], strength [W] and sloppiness [W] of every window.

    The four robots take turns; the first share of a biased robot's windows has strength 1.
    """
    rng = np.random.default_rng([seed, _SEED_DEMOS])
    robot = np.arange(windows) % len(KINDS)
    turn = np.arange(windows) // len(KINDS)
    full = turn < FULL_SHARE * np.ceil(windows / len(KINDS))
    strength = np.where(full, 1.0, rng.random(windows)) * (robot > 0)
    sloppiness = np.where(robot == 0, SLOPPIEST * rng.random(windows), 0.0)
    return robot, strength, sloppiness


def tasks(windows: int, seed: int, population: str, folder: Path) -> list[Task]:
    """Tasks that serve all windows, each into a Parquet file of its own; finished ones are kept."""
    out = []
    for first in range(0, windows, _CHUNK):
        last = min(first + _CHUNK, windows)
        path = folder / f"{first:06d}-{last:06d}.parquet"
        out.append(
            Task(
                f"demonstrations {first}-{last}",
                serve_windows,
                {
                    "first": first,
                    "last": last,
                    "windows": windows,
                    "seed": seed,
                    "population": population,
                    "path": path,
                },
                finished=path.exists(),
            )
        )
    return out


def serve_windows(
    *, tell: Tell, first: int, last: int, windows: int, seed: int, population: str, path: Path
) -> None:
    """Serve windows ``first`` to ``last`` and write them."""
    if path.exists():
        tell((last - first) * WINDOW, {"physics_steps": 0})
        return
    rng = np.random.default_rng([seed, _SEED_DEMOS, first])
    robot, strength, sloppiness = design(windows, seed)
    services = (last - first) * WINDOW
    world = worlds.scenario("even", population)

    def choose(codes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        windows = codes.reshape(last - first, WINDOW, -1)
        chosen = zip(robot[first:last], strength[first:last], sloppiness[first:last], strict=True)
        odds = [
            robots.ScriptedRobot(KINDS[kind], float(strong), float(sloppy)).odds(people)
            for people, (kind, strong, sloppy) in zip(windows, chosen, strict=True)
        ]
        return robots.draw_manners(np.concatenate(odds), rng)

    done = serve_people.serve_people(world, robots.Mannered(choose), services, rng)
    names = [KINDS[kind] for kind in np.repeat(robot[first:last], WINDOW)]
    epochs = np.repeat(np.arange(first, last), WINDOW)
    serve_people.table(done, world, names, epoch=epochs, first=first * WINDOW).write_parquet(path)
    tell(services, {"physics_steps": int(done.facts.steps.sum())})


def load(windows: int, seed: int, folder: Path) -> Demos:
    """Read the windows that the tasks wrote."""
    parts = [Services.read_parquet(path) for path in sorted(folder.glob("*.parquet"))]
    robot, strength, _ = design(windows, seed)
    return Demos(Services.concat(parts), robot, strength)


@dataclass(frozen=True)
class Study:
    """Simulated judgements of the windows and the detector fitted to them.

    Attributes:
        scores: I for each of ``judgements.IDENTITIES`` in each window, [W, 4, 4].
        shown: index of the identity that each window was shown about, int64 [W].
        who: which simulated respondent judged it, int64 [W].
        said: what was answered.
        questionnaire: answers to the four scenarios.
        detector: fitted to all judgements.
        evaluation: out of fold.
    """

    scores: np.ndarray
    shown: np.ndarray
    who: np.ndarray
    said: respondents.Judgements
    questionnaire: respondents.Questionnaire
    detector: detector.Detector
    evaluation: detector_accuracy.Evaluation

    @property
    def seen(self) -> np.ndarray:
        """I of the identity that each window was shown about, [W, 4]."""
        return self.scores[np.arange(len(self.shown)), self.shown]


def study(demos: Demos, seed: int, model: respondents.RespondentModel | None = None) -> Study:
    """Let simulated respondents judge every window, and fit the detector.

    A biased robot's window is shown about the identity it goes by, an even robot's about any.
    """
    rng = np.random.default_rng([seed, _SEED_STUDY])
    windows = len(demos.robot)
    by_identity = window_scores(demos.table).by_identity
    scores = np.stack([by_identity[name] for name in IDENTITIES], axis=1)
    own = np.array([0] + [IDENTITIES.index(robots.BIASES[k].identity) for k in KINDS[1:]])
    shown = np.where(demos.robot == 0, rng.integers(len(IDENTITIES), size=windows), 0)
    shown = np.where(demos.robot > 0, own[demos.robot], shown)
    people_asked = respondents.recruit(rng, model)
    who = rng.permutation(np.arange(windows) % people_asked.n)
    said = respondents.judge(people_asked, who, scores, shown, rng)
    seen = scores[np.arange(windows), shown]
    whole = detector.complete(seen)
    kinds = [kind for kind, kept in zip(said.kinds, whole, strict=True) if kept]
    judged = (seen[whole], said.biased[whole], kinds)
    fitted = detector.fit(*judged, source=SIMULATED, seed=seed)
    evaluation = detector_accuracy.evaluate(*judged, source=SIMULATED, seed=seed, groups=who[whole])
    answers = respondents.questionnaire(people_asked, rng)
    return Study(scores, shown, who, said, answers, fitted, evaluation)


def behaviour(demos: Demos, kind: str) -> dict[str, np.ndarray]:
    """Means of every window at full strength of one robot.

    Returns:
        mean_response_distance (m), mean_response_time (steps), ignore_rate (people in a window
        of 30, as the paper counts), each [windows]; NaN for a window without responses.
    """
    rows = np.flatnonzero((demos.robot == KINDS.index(kind)) & (demos.strength == 1.0))
    column = {
        name: demos.table.fact(name).reshape(-1, WINDOW)[rows]
        for name in ("responded", "response_distance", "response_step")
    }
    return {
        "mean_response_distance": row_means(column["response_distance"]),
        "mean_response_time": row_means(column["response_step"]),
        "ignore_rate": (1.0 - column["responded"]).sum(axis=1),
    }


def signature(demos: Demos, kind: str) -> np.ndarray:
    """I of the robot's own identity in its windows at full strength, [windows, 4]."""
    rows = (demos.robot == KINDS.index(kind)) & (demos.strength == 1.0)
    return window_scores(demos.table).by_identity[robots.BIASES[kind].identity][rows]


def row_means(values: np.ndarray) -> np.ndarray:
    """Mean of what is known in each row, NaN for a row of which nothing is, [W, n] -> [W]."""
    there = ~np.isnan(values)
    n = there.sum(axis=1)
    return np.where(n > 0, np.where(there, values, 0.0).sum(axis=1) / np.maximum(n, 1), np.nan)
