"""Self-reflection as it is drawn and told, by hand for a handful of updates."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from evenhand.experiments.paper.report import figures
from evenhand.experiments.paper.report.build import build
from evenhand.experiments.paper.report.results import KEYS, SCHEMAS, read
from evenhand.report import page, style
from evenhand.report.read_tables import Results, read_table
from evenhand.report.reflection_figure import reflection_caption, reflection_data, reflection_draw
from evenhand.report.table import Table, table
from support.refusals import refused

NAN = math.nan
COLUMNS = tuple(SCHEMAS["reflection"])
PLATE = next(plate for plate in figures.PLATES if plate.name == "reflection")


def update(epoch: int, **more: Any) -> dict[str, Any]:
    """One update of the arm PPO with level-up that nothing is odd about."""
    usual = {
        "preset": "service", "arm": "ppo+levelup", "seed": 0, "epoch": epoch, "projection": -0.02,
        "cosine": -0.1, "z": -0.5, "p_value": 0.6, "alarm": 0.0, "identity": "", "issue": "",
        "favoured": "", "earlier": min(epoch, 100), "rate": 0.02,
    }  # fmt: skip
    return usual | more


def results_of(*updates: dict[str, Any]) -> Results:
    found = table(COLUMNS, [[row[name] for name in COLUMNS] for row in updates])
    return Results({"reflection": found}, {"people": 30}, [])


ABNORMAL = {"alarm": 1.0, "identity": "age", "issue": "quality", "favoured": "Elder, Child"}


def example() -> Results:
    """Two seeds of one arm with an alarm in each, and an arm without."""
    rows = [update(epoch, arm="reinforce+levelup") for epoch in range(48, 52)]
    rows += [update(48), update(49, p_value=0.02, projection=0.05, **ABNORMAL), update(50)]
    rows += [update(60, seed=1, p_value=0.0164, projection=NAN, **ABNORMAL)]
    return results_of(*rows)


def drawn_marks(figure: Figure, marker: str) -> set[tuple[float, float]]:
    """Where a marker stands, over all axes, rounded."""
    lines = (line for ax in figure.axes for line in ax.lines if line.get_marker() == marker)
    return {
        (round(float(x), 6), round(float(y), 6))
        for line in lines
        for x, y in np.asarray(line.get_xydata())
    }


def test_an_alarm_needs_enough_earlier_updates() -> None:
    # with 48 earlier ones the rarest rank is 1/49 = 0.0204 and above 0.02; with 49 it is 1/50
    rows = [update(at) for at in (0, 48, 49, 300)]
    assert reflection_data(results_of(*rows))["able"].tolist() == [0, 0, 1, 1]
    rows = [update(at, rate=0.25) for at in (2, 3)]
    assert reflection_data(results_of(*rows))["able"].tolist() == [0, 1]


@pytest.mark.parametrize("wide", [True, False])
def test_every_update_is_a_dot_and_an_alarm_is_the_mark_of_its_identity(wide: bool) -> None:
    data = reflection_data(example())
    with style.drawing():
        figure = reflection_draw(data, wide)
    # projections of both arms, -0.02 but for one alarm; p-values beside them
    dots = drawn_marks(figure, "o")
    assert {(48.0, -0.02), (51.0, -0.02), (49.0, 0.05), (48.0, 0.6), (60.0, 0.0164)} <= dots
    # the triangle of age: in both charts, but not where the projection is not known
    assert drawn_marks(figure, "^") == {(49.0, 0.05), (49.0, 0.02), (60.0, 0.0164)}
    letters = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert letters == ["Q"] * 3
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert [title for title in titles if title] == ["REINFORCE + level-up", "PPO + level-up"]
    limits = [
        line
        for ax in figure.axes
        for line in ax.lines
        if np.array_equal(line.get_ydata(), [0.02] * 2)
    ]
    assert len(limits) == 2  # one an arm
    assert "abnormal: age" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_caption_sets_alarms_beside_the_stated_rate() -> None:
    results = example()
    words = reflection_caption(results, reflection_data(results))
    assert words.startswith("2 seeds an arm.")
    assert "stated rate of 2.0\N{NO-BREAK SPACE}%" in words
    # REINFORCE: epochs 49, 50, 51 could raise one, 3 · 0.02; PPO: 49, 50 and 60
    assert "REINFORCE + level-up, 0 of 3 (0.1); PPO + level-up, 2 of 3 (0.1)." in words
    assert words.endswith("Favoured: age Elder in quality, 2×.")


def test_a_run_too_short_for_alarms_says_so() -> None:
    results = results_of(update(0), update(1))
    words = reflection_caption(results, reflection_data(results))
    assert "1 seed an arm" in words
    assert words.endswith("PPO + level-up, none could be raised.")
    with style.drawing():
        reflection_draw(reflection_data(results), True)


def test_what_an_alarm_leaves_unsaid_is_not_invented() -> None:
    results = results_of(update(70, alarm=1.0, p_value=0.01), update(71, projection=NAN))
    data = reflection_data(results)
    assert reflection_caption(results, data).endswith("PPO + level-up, 1 of 2 (0.0).")
    with style.drawing():
        figure = reflection_draw(data, False)
    assert "abnormal: not said" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_page_lists_the_updates_with_an_alarm() -> None:
    quiet = [update(epoch) for epoch in range(100)]
    listed = page.listing(reflection_data(results_of(*quiet, update(100, **ABNORMAL))))
    assert [row[3] for row in listed.rows] == ["100"]
    assert listed.rows[0][listed.heads.index("favoured")] == "Elder, Child"
    assert listed.note == "Updates with an alarm; all 101 updates are in the CSV file."
    # without any alarm some epochs, as of every long table
    assert page.listing(reflection_data(results_of(*quiet))).note.startswith("Every 2 epochs")


def test_an_experiment_without_such_arms_leaves_the_figure_out(
    experiment: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "PLATES", [PLATE])
    folder = experiment(seeds=(0,), epochs=2, presets=("paper",), windows=10)
    assert len(read(folder)["reflection"]) == 0
    assert 'id="reflection"' not in build(folder).read_text(encoding="utf-8")
    assert list((folder / "figures").iterdir()) == []
    with_it = experiment(seeds=(0,), epochs=2, presets=("service",), windows=10)
    assert 'id="reflection"' in build(with_it).read_text(encoding="utf-8")


def test_only_a_table_that_may_be_empty_may_be(tmp_path: Path) -> None:
    path = tmp_path / "reflection.csv"
    path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    empty = read_table(path, SCHEMAS["reflection"], KEYS["reflection"], may_be_empty=True)
    assert isinstance(empty, Table)
    assert len(empty) == 0
    with refused("empty file"):
        read_table(path, SCHEMAS["reflection"], KEYS["reflection"])
    path.write_text(",".join(COLUMNS[:-1]) + "\n", encoding="utf-8")
    with refused("missing rate", "'rate'"):
        read_table(path, SCHEMAS["reflection"], may_be_empty=True)


def test_an_update_that_is_there_twice_is_refused(experiment: Callable[..., Path]) -> None:
    folder = experiment(seeds=(0,), epochs=3, presets=("service",), windows=10)
    path = folder / "data" / "reflection.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines, lines[1]]) + "\n", encoding="utf-8")
    with refused("duplicate row", "reflection.csv", "8", "2"):
        read(folder)
