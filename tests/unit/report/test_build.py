"""The report as a whole: files, a page that stands alone, hostile text, thin data."""

from __future__ import annotations

import csv
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from evenhand.experiments.paper.report import figures
from evenhand.experiments.paper.report.build import build
from evenhand.experiments.paper.report.figures import PLATES
from support.pages import Page
from support.refusals import refused

NAMES = [plate.name for plate in PLATES]


@pytest.fixture(scope="session")
def page(built: Path) -> Page:
    return Page((built / "report.html").read_text(encoding="utf-8"))


def rewrite(path: Path, change: Callable[[dict[str, str]], None]) -> None:
    """Change every row of a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        change(row)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def test_every_figure_is_there_as_svg_pdf_and_csv(built: Path) -> None:
    found = {path.name for path in (built / "figures").iterdir()}
    assert found == {f"{name}.{kind}" for name in NAMES for kind in ("svg", "pdf", "csv")}
    assert not list(built.rglob(".*"))  # nothing half-written is left
    for name in NAMES:
        assert (built / "figures" / f"{name}.pdf").read_bytes().startswith(b"%PDF-")


def test_svg_holds_text_as_text_and_no_date(built: Path) -> None:
    svg = (built / "figures" / "signatures.svg").read_text(encoding="utf-8")
    texts = [node.text for node in ElementTree.fromstring(svg).iter() if node.tag.endswith("}text")]
    assert {"racism", "ableism", "willingness", "printed in the paper"} <= set(texts)
    assert "dc:date" not in svg
    assert b"CreationDate" not in (built / "figures" / "signatures.pdf").read_bytes()


def test_csv_of_a_figure_is_what_the_tables_say(built: Path) -> None:
    with (built / "data" / "epochs.csv").open(newline="") as file:
        epochs = list(csv.DictReader(file))
    with (built / "figures" / "biased_epochs.csv").open(newline="") as file:
        drawn = list(csv.DictReader(file))
    for seed in ("0", "1"):
        count = sum(
            (row["preset"], row["arm"], row["seed"]) == ("service", "ppo", seed)
            and row["biased_detector"] == "true"
            for row in epochs
        )
        (found,) = (
            row["biased_epochs"]
            for row in drawn
            if (row["preset"], row["arm"]) == ("service", "ppo")
            and (row["judge"], row["seed"]) == ("detector", seed)
        )
        assert float(found) == count


def test_the_page_is_well_formed_and_its_identifiers_are_unique(page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    inside = [a["href"][1:] for _, a in page.tags if a.get("href", "").startswith("#")]
    assert set(inside) <= set(ids)
    shown = [t for t, _ in page.tags if t in ("h1", "h2", "h3")]
    assert shown[0] == "h1"
    assert shown.count("h1") == 1


def test_the_page_needs_nothing_else(built: Path, page: Page) -> None:
    text = (built / "report.html").read_text(encoding="utf-8")
    assert "http:" not in text
    assert "https:" not in text
    assert "@import" not in text
    assert not {"script", "link", "img", "iframe", "object"} & {tag for tag, _ in page.tags}
    links = [a["href"] for a in page.attributes("a") if not a["href"].startswith("#")]
    assert len(links) == 3 * len(NAMES) + 3
    assert all((built / link).is_file() for link in links)
    assert all(found == "#" for found in re.findall(r"url\((.)", text))


def test_every_figure_has_words_for_those_who_do_not_see_it(page: Page) -> None:
    images = [a["aria-label"] for a in page.attributes("div") if a.get("role") == "img"]
    assert len(images) == len(set(images)) == len(NAMES)
    assert all(len(label) > 60 for label in images)
    assert sum(tag == "figcaption" for tag, _ in page.tags) == len(NAMES)
    assert all(a.get("scope") in ("col", "row") for a in page.attributes("th"))
    assert page.attributes("html") == [{"lang": "en"}]


def test_claims_come_first_with_status_in_words(page: Page) -> None:
    sections = [a["id"] for a in page.attributes("section")]
    assert sections[:2] == ["claims", "summary"]
    assert sections[-2:] == ["methods", "manifest"]
    text = " ".join(" ".join(page.text).split())
    assert "2 reproduced by calibration" in text
    assert "0.962 95 % [0.940, 0.980] 2 seeds" in text
    assert "[0.49, 0.25, 0.38, 0.43]" in text


def test_it_is_said_what_the_rows_of_claims_are(page: Page) -> None:
    text = " ".join(" ".join(page.text).split())
    assert (
        "The table has 7 rows: 5 claims of the paper; 1 of them again, learned from another "
        "reward; 1 beside them, of which the paper prints no number. 1 was reproduced, 2 were "
        "reproduced by calibration, 1 was contradicted, 2 open, and 1 not testable with this run."
    ) in text


def test_levelling_down_is_said_plainly(page: Page) -> None:
    text = " ".join(" ".join(page.text).split())
    paper = text[text.index("Preset paper: the printed reward alone.") :]
    assert "All 4 arms level down" in paper[:500]
    service = text[text.index("Preset service: quality of service and the printed reward. ") :]
    assert "No arm levels down." in service[:500]


def test_the_same_tables_give_the_same_bytes(built: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(built, again, ignore=shutil.ignore_patterns("figures", "report.html"))
    build(again, workers=2)  # as many processes as you like
    written = [path.relative_to(built) for path in built.rglob("*") if path.is_file()]
    assert len(written) == 3 * len(NAMES) + 1 + 16  # figures, page, tables and JSON
    for path in written:
        assert (built / path).read_bytes() == (again / path).read_bytes(), path


def only(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Draw these figures only: the others show nothing more here."""
    monkeypatch.setattr(figures, "PLATES", [plate for plate in PLATES if plate.name in names])


def test_hostile_text_is_shown_and_never_run(
    experiment: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    only(monkeypatch, "tsne", "questionnaire", "behaviour")
    folder = experiment(seeds=(0,), epochs=2, presets=("service",), windows=10)
    evil = '<script>alert(1)</script>"><img src=x onerror=alert(1)> $x_1$ </svg>'
    claims = json.loads((folder / "claims.json").read_text())
    claims[0] |= {"claim": evil, "evidence": evil, "paper": evil, "id": evil}
    (folder / "claims.json").write_text(json.dumps(claims), encoding="utf-8")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest |= {"settings": {evil: evil}, "command": evil, "created": evil, "population": evil}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    rewrite(folder / "data" / "tsne.csv", lambda row: row.update(kind=evil))
    rewrite(folder / "data" / "questionnaire.csv", lambda row: row.update(scenario_name=evil))
    rewrite(folder / "data" / "behaviour.csv", lambda row: row.update(unit=evil))
    text = build(folder).read_text(encoding="utf-8")
    page = Page(text)
    assert not {"script", "img"} & {tag for tag, _ in page.tags}
    assert not any("onerror" in attributes for _, attributes in page.tags)
    assert "".join(page.text).count("<script>alert(1)</script>") >= 8


def test_one_seed_and_missing_values_are_said_and_not_invented(
    experiment: Callable[..., Path],
) -> None:
    folder = experiment(seeds=(5,), epochs=4, presets=("paper",), windows=10)

    def forget(*columns: str) -> Callable[[dict[str, str]], None]:
        return lambda row: row.update(dict.fromkeys(columns, ""))

    scores = ("total", "willingness", "quality", "priority", "risk")
    flags = ("biased_detector", "biased_threshold", "perfect_rate")
    rewrite(folder / "data" / "epochs.csv", forget(*scores, *flags))
    rewrite(folder / "data" / "test.csv", forget(*scores, "worst_group_rate", "floor"))
    interval = ("ci_low", "ci_high")
    rewrite(folder / "data" / "signatures.csv", forget("ours", "paper", "ceiling", *interval))
    rewrite(folder / "data" / "calibration.csv", forget("predicted", "observed", *interval))
    rewrite(folder / "data" / "detector.csv", forget("value", *interval))
    rewrite(folder / "data" / "behaviour.csv", forget("value", "paper", *interval))
    claims = json.loads((folder / "claims.json").read_text())
    claims[0] |= {"ours": None, "ci95": None, "paper": None, "seeds": None}
    (folder / "claims.json").write_text(json.dumps(claims), encoding="utf-8")
    text = " ".join(" ".join(Page(build(folder).read_text(encoding="utf-8")).text).split())
    assert "1 seed (so no interval)" in text
    assert "one seed has no interval" in text
    assert "total issue score is not defined" in text
    assert "REINFORCE: total score not defined, perfect services" in text
    assert "Whether an arm levels down cannot be said" in text
    assert "No epoch of this run was judged" in text
    assert text.count("not defined") > 50
    assert not re.search(r"\b(nan|NaN|None)\b", text)
    csv_text = (folder / "figures" / "total_score.csv").read_text()
    assert csv_text.splitlines()[1] == "paper,reinforce,1,0,,,,"


def test_an_experiment_without_ppo_leaves_the_close_view_out(
    experiment: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    only(monkeypatch, "zoom", "biased_epochs")
    folder = experiment(seeds=(0,), epochs=2, presets=("service",), windows=10)

    def rename(row: dict[str, str]) -> None:
        row["arm"] = row["arm"].replace("ppo", "mine")

    rewrite(folder / "data" / "epochs.csv", rename)
    rewrite(folder / "data" / "test.csv", rename)
    text = build(folder).read_text(encoding="utf-8")
    assert (folder / "figures" / "biased_epochs.svg").exists()
    assert not (folder / "figures" / "zoom.svg").exists()
    assert 'id="zoom"' not in text
    assert "mine+guidance" in text


def test_a_folder_that_cannot_be_written_is_named(experiment: Callable[..., Path]) -> None:
    folder = experiment(seeds=(0,), epochs=2, presets=("service",), windows=10)
    (folder / "figures").write_text("a file where the folder should be", encoding="utf-8")
    with refused("conflict folder"):
        build(folder)
    assert not (folder / "report.html").exists()


def test_a_malformed_table_stops_the_report_before_anything_is_written(
    experiment: Callable[..., Path],
) -> None:
    folder = experiment(seeds=(0,), epochs=2, windows=10)
    rewrite(folder / "data" / "test.csv", lambda row: row.update(perfect_rate="high"))
    with refused("type perfect_rate", "test.csv", "2", "'perfect_rate'", "'high'"):
        build(folder)
    assert not (folder / "figures").exists()
