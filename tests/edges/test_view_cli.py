"""``evenhand view``: what it refuses, what it prints, and how it ends."""

import os
import socket
import urllib.request

import pytest

from evenhand.methods import detector_file
from evenhand.training import run_folder
from evenhand.training.settings import TrainSettings


@pytest.fixture
def taken():
    """A port that somebody listens on."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        yield one.getsockname()[1]


@pytest.fixture(scope="module")
def a_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view") / "run"
    settings = TrainSettings(epochs=1, people=4, scenario="perception")
    run_folder.execute(folder, settings, detector_file.load(detector_file.SHIPPED))
    return folder


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--robot", "agist"), "unknown robot 'agist': did you mean 'ageist'? choose one of even"),
        (("--robot", "ageist", "--strength", "1.5"), "strength of the ageist robot is 1.5: give 0"),
        (("--strength", "nan"), "strength of the even robot is nan: give 0 to 1"),
        (("--scenario", "tip"), "unknown scenario 'tip': did you mean 'tips'? choose one of even"),
        (("--scenario", "even+tips"), "'even+tips' contradicts itself: even is the lack of all"),
        (("--scenario", "tips+everyday"), "tips and everyday both set tips; choose one of them"),
        (("--run", "out", "--robot", "even"), "--run and --robot exclude each other: leave one"),
        (("--run", "out", "--strength", "1"), "--run and --strength exclude each other: leave"),
        (("--run", "nowhere"), "nowhere holds no run: there is no settings.json in it"),
        (("--port", "0"), "port is 0: give a whole number from 1 to 65535"),
        (("--port", "65536"), "port is 65536: give a whole number from 1 to 65535"),
        (("--port", "http"), "--port is 'http': give a whole number"),
        (("--seed", "-1"), "seed is -1: give a whole number from 0"),
        (("--scenaro", "tips"), "--scenaro"),
    ],
)
def test_wrong_words_are_one_sentence(cli, words, said):
    assert said in cli("view", *words).complaint


def test_a_port_in_use_is_said_before_any_work(cli, taken):
    said = cli("view", "--port", taken).complaint
    assert said == f"port {taken} is in use: give another one, or leave --port out"


def test_a_run_without_checkpoint_and_a_wrong_scenario_for_a_run(cli, a_run, tmp_path):
    young = tmp_path / "young"
    young.mkdir()
    (young / "settings.json").write_bytes((a_run / "settings.json").read_bytes())
    assert "has no checkpoint yet" in cli("view", "--run", young).complaint
    assert "did you mean 'tips'" in cli("view", "--run", a_run, "--scenario", "tip").complaint


@pytest.mark.parametrize("who", ["robot", "run"])
def test_the_address_is_printed_and_serves_and_ctrl_c_ends(apart, a_run, tmp_path, who):
    words = ["--run", a_run, "--scenario", "minority"] if who == "run" else ["--robot", "even"]
    with apart.at_work(
        "view", *words, "--no-browser", when=lambda: True, cwd=tmp_path,
        env=_quiet_home(tmp_path),
    ) as process:  # fmt: skip
        first = process.stdout.readline()
        assert first.startswith("open http://127.0.0.1:"), first
        address = first.split()[1]
        with urllib.request.urlopen(address) as page:
            assert b"<canvas" in page.read()
        with urllib.request.urlopen(f"{address}model") as model:
            assert len(model.read()) > 100_000
        port = int(address.rstrip("/").rsplit(":", 1)[1])
        assert _listening(port) == {"0100007F"}, "on the loopback address alone"
        ended = apart.interrupt(process)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out == "", "nothing happens before somebody looks"


def _quiet_home(folder) -> dict[str, str]:
    """Without a display; and Studio keeps its settings in the home folder."""
    hidden = ("DISPLAY", "WAYLAND_DISPLAY")
    return {k: v for k, v in os.environ.items() if k not in hidden} | {"HOME": str(folder)}


def _listening(port: int) -> set[str]:
    """Addresses that a port listens on, as Linux writes them; of IPv6, too."""
    found = set()
    for table in ("tcp", "tcp6"):
        with open(f"/proc/net/{table}") as file:
            for line in file.readlines()[1:]:
                _, local, _, state = line.split()[:4]
                address, its_port = local.split(":")
                if int(its_port, 16) == port and state == "0A":
                    found.add(address)
    return found


def test_two_at_once_take_two_ports(apart, tmp_path):
    env = _quiet_home(tmp_path)
    with (
        apart.at_work("view", when=lambda: True, cwd=tmp_path, env=env) as one,
        apart.at_work("view", when=lambda: True, cwd=tmp_path, env=env) as other,
    ):
        addresses = {process.stdout.readline().split()[1] for process in (one, other)}
        assert len(addresses) == 2
        assert [apart.interrupt(process).code for process in (one, other)] == [0, 0]
