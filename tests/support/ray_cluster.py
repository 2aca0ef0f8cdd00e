"""A Ray cluster of two machines that are none: two nodes of one CPU each, on loopback alone."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from support import disks

HEAD, OTHER = "127.0.0.2", "127.0.0.3"
QUIET = {"RAY_USAGE_STATS_ENABLED": "0"}
_START = (
    sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--num-cpus=1",
    "--object-store-memory=100000000", "--disable-usage-stats",
)  # fmt: skip


@dataclass(frozen=True)
class Cluster:
    """Both nodes, and where the head listens."""

    address: str
    head: subprocess.Popen[bytes]
    other: subprocess.Popen[bytes]

    def kill_other(self) -> None:
        """The other machine is gone from one moment to the next."""
        _kill(self.other)


@contextlib.contextmanager
def two_nodes(hidden: Path) -> Iterator[Cluster]:
    """Start them; both are gone in the end.

    Args:
        hidden: a folder that the other node sees empty, where that can be arranged: machines
            need not share a disk.
    """
    with socket.socket() as probe:
        probe.bind((HEAD, 0))
        port = probe.getsockname()[1]
    address = f"{HEAD}:{port}"
    scratch = tempfile.mkdtemp(prefix="ray-", dir="/tmp")  # a short path, for it names sockets
    started: list[subprocess.Popen[bytes]] = []
    try:
        head = _started(
            *_START, "--head", f"--node-ip-address={HEAD}", f"--port={port}",
            f"--temp-dir={scratch}", "--include-dashboard=false",
        )  # fmt: skip
        started.append(head)
        _wait(address, head)
        words = (*_START, f"--address={address}", f"--node-ip-address={OTHER}")
        if disks.ALONE:
            script = 'mount -t tmpfs tmpfs "$0" && exec "$@"'
            words = (*disks.ALONE, script, str(hidden), *words)
        started.append(_started(*words))
        _wait_for_nodes(address, 2)
        yield Cluster(address, *started)
    finally:
        for process in started:
            _kill(process)
        shutil.rmtree(scratch, ignore_errors=True)


def _started(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        words,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=os.environ | QUIET,
    )


def _kill(process: subprocess.Popen[bytes]) -> None:
    """All processes of a node are of its group."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _wait(address: str, process: subprocess.Popen[bytes]) -> None:
    host, port = address.split(":")
    while True:
        assert process.poll() is None, "the head of the cluster did not start"
        with contextlib.suppress(OSError):
            socket.create_connection((host, int(port)), timeout=1.0).close()
            return
        time.sleep(0.1)


def _wait_for_nodes(address: str, count: int) -> None:
    script = (
        "import sys, time, ray\n"
        "ray.init(sys.argv[1], log_to_driver=False, logging_level='ERROR')\n"
        "while sum(node['Alive'] for node in ray.nodes()) < int(sys.argv[2]): time.sleep(0.1)\n"
    )
    words = [sys.executable, "-c", script, address, str(count)]
    subprocess.run(words, check=True, timeout=120, capture_output=True, env=os.environ | QUIET)
