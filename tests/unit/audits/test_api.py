"""``evenhand.audit``: the same findings from everything that holds a log, and all its forms."""

import csv
import io
import json
import math
import shlex
from dataclasses import replace

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.csv
import pytest

import evenhand
from evenhand.audits import api
from evenhand.audits.api import Audit, audit
from evenhand.audits.example import synthetic_log
from evenhand.audits.judge.results import AuditSettings
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.sources import open_source
from evenhand.core.errors import InputError
from evenhand.methods.paper.issues import Thresholds
from evenhand.methods.services import Services
from evenhand.statistics.verdicts import VerdictSettings
from support.refusals import refused

QUICK = AuditSettings(VerdictSettings(permutations=200), seed=3)
LOG = synthetic_log(2000, np.random.default_rng(2))
ROLES = {"measures": ("smiles_per_minute",), "depth": 2}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    found = tmp_path_factory.mktemp("log") / "fleet.csv"
    pyarrow.csv.write_csv(LOG, found)
    return found


@pytest.fixture(scope="module")
def found(path) -> Audit:
    return audit(path, settings=QUICK, **ROLES)


def numbers(one: Audit) -> list:
    return [table.to_pylist() for table in (one.table, one.waits, one.measures)]


def test_the_package_offers_it():
    assert evenhand.audit is audit


@pytest.mark.parametrize(
    "frame",
    [LOG, LOG.to_pandas(), pl.from_arrow(LOG)],
    ids=["pyarrow", "pandas", "polars"],
)
def test_every_frame_is_found_like_the_file(found, frame):
    other = audit(frame, settings=QUICK, **ROLES)
    assert numbers(other) == numbers(found)
    assert other.findings.resemblance == found.findings.resemblance
    assert other.verdict == found.verdict


def test_interactions_are_found_like_a_file_of_them(tmp_path):
    rng = np.random.default_rng(0)
    responded = rng.random(400) < 0.8
    log = Services.build(
        {"race": (rng.integers(0, 3, 400), ["x", "y", "z"])},
        {
            "responded": responded.tolist(),
            "response_step": [int(s) if r else None for s, r in
                              zip(rng.integers(50, 300, 400), responded, strict=True)],
            "steps": [500] * 400,
        },
    )  # fmt: skip
    pyarrow.csv.write_csv(log.to_arrow(), tmp_path / "log.csv")
    first, second = audit(log, settings=QUICK), audit(tmp_path / "log.csv", settings=QUICK)
    assert numbers(first) == numbers(second)
    assert first.findings.findings[0].issue == "willingness"


def test_the_table_has_a_row_for_each_group_and_issue(found):
    frame = found.table.to_pandas()
    single = frame[~frame["identity"].str.contains("×")]
    assert len(single) == 4 * (5 + 3 + 2)
    ages = LOG["age_group"].to_pylist()
    child = single[(single["group"] == "child") & (single["issue"] == "risk")].iloc[0]
    close = [a == "child" and d < 0.5
             for a, d in zip(ages, LOG["min_distance_m"].to_pylist(), strict=True)]  # fmt: skip
    assert (child["n"], child["cases"]) == (ages.count("child"), sum(close))
    assert child["rate"] == sum(close) / ages.count("child")


def test_waits_and_measures_have_a_row_for_each_group(found):
    groups = {(row["identity"], row["group"]) for row in found.waits.to_pylist()}
    assert ("gender", "female") in groups
    assert ("mobility", "wheelchair") in groups
    women = next(row for row in found.measures.to_pylist() if row["group"] == "female")
    frame = LOG.to_pandas()
    smiles = frame.loc[frame["gender"] == "female", "smiles_per_minute"]
    assert women["n"] == len(smiles)
    assert women["mean"] == pytest.approx(smiles.mean())
    assert women["median"] == pytest.approx(smiles.median())


def test_disparities_are_the_largest_first(found):
    told = found.disparities
    assert told
    assert {one.verdict for one in told} == {"disparity"}
    sizes = [abs(one.difference) for one in told]
    assert sizes == sorted(sizes, reverse=True)
    assert found.verdict == "disparity"
    assert (found.services, found.about.synthetic) == (2000, True)
    assert "risk of any false alarm at most" in found.summary


# --- written down ---


def test_json_holds_everything(found, tmp_path):
    assert found.save(tmp_path / "a.json") == tmp_path / "a.json"
    told = json.loads((tmp_path / "a.json").read_text())
    assert told["services"] == 2000
    assert told["synthetic"] is True
    assert told["findings"] == [
        {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()}
        for row in found.table.to_pylist()
    ]
    assert told["warnings"] == list(found.warnings)
    assert told["log"]["title"] == found.about.title


def test_csv_holds_groups_and_issues(found, tmp_path):
    found.save(tmp_path / "a.csv")
    read = list(csv.DictReader(io.StringIO((tmp_path / "a.csv").read_text())))
    table = found.table.to_pylist()
    assert [row["group"] for row in read] == [row["group"] for row in table]
    assert [float(row["rate"] or "nan") for row in read] == pytest.approx(
        [math.nan if row["rate"] is None else row["rate"] for row in table], nan_ok=True
    )


def test_the_card_is_one_page_that_needs_nothing_else(found, tmp_path):
    found.save(tmp_path / "a.html")
    page = (tmp_path / "a.html").read_text()
    assert page.lower().startswith("<!doctype html>")
    assert "age_group" in page
    assert "synthetic" in page.lower()
    for outside in ('src="http', 'href="http', "@import"):
        assert outside not in page


def test_a_notebook_shows_the_card_in_a_frame_and_runs_nothing_of_the_log():
    hostile = audit(
        pd.DataFrame({"group": ['"><script>x</script>', "b"] * 10, "responded": [1, 0] * 10}),
        settings=QUICK,
    )
    shown = hostile._repr_html_()
    assert shown.startswith('<iframe title="Audit of ')
    assert "&lt;!doctype html&gt;" in shown.lower()
    assert "<script" not in shown
    assert "&lt;script&gt;x" not in shown  # nor within the frame


def test_a_figure_has_a_panel_for_each_issue(found):
    from matplotlib import pyplot

    figure = found.figure("age_group")
    assert [axes.get_title() or axes.get_title(loc="left") for axes in figure.axes] == [
        "willingness", "quality", "priority", "risk",
    ]  # fmt: skip
    pyplot.close(figure)
    with refused("unknown identity", "'age'", "'age_group'"):
        found.figure("age")


@pytest.mark.parametrize("name", ["a.pdf", "a", "a.HTML", ".json"])
def test_another_ending_is_refused(found, tmp_path, name):
    with refused("unknown file"):
        found.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


# --- what was said of the columns ---


def test_a_mapping_can_be_given_in_three_ways(path, tmp_path):
    (tmp_path / "map.toml").write_text('identities = ["gender"]\nresponded = "responded"\n')
    said = Mapping(identities=("gender",), responded="responded")
    found = [
        audit(path, said, QUICK),
        audit(path, tmp_path / "map.toml", QUICK),
        audit(path, settings=QUICK, identities=("gender",), responded="responded"),
    ]
    assert numbers(found[0]) == numbers(found[1]) == numbers(found[2])
    assert {row["identity"] for row in found[0].table.to_pylist()} == {"gender"}


@pytest.mark.parametrize(
    ("roles", "said"),
    [
        ({"identity": ("gender",)}, "unknown role 'identity': did you mean 'identities'"),
        ({"identities": ("gendr",)}, "unknown column 'gendr': did you mean 'gender'"),
        ({"depth": 4}, "depth is 4: give a whole number from 1 to 3"),
    ],
)
def test_what_does_not_exist_is_named(path, roles, said):
    with pytest.raises(InputError, match=said):
        audit(path, settings=QUICK, **roles)


def test_a_log_without_an_identity_is_refused():
    with refused("missing identities"):
        audit(pa.table({"place": ["a", "b"], "responded": [True, False]}))


def test_what_repeats_it_in_python_repeats_it(path, found, tmp_path):
    """The line on the card, run as it stands; a frame is called log."""
    names = {"evenhand": evenhand, "AuditSettings": AuditSettings, "Mapping": Mapping,
             "VerdictSettings": VerdictSettings, "Thresholds": Thresholds}  # fmt: skip
    again = eval(found.about.command, names)
    assert numbers(again) == numbers(found)
    assert again.about.command == found.about.command
    frame = audit(LOG, settings=QUICK, identities=("gender",), within=("site",))
    assert frame.about.command.startswith("evenhand.audit(log, Mapping(identities=('gender',), ")
    assert numbers(eval(frame.about.command, {**names, "log": LOG})) == numbers(frame)


@pytest.mark.parametrize("secret", ["s3cret", "it's"])
def test_a_password_is_not_in_the_command(monkeypatch, secret):
    """Nor where a shell needs the URL quoted."""
    url = f"postgres://me:{secret}@host/db?x=1&y=2"
    monkeypatch.setattr(api, "open_source", lambda *_: replace(
        open_source(LOG), description={"kind": "postgres", "url": "postgres://me@host/db"}
    ))  # fmt: skip
    told = audit(url, settings=QUICK, command=shlex.join(["evenhand", "audit", url]))
    assert shlex.split(told.about.command) == ["evenhand", "audit", "postgres://me@host/db"]


def test_what_the_log_cannot_tell_is_said():
    log = pa.table({"gender": ["f", "m"] * 20, "responded": [True, False] * 20})
    told = audit(log, settings=QUICK).about
    assert [text.partition(":")[0] for text in told.left_out] == [
        "quality", "priority", "risk", "waiting",
    ]  # fmt: skip
    assert not told.synthetic


def test_a_finding_is_a_frame_a_figure_and_a_line(found):
    assert found.frame["group"].tolist() == found.table["group"].to_pylist()
    assert found.plot().axes
    assert repr(found).endswith(f"{found.services:,} services, {found.verdict}")
