"""``evenhand replay``: which services, and what it refuses."""

import json

import pytest

from evenhand.restaurant.replay import page
from support import replayed


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return replayed.run_folder(tmp_path_factory.mktemp("runs") / "uneven")


@pytest.fixture(autouse=True)
def built(monkeypatch, tmp_path_factory):
    """A script that stands in for the built one."""
    path = tmp_path_factory.mktemp("static") / "replay.js"
    path.write_text("document.title;")
    monkeypatch.setattr(page, "SCRIPT", path)
    return path


def numbers(path):
    text = path.read_text()
    data = json.loads(text.split('id="replay-data">')[1].split("</script>")[0])
    return [service["number"] for service in data["services"]]


def test_services_by_number_in_the_order_wanted(cli, run, tmp_path):
    done = cli("replay", run, "--out", "replay.html", "--services", "17,3")
    assert (done.code, done.out, done.err) == (0, "replay.html\n", "")
    assert numbers(tmp_path / "replay.html") == [17, 3]
    assert "Services of uneven" in (tmp_path / "replay.html").read_text()
    assert "chosen by hand" in (tmp_path / "replay.html").read_text()


def test_an_epoch(cli, run, tmp_path):
    assert cli("replay", run, "--out", "new/e.html", "--epoch", 1, "--title", "A < B").code == 0
    assert numbers(tmp_path / "new" / "e.html") == list(range(30, 60))
    assert "<h1>A &lt; B</h1>" in (tmp_path / "new" / "e.html").read_text()


def test_by_default_thirty_that_show_something(cli, run, tmp_path):
    assert cli("replay", run, "--out", "r.html").code == 0
    assert len(numbers(tmp_path / "r.html")) == 30
    assert "they are no sample" in (tmp_path / "r.html").read_text()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--services", "3,600"], "service 600 was not recorded: there are services 0 to 59"),
        (["--services", "3,x"], "--services is '3,x': give numbers of services"),
        (["--services", ""], "--services is '': give numbers of services"),
        (["--services", "3,3"], "--services names service 3 more than once"),
        (["--services", ",".join(map(str, range(301)))], "a page holds at most 300"),
        (["--epoch", 2], "there is no epoch 2: the run has epochs 0 to 1"),
        (["--epoch", 1, "--services", "3"], "give one of them"),
    ],
)
def test_services_that_cannot_be_shown(cli, run, tmp_path, words, complaint):
    assert complaint in cli("replay", run, "--out", "r.html", *words).complaint
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_holds_no_run(cli, tmp_path):
    assert "holds no run" in cli("replay", "nowhere", "--out", "r.html").complaint


def test_a_run_without_states(cli, tmp_path):
    replayed.run_folder(tmp_path / "blind", states_kept=False)
    assert "has no states to draw" in cli("replay", "blind", "--out", "r.html").complaint


def test_targets_that_cannot_be_written(cli, run, tmp_path):
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "file").touch()
    for target, complaint in (
        ("r.txt", "r.txt does not end in .html"),
        ("folder.html", "folder.html is a folder"),
        ("file/r.html", "file is a file, not a folder"),
        ("/proc/none/r.html", "folder /proc/none cannot be written"),
    ):
        assert complaint in cli("replay", run, "--out", target).complaint


def test_a_page_is_replaced_whole_or_not_at_all(apart, require, run, tmp_path):
    path = tmp_path / "r.html"
    path.write_text("older")
    ended = apart.with_small_files(50_000, "replay", run, "--out", path)
    require("lacks the script" not in ended.err, "the built replay page: python frontend/build.py")
    assert f"{path} cannot be written" in ended.complaint
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


def test_a_script_that_has_not_been_built(cli, run, built):
    built.unlink()
    assert "python frontend/build.py" in cli("replay", run, "--out", "r.html").complaint


def test_help_says_what_is_shown(cli):
    done = cli("replay", "--help")
    assert done.code == 0
    assert "five with each issue" in " ".join(done.out.split())
