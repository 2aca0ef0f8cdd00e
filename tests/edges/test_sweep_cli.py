"""`evenhand sweep`: what cannot be meant, and clusters that are none, before any work begins."""

import socket
import sys
import threading
from importlib.util import find_spec

import pytest

from evenhand.core.extras import install
from evenhand.experiments.sweep import ray

GOOD = 'scenarios = ["tips"]\narms = ["service"]\nseeds = 1\n'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(GOOD)
    return path


def test_no_file(cli):
    assert cli("sweep").complaint == (
        "name the file of a sweep; `evenhand sweep --example > sweep.toml` writes one"
    )
    assert cli("sweep", "no.toml").complaint == "no.toml cannot be read: No such file or directory"


def test_the_example_can_be_swept(cli, tmp_path):
    shown = cli("sweep", "--example")
    assert (shown.code, shown.err) == (0, "")
    (tmp_path / "own.toml").write_text(shown.out.replace("epochs = 300", "epochs = 0"))
    assert cli("sweep", "own.toml").complaint == (
        "own.toml, line 20, epochs: epochs is 0: give a whole number from 2 to 100000"
    )


def test_every_mistake_is_a_line(cli, tmp_path):
    (tmp_path / "s.toml").write_text(GOOD + 'algorithm = ["ppo"]\n[settings]\nclp = 1\n')
    ended = cli("sweep", "s.toml")
    assert (ended.code, ended.out) == (2, "")
    first, second = ended.err.splitlines()
    assert first.startswith(
        "evenhand: s.toml, line 4, algorithm: unknown key 'algorithm': did you mean 'algorithms'?"
    )
    assert second.startswith(
        "evenhand: s.toml, line 6, settings.clp: unknown key 'clp': did you mean 'clip'?"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.toml"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--workers", "0"), "workers is 0: give a whole number from 1 to 64"),
        (("--workers", "65"), "workers is 65: give a whole number from 1 to 64"),
        (("--out", "s.toml"), "s.toml is a file, not a folder: give another one"),
        (("--out", "/proc/x"), "folder /proc/x cannot be written (No such file or directory)"),
        (("--ray", "ray://127.0.0.1:1"), "--ray is 'ray://127.0.0.1:1': give HOST:PORT"),
        (("--ray", "auto"), "--ray is 'auto': give HOST:PORT of the head of a Ray cluster"),
        (("--ray", "127.0.0.1:99999"), "--ray is '127.0.0.1:99999': give HOST:PORT"),
    ],
)
def test_what_cannot_be_meant(cli, file, words, said):
    assert said in cli("sweep", file, *words).complaint
    assert [path.name for path in file.parent.iterdir()] == ["s.toml"]


# --- clusters that are none ---

REMEDY = (
    "start the cluster with `ray start --head`, run this on one of its machines, and give the "
    "address that it prints"
)


@pytest.fixture
def deaf():
    """A port that takes calls and never answers; its address."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        calls = []

        def listen() -> None:
            try:
                while True:
                    calls.append(server.accept()[0])
            except OSError:  # closed
                return

        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
    thread.join()
    for call in calls:
        call.close()


def test_nobody_there(cli, file):
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    assert cli("sweep", file, "--ray", address).complaint == (
        f"nothing answers at {address} (Connection refused): {REMEDY}"
    )
    assert [path.name for path in file.parent.iterdir()] == ["s.toml"]


def test_somebody_else_there(cli, file, deaf, require, monkeypatch):
    require(find_spec("ray") is not None, "Ray: the extra ray")
    monkeypatch.setattr(ray, "PATIENCE", 3)
    assert cli("sweep", file, "--ray", deaf).complaint == (
        f"the Ray cluster at {deaf} cannot be used (it does not answer as Ray does): {REMEDY}"
    )
    assert [path.name for path in file.parent.iterdir()] == ["s.toml"]


def test_without_ray(cli, file, deaf, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    said = cli("sweep", file, "--ray", deaf).complaint
    assert said == f"--ray needs the package ray: {install('ray')}"
