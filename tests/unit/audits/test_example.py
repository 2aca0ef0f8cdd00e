"""The synthetic log: what is uneven in it by construction comes out, and nothing else."""

import numpy as np
import pyarrow as pa
import pytest

from evenhand.audits.api import Audit, audit
from evenhand.audits.example import synthetic_log
from support.refusals import refused

LOG = synthetic_log(5000, np.random.default_rng(0))


@pytest.fixture(scope="module")
def over_all() -> Audit:
    return audit(LOG)


@pytest.fixture(scope="module")
def within_sites() -> Audit:
    return audit(LOG, within=("site",))


def verdicts(found: Audit, identity: str) -> dict[tuple[str, str], str]:
    return {
        (one.group, one.issue): one.verdict
        for one in found.findings.findings
        if one.identity == identity
    }


def test_its_identities_are_found_by_name(over_all):
    assert over_all.mapping.identities == ("age_group", "gender", "mobility")
    assert over_all.mapping.missing == ()
    assert over_all.about.synthetic
    assert over_all.warnings == ()


@pytest.mark.parametrize("how", ["over_all", "within_sites"])
def test_children_are_served_worse_in_willingness_and_risk(how, request):
    found = request.getfixturevalue(how)
    for issue, gap in (("willingness", 0.20), ("risk", 0.11)):
        child = next(
            one for one in found.findings.findings if (one.group, one.issue) == ("child", issue)
        )
        assert child.verdict == "disparity"
        assert child.low < gap < child.high  # as it was made
    assert verdicts(found, "age_group")["child", "priority"] != "disparity"
    assert verdicts(found, "age_group")["child", "quality"] != "disparity"


@pytest.mark.parametrize("how", ["over_all", "within_sites"])
def test_gender_makes_no_difference(how, request):
    found = verdicts(request.getfixturevalue(how), "gender")
    assert "disparity" not in found.values()
    for group in ("female", "male"):
        assert {found[group, issue] for issue in ("willingness", "quality", "risk")} == {
            "no evidence"
        }


@pytest.mark.parametrize("how", ["over_all", "within_sites"])
def test_too_few_guests_in_a_wheelchair_are_no_verdict(how, request):
    found = request.getfixturevalue(how)
    assert set(verdicts(found, "mobility").values()) == {"insufficient data"}
    few = [one for one in found.findings.findings if one.group == "wheelchair"]
    assert {one.n for one in few if one.issue == "risk"} == {
        LOG["mobility"].to_pylist().count("wheelchair")
    }
    assert all(one.needed > one.n for one in few)


def test_older_guests_wait_longer_only_as_long_as_sites_are_mixed(over_all, within_sites):
    """Simpson's paradox: the slower site has more of them."""
    assert verdicts(over_all, "age_group")["older adult", "priority"] == "disparity"
    inside = verdicts(within_sites, "age_group")
    assert {inside[group, "priority"] for group in ("older adult", "adult", "teen")}.isdisjoint(
        {"disparity"}
    )


def test_waiting_times_of_older_guests_differ_only_as_long_as_sites_are_mixed(
    over_all, within_sites
):
    mixed, inside = (
        next(one for one in found.findings.waits if one.group == "older adult")
        for found in (over_all, within_sites)
    )
    assert mixed.p < 0.001
    assert mixed.difference > 0.03
    assert inside.p > 0.05
    assert inside.low < 0 < inside.high
    assert (inside.unserved, inside.rest_unserved) == (mixed.unserved, mixed.rest_unserved)
    assert "of “older adult” (age_group) still waited" in over_all.summary
    assert "of “older adult” (age_group) still waited" not in within_sites.summary


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_other_seeds_tell_the_same(seed):
    """The great effects are found with any; an even identity has an alarm in 1 of 20 at most."""
    found = audit(synthetic_log(5000, np.random.default_rng(seed)), within=("site",))
    ages = verdicts(found, "age_group")
    assert (ages["child", "willingness"], ages["child", "risk"]) == ("disparity", "disparity")
    assert ages["older adult", "priority"] != "disparity"


def test_shares_and_rates_are_as_they_are_said():
    """Of 200,000 services; five standard errors on each side."""
    log = synthetic_log(200_000, np.random.default_rng(1)).to_pandas()
    child = log["age_group"] == "child"
    other = log["age_group"].isin(["teen", "adult", "older adult"])
    ignored, close = log["responded"] == "no", log["min_distance_m"] < 0.5

    def near(rows, share):
        assert abs(rows.mean() - share) < 5 * np.sqrt(share * (1 - share) / len(rows))

    near(ignored[child], 0.30)
    near(ignored[other], 0.10)
    near(close[child], 0.15)
    near(close[other], 0.04)
    near(log["mobility"] == "wheelchair", 0.004)
    near(log["age_group"].isna(), 0.01)
    near(log.loc[log["site"] == "harbour", "age_group"].dropna() == "older adult", 0.40)
    assert (log["answered_at"].isna() == ignored).all()
    assert (log["response_distance_m"].isna() == ignored).all()
    assert (log["source"] == "synthetic").all()
    assert log["asked_at"].is_monotonic_increasing


def test_the_same_seed_gives_the_same_log():
    again = synthetic_log(5000, np.random.default_rng(0))
    assert again.equals(LOG)
    assert not synthetic_log(5000, np.random.default_rng(1)).equals(LOG)
    assert pa.types.is_timestamp(again.schema.field("asked_at").type)


@pytest.mark.parametrize("services", [0, -1, 10_000_001])
def test_as_many_services_as_can_be(services):
    with refused("range services", "1", "10000000"):
        synthetic_log(services, np.random.default_rng(0))
