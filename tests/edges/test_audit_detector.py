"""A detector of one's own in an audit."""

import json

from evenhand.methods import detector_file


def judged(cli, path, *words):
    """What the detector says of each identity, as JSON holds it."""
    out = path / "found.json"
    assert cli("audit", "fleet.csv", "--permutations", 99, "--out", out, *words).code == 0
    return json.loads(out.read_text(encoding="utf-8"))["resemblance"]


def test_an_audit_asks_the_detector_that_is_given(cli, tmp_path):
    assert cli("example", "fleet.csv", "--services", 900).code == 0
    usual = judged(cli, tmp_path)
    assert judged(cli, tmp_path, "--detector", detector_file.SHIPPED) == usual

    # one that is never sure enough, and one that always is
    given = json.loads(detector_file.SHIPPED.read_text(encoding="utf-8"))
    found = {}
    for threshold in (0.0001, 0.9999):
        path = tmp_path / f"at-{threshold}.json"
        path.write_text(json.dumps(given | {"threshold": threshold}), encoding="utf-8")
        found[threshold] = judged(cli, tmp_path, "--detector", path)
    assert found[0.0001] != found[0.9999] != usual


def test_whose_judgements_a_detector_learned_is_told(cli, tmp_path):
    assert cli("example", "fleet.csv", "--services", 900).code == 0
    given = json.loads(detector_file.SHIPPED.read_text(encoding="utf-8"))
    for source in ("simulated respondents", "respondents"):
        path = tmp_path / "own.json"
        path.write_text(json.dumps(given | {"source": source}), encoding="utf-8")
        words = ("--permutations", 99, "--detector", path, "--out", "card.html")
        said = " ".join(cli("audit", "fleet.csv", *words).out.split())
        assert f"issues {source} (own.json) called by which name" in said
        card = " ".join((tmp_path / "card.html").read_text(encoding="utf-8").split())
        assert f"learned from judgements of {source} (own.json)." in card


def test_a_detector_that_is_none_is_refused_before_the_log_is_read(cli, tmp_path):
    (tmp_path / "log.csv").write_text("age,responded\nchild,yes\n")
    (tmp_path / "d.json").write_text("[]")
    assert "d.json" in cli("audit", "log.csv", "--detector", "d.json", "--out", "a.html").complaint
    assert "nope.json" in cli("audit", "log.csv", "--detector", "nope.json").complaint
    assert not (tmp_path / "a.html").exists()
