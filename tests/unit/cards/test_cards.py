"""Model cards: every number beside a count by hand, and read back by Hugging Face's own reader."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from huggingface_hub import ModelCard
from markdown_it import MarkdownIt
from scipy import stats

from evenhand.experiments import model_card_numbers
from evenhand.methods import detector_file
from evenhand.methods.detector_file import Answers
from evenhand.methods.paper import detector
from evenhand.methods.services import Services
from evenhand.report.model_cards import detector as judge
from evenhand.report.model_cards import robot
from evenhand.report.model_cards.sections import Said
from evenhand.restaurant import people
from evenhand.training.run_folder import as_dict
from evenhand.training.settings import settings_of
from support.refusals import refused

RNG = np.random.default_rng(5)
N = 600
CODES = np.stack([RNG.integers(0, len(one.groups), N) for one in people.IDENTITIES], axis=1)
DISABLED = CODES[:, 3] == 0
ANSWERED = np.where(DISABLED, RNG.random(N) < 0.6, RNG.random(N) < 0.95)


def services(codes: np.ndarray, answered: np.ndarray) -> Services:
    """Services that are perfect where there was a response."""
    n = len(codes)
    return Services.build(
        {one.name: (codes[:, i], one.groups) for i, one in enumerate(people.IDENTITIES)},
        {
            "responded": answered,
            "response_step": np.ma.array(np.full(n, 100), mask=~answered),
            "response_distance": np.ma.array(np.full(n, 1.25), mask=~answered),
            "min_distance": np.full(n, 1.25),
            "steps": np.where(answered, 100, 300),
        },
    )


@pytest.fixture(scope="module")
def trial() -> robot.Trial:
    return model_card_numbers.trial_of(services(CODES, ANSWERED), 5, "uniform")


def about(**changes) -> robot.Robot:
    return replace(
        robot.Robot(
            settings=as_dict(settings_of("service", "ppo", "levelup")),
            versions={"evenhand": "0.1.0", "numpy": "2.0"},
            epochs=7,
            population="uniform",
            judge="1000 judgements by simulated respondents",
            command="evenhand train --out RUN",
            last={"total": 0.25, "perfect_rate": None},
        ),
        **changes,
    )


def front(page: str) -> dict:
    """The front matter, by a YAML library."""
    return yaml.safe_load(page.split("---\n")[1])


def cells(page: str, first: str) -> list[str]:
    """Cells from the row that begins with these words on, as Markdown shows them."""
    tokens = MarkdownIt("commonmark").enable("table").parse(page.split("---\n", 2)[2])
    texts = [
        "".join(child.content for child in tokens[i + 1].children or [])
        for i, token in enumerate(tokens)
        if token.type == "td_open"
    ]
    return texts[texts.index(first) :]


# --- a robot ---


def test_shares_of_groups_are_counted_by_hand(trial):
    page = robot.render(Said("r"), about(), trial)
    of, good = int(DISABLED.sum()), int((DISABLED & ANSWERED).sum())
    low, high = stats.binomtest(good, of).proportion_ci(method="wilson")
    found = cells(page, "disability: Yes")
    share = f"{100 * good / of:.1f} % ({100 * low:.1f} to {100 * high:.1f}, n {of})"
    assert found[1] == share
    gap = 100 * ((~ANSWERED)[DISABLED].mean() - (~ANSWERED)[~DISABLED].mean())
    assert found[2].startswith(f"{gap:+.1f} (")
    assert found[2].endswith(") disparity")
    # nobody was ever served late: no gap, and not called even for that
    assert found[4].startswith("+0.0 (")


def test_the_means_of_windows_are_over_all_of_them(trial):
    assert trial.scores["total"].n == N // 30
    assert trial.scores["total"].low >= 0.0


@pytest.mark.parametrize(("few", "named"), [(29, False), (30, True)])
def test_bad_luck_of_a_small_group_is_not_the_worst_service(few, named):
    codes, answered = CODES.copy(), ANSWERED.copy()
    codes[:, 0] = np.maximum(codes[:, 0], 1)  # nobody is of the first race but
    codes[:few, 0], answered[:few] = 0, False  # these, none of whom was answered
    trial = model_card_numbers.trial_of(services(codes, answered), 5, "uniform")
    assert trial.perfect_of[0].n == few
    assert (trial.worst == 0) is named


def test_nobody_is_served_worst_among_small_groups_only():
    codes = CODES[:40].copy()
    codes[:] = np.arange(40)[:, None] % 2
    trial = model_card_numbers.trial_of(services(codes, ANSWERED[:40]), 5, "uniform")
    assert trial.worst is None
    assert "worst_group_rate" not in robot.render(Said("r"), about(), trial)


def test_hugging_face_reads_the_card_of_a_robot(trial):
    page = robot.render(Said("A robot", "cc-by-4.0"), about(), trial)
    card: Any = ModelCard(page)
    assert (card.data.license, card.data.library_name) == ("cc-by-4.0", "evenhand")
    assert card.data.pipeline_tag == "reinforcement-learning"
    assert card.data.model_name == "A robot"
    found = {one.metric_type: one.metric_value for one in card.data.eval_results or []}
    good = (ANSWERED.sum()) / N
    assert found["perfect_rate"] == found["response_rate"] == pytest.approx(good, abs=1e-6)
    worst = (DISABLED & ANSWERED).sum() / DISABLED.sum()
    assert found["worst_group_rate"] == pytest.approx(worst, abs=1e-6)
    assert found["total_issue_score"] == pytest.approx(trial.scores["total"].mean, abs=1e-6)
    assert "never served a real person" in card.text


def test_what_was_not_measured_is_called_so():
    page = robot.render(Said("r"), about(), None)
    assert "model-index" not in front(page)
    assert front(page)["license"] == "unknown"
    assert "On people whom training never saw: not measured." in page
    assert "Results of groups: not measured." in page
    assert "Licence: not stated." in page
    assert cells(page, "services without any issue, last epoch")[1] == "not measured"
    assert cells(page, "total issue score of the last epoch")[1] == "0.250"
    assert cells(page, "people served in training")[1] == "210, all of them synthetic"


def test_groups_that_nobody_was_of_stay_missing():
    one = model_card_numbers.trial_of(
        services(np.zeros((60, 5), int), np.arange(60) > 2), 1, "uniform"
    )
    page = robot.render(Said("r"), about(), one)
    assert cells(page, "race: Black")[1:6] == ["not measured"] * 5
    assert cells(page, "race: White")[1:3] == ["95.0 % (86.3 to 98.3, n 60)", "not measured"]
    # a window without two sides has no score, which is no 0
    assert cells(page, "total")[1] in ("not measured", "0.000 (0.000 to 0.000)")


def test_a_small_group_is_called_insufficient():
    codes = CODES[:60].copy()
    page = robot.render(
        Said("r"),
        about(),
        model_card_numbers.trial_of(services(codes, ANSWERED[:60]), 1, "uniform"),
    )
    assert cells(page, "race: Asian")[2].endswith("insufficient data")


@pytest.mark.parametrize(
    "name", ["<script>x</script>", "a\n---\nlicense: mit", "[x](http://y) | z", 'x: "y" #', "- 1"]
)
def test_what_its_maker_says_stays_text(name, trial):
    for page in (
        robot.render(Said(name, notes=name), about(population=name, judge=name), trial),
        judge.render(Said(name, notes=name), detector_file.load(detector_file.SHIPPED), None),
    ):
        plain = " ".join(name.split())
        body = page.split("---\n", 2)[2]
        tokens = MarkdownIt("commonmark").enable("table").parse(body)
        assert tokens[1].content != ""
        assert "".join(child.content for child in tokens[1].children or []) == plain
        kinds = {c.type for token in tokens for c in token.children or []}
        assert not kinds & {"html_inline", "link_open", "image"}
        assert "html_block" not in {token.type for token in tokens}
        assert front(page)["license"] == "unknown"
        assert "<script" not in page.replace(front_matter_of(page), "")
    index = front(robot.render(Said(name), about(), trial))["model-index"]
    assert index[0]["name"] == " ".join(name.split())


def front_matter_of(page: str) -> str:
    return "---\n" + page.split("---\n")[1] + "---\n"


def test_what_a_maker_cannot_say():
    with refused("empty name"):
        Said(" \n")
    with refused("unknown licence", "'MIT License'"):
        Said("x", "MIT License")


# --- a detector ---

SCORES = RNG.uniform(0.0, 0.6, (120, 4))
BIASED = SCORES.sum(axis=1) + RNG.normal(0.0, 0.2, 120) > 1.2
KINDS = [("racism" if row[0] > row[1] else "sexism") if b else None
         for row, b in zip(SCORES, BIASED, strict=True)]  # fmt: skip


def fitted(source: str = "respondents") -> detector.Detector:
    return detector.fit(SCORES, BIASED, KINDS, source=source, seed=3)


def test_hugging_face_reads_the_card_of_a_detector():
    found = model_card_numbers.evaluation_of(fitted(), Answers(SCORES, BIASED, tuple(KINDS), None))
    page = judge.render(Said("D", "apache-2.0"), fitted(), found)
    card: Any = ModelCard(page)
    assert card.data.pipeline_tag == "tabular-classification"
    metrics = {one.metric_type: one.metric_value for one in card.data.eval_results or []}
    right = ((found.probability > 0.5) == BIASED).mean()
    assert metrics["accuracy"] == pytest.approx(right, abs=1e-6)
    assert metrics["brier_score"] == pytest.approx(
        ((found.probability - BIASED) ** 2).mean(), abs=1e-6
    )
    agreed = ((found.probability > 0.5) == (SCORES.sum(axis=1) > 0.5)).mean()
    assert cells(page, "agreement with the manual threshold")[1].startswith(f"{100 * agreed:.1f} %")
    assert "simulated" not in page.split("## Limits")[0]
    named = sum(kind == "racism" for kind in KINDS)
    assert cells(page, "racism")[1].endswith(f"n {named})")


def test_a_detector_whose_accuracy_was_not_measured():
    page = judge.render(Said("D"), fitted("simulated respondents"), None)
    assert "model-index" not in front(page)
    assert "simulated-respondents" in front(page)["tags"]
    assert "Accuracy on judgements that it had not seen: not measured." in page
    assert "an assumption about people" in page
    assert cells(page, "judgements")[1] == "120"
    assert cells(page, "willingness")[1] == f"{SCORES[:, 0].mean():.3f}"


def test_answers_of_another_detector_are_refused():
    others = Answers(SCORES[:100], BIASED[:100], tuple(KINDS[:100]), None)
    with refused("changed answers", "100", "120"):
        model_card_numbers.evaluation_of(fitted(), others)


def test_the_code_of_a_detectors_card_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    detector_file.save(fitted(), tmp_path / "DETECTOR.json")
    page = judge.render(Said("D"), fitted(), None)
    (block,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict = {}
    exec(block, names)
    assert names["detector"] == fitted()


def test_a_detector_of_own_issues_and_identities_is_repeated_in_python(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    issues = ("late", 'un"kind')
    kinds = ["hatism" if b else None for b in BIASED]
    own = detector.fit(
        SCORES[:, :2], BIASED, kinds, source="respondents", seed=3, issues=issues,
        identities=("hat",),
    )  # fmt: skip
    rows = zip(SCORES.tolist(), BIASED, kinds, strict=True)
    lines = [f"{a!r},{b!r},{'yes' if y else 'no'},{kind or ''}" for (a, b, *_), y, kind in rows]
    head = 'late,"un""kind",biased,discrimination'
    (tmp_path / "ANSWERS.csv").write_text("\n".join([head, *lines]))
    page = judge.render(Said("D"), own, None)
    assert "detect fit" not in page
    _, block = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(block, {})
    assert detector_file.load(tmp_path / "DETECTOR.json") == own
    assert "evenhand detect fit --answers ANSWERS.csv" in judge.render(Said("D"), fitted(), None)
