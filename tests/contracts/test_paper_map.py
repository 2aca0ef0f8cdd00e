"""PAPER.md names only what exists, names all of the paper, and its arithmetic is right."""

import ast
import importlib
import re
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from evenhand.experiments.paper import calibrate, claims, reproduce, tables
from evenhand.experiments.paper.report import figures_biased
from evenhand.experiments.paper.report.figures import PLATES
from evenhand.methods import registry
from evenhand.methods.paper.scores import Counts, gaps, issue_score
from evenhand.restaurant import people
from evenhand.restaurant.simulation import layout
from evenhand.restaurant.simulation.physics import Physics
from evenhand.training.settings import PRESETS, TrainSettings, settings_of
from support import claimed

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "PAPER.md").read_text()
TESTS = sorted((ROOT / "tests").rglob("test_*.py"))

PLACES = sorted(set(re.findall(r"`([a-z_.]+:[\w.]*\w)(?: = ([^`]+))?`", PAGE)))
NAMED_TESTS = sorted(set(re.findall(r"`([\w/]+)::((?:Test\w+::)?test_\w+)`", PAGE)))
MEANINGS = ("faithful", "repaired", "chosen")

PRINTED = [
    *(f"Eq. {n}" for n in range(1, 9)),
    *(f"Definition {n}" for n in range(1, 5)),
    *(f"Fig. {n}" for n in range(1, 13)),
    # thresholds and settings
    "[1, 1.5] m", "200 steps", "0.5 m", "[1, 1, 1, 1]", "λ = 0.5", "T = 30", "threshold 0.5",
    "30 people", "40 epochs",
    # the study
    "24 volunteers", "1,000", "9,000", "35.7 %", "21.4 %",
    # results
    "98 %", "22 %", "54 → 39", "27.8 %", "1.89", "124.93", "4.36",
    "[0.49, 0.25, 0.38, 0.43]", "[0.42, 0.68, 0.54, 0.49]", "[0.05, 0.66, 0, 0]",
]  # fmt: skip


def found(place: str) -> object:
    """What ``module:name.name`` of the package stands for."""
    module, names = place.split(":")
    return reduce(getattr, names.split("."), importlib.import_module(f"evenhand.{module}"))


def names_in(path: Path) -> set[str]:
    """Names of the tests of a file; those of a class with and without its name."""
    found = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.ClassDef):
            within = [part.name for part in node.body if isinstance(part, ast.FunctionDef)]
            found |= {*within, *(f"{node.name}::{name}" for name in within)}
    return found


def defined(file: str, function: str) -> bool:
    """Whether a test file of this name, in whatever folder, holds this test."""
    wanted = Path(f"{file}.py").parts
    return any(function in names_in(path) for path in TESTS if path.parts[-len(wanted) :] == wanted)


def rows() -> list[tuple[str, ...]]:
    """Cells of every row of the tables that say how something is kept."""
    out, inside = [], False
    for line in PAGE.splitlines():
        cells = tuple(cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
        if cells and cells[-1] == "how":
            inside = True
        elif not cells:
            inside = False
        elif inside and set("".join(cells)) != {"-"}:
            out.append(cells)
    return out


@pytest.mark.parametrize(("place", "value"), PLACES)
def test_every_place_exists_and_holds_its_value(place, value):
    thing = found(place)
    if value:
        assert thing == ast.literal_eval(value)


@pytest.mark.parametrize(("file", "function"), NAMED_TESTS)
def test_every_test_exists(file, function):
    assert defined(file, function)


def test_the_search_notices_what_does_not_exist():
    assert defined("test_issues", "test_gaps_by_hand")
    assert defined("test_issues", "TestScores::test_gaps_by_hand")
    assert not defined("test_issues", "TestIndicators::test_gaps_by_hand")
    assert not defined("test_issues", "test_gaps_by")
    assert not defined("sues", "test_gaps_by_hand")
    with pytest.raises(AttributeError):
        found("methods.paper.issues:no_such_name")
    assert found("methods.paper.issues:Thresholds.late") == 200.0


def test_the_page_is_read():
    assert len(PLACES) > 100
    assert len(NAMED_TESTS) > 100
    assert len(rows()) > 80


@pytest.mark.parametrize("cells", rows(), ids=lambda cells: cells[0][:40])
def test_every_row_says_where_and_how(cells):
    *_, where, held, how = cells
    assert how in MEANINGS
    assert re.search(r"`[a-z_.]+:[\w.]+", where)
    assert held == "–" or re.fullmatch(r"(`[\w/]+::[\w:]+` ?)+", held)


@pytest.mark.parametrize("what", PRINTED)
def test_all_that_the_paper_prints_is_on_the_page(what):
    assert re.search(rf"{re.escape(what)}(?!\d)", PAGE)


@pytest.mark.parametrize("plate", PLATES, ids=lambda plate: plate.name)
def test_every_figure_of_the_report_is_on_the_page(plate):
    named = [cells for cells in rows() if f"`{plate.name}`" in cells[1]]
    assert len(named) == 1
    assert named[0][0].startswith(f"{plate.paper}:" if plate.paper else "not in the paper")


def test_every_claim_is_on_the_page():
    demos, study = claimed.made_demos(), claimed.made_study()
    given = [[*a, *b] for a, b in zip(*(claimed.learned(one) for one in PRESETS), strict=True)]
    ids = {one["id"] for one in claims.all_claims(demos, study, *given)}
    section = PAGE.partition("## The claims")[2].partition("## The figures")[0]
    named = set(re.findall(r"`([a-z_0-9]+)`", section)) - set(PRESETS) - {"_service"}
    assert {one.removesuffix("_service") for one in ids} == named


def test_the_numbers_to_compare_with_are_those_printed():
    assert calibrate.SIGNATURES == {
        "racist": (0.49, 0.25, 0.38, 0.43),
        "ageist": (0.42, 0.68, 0.54, 0.49),
        "ableist": (0.05, 0.66, 0.0, 0.0),
    }
    assert tables.PAPER_SHARES == {(1, "race"): 0.357, (4, "disability"): 0.214}
    assert tables.PAPER_BEHAVIOUR == {
        ("ableist", "mean_response_distance"): 1.89,
        ("ageist", "mean_response_time"): 124.93,
        ("racist", "ignore_rate"): 4.36,
    }
    assert figures_biased.PAPER_BIASED == {"ppo": 54, "ppo+guidance": 39}
    assert figures_biased.PAPER_EPOCHS * TrainSettings.people == 9000
    assert round(100 * claims.FEWER_EPOCHS, 1) == 27.8
    assert claims.FEWER_EPOCHS == (54 - 39) / 54


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(("arm", "choice"), list(reproduce.ARMS.items()))
def test_an_arm_is_an_algorithm_with_or_without_eq_5(arm, choice, preset):
    algorithm, kind = choice
    names = {"score@1": "", "penalty": "+guidance", "levelup": "+levelup"}
    assert arm == algorithm + names[kind]
    if arm not in reproduce.arms_of(preset):
        assert (preset, kind) == ("paper", "levelup")
        return
    settings = settings_of(preset, algorithm, kind)
    assert settings.preset == preset
    assert settings.update.algorithm == algorithm
    assert settings.method == registry.create(kind)
    assert settings.tau == (1.0, 1.0, 1.0, 1.0)
    assert settings.update.gamma == {"paper": 0.99, "service": 1.0}[preset]


def test_there_are_the_papers_four_arms_and_two_of_our_own():
    printed = {(a, kind) for a in ("reinforce", "ppo") for kind in ("score@1", "penalty")}
    own = {(a, "levelup") for a in ("reinforce", "ppo")}
    assert {reproduce.ARMS[arm] for arm in reproduce.arms_of("paper")} == printed
    assert {reproduce.ARMS[arm] for arm in reproduce.arms_of("service")} == printed | own


def test_the_questionnaire_shares_are_no_counts_out_of_24():
    def gives(people: int, percent: float) -> bool:
        return any(round(100 * k / people, 1) == percent for k in range(people + 1))

    assert not gives(24, 35.7)
    assert not gives(24, 21.4)
    assert [n for n in range(1, 41) if gives(n, 35.7) and gives(n, 21.4)] == [14, 28]
    assert (round(100 * 5 / 14, 1), round(100 * 3 / 14, 1)) == (35.7, 21.4)


def score_of_rates(rates: np.ndarray) -> float:
    """I of one issue where every category is equally common and has exactly this rate."""
    rates = np.asarray(rates, float)
    inside_n, inside_x = np.ones((len(rates), 1)), rates[:, None]
    counts = Counts(inside_n, inside_x, inside_n.sum() - inside_n, inside_x.sum() - inside_x)
    return issue_score(gaps(counts)).item()


@pytest.mark.parametrize(("k", "ceiling"), [(2, 1.0), (3, 2 / 3), (5, 0.6), (6, 0.6)])
def test_the_ceiling_of_a_score(k, ceiling):
    extremes = [score_of_rates(np.arange(k) < m) for m in range(1, k)]
    assert extremes == pytest.approx([2 * m * (k - m) / (k * (k - 1)) for m in range(1, k)])
    assert max(extremes) == pytest.approx(ceiling)
    assert tables.ceiling(k) == pytest.approx(ceiling)
    # d is convex in the rates, so no rates between 0 and 1 give more
    between = np.random.default_rng(0).random((500, k))
    assert max(score_of_rates(rates) for rates in between) <= ceiling


@pytest.mark.parametrize("k", [2, 3, 5, 6])
def test_a_score_is_at_most_twice_the_share_of_people_with_the_issue(k):
    rng = np.random.default_rng(1)
    for rates in rng.random((500, k)) ** rng.integers(1, 20, (500, 1)):
        assert score_of_rates(rates) <= 2 * rates.mean() + 1e-12
    only_one = np.where(np.arange(k) == 0, 0.3, 0.0)
    assert score_of_rates(only_one) == pytest.approx(2 * only_one.mean())
    assert pytest.approx(7.35) == 30 * 0.49 / 2


@pytest.fixture(scope="module")
def walked() -> list[np.ndarray]:
    """True distances of robots that only walk, at every decision after step 200, [20][n]."""
    n = 400
    setups = layout.draw(people.population("uniform"), n, np.random.default_rng(2))
    world = Physics(n)
    world.place(np.arange(n), world.prepare(setups), np.arange(n))
    world.walk(None, 200)
    distances = []
    while world.truth["steps"][0] < 300:
        world.walk(None, 5)
        distances.append(world.truth["distance"].copy())
    return distances


def test_a_late_response_is_never_at_a_proper_distance(walked):
    assert max(distance.max() for distance in walked) < 1.0


def test_who_is_ignored_is_come_too_close_to(walked):
    assert walked[-1].max() < 0.5
