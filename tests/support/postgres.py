"""A PostgreSQL server of the tests' own."""

import contextlib
import glob
import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PASSWORD = "s3cr@t/4"


def programs() -> Path | None:
    """Where initdb and postgres are."""
    for found in (shutil.which("initdb"), *sorted(glob.glob("/usr/lib/postgresql/*/bin/initdb"))):
        if found and (Path(found).resolve().parent / "postgres").exists():
            return Path(found).resolve().parent
    return None


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextlib.contextmanager
def server(binaries: Path) -> Iterator[str]:
    """A PostgreSQL server that is gone afterwards; it refuses to run as root."""
    nobody = pwd.getpwnam("nobody")
    other: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "password").write_text(PASSWORD)
        if os.geteuid() == 0:
            other = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
            for one in (folder, folder / "password"):
                os.chown(one, nobody.pw_uid, nobody.pw_gid)
        made = subprocess.run(
            [binaries / "initdb", "-D", folder / "data", "-U", "auditor", "-A", "scram-sha-256",
             f"--pwfile={folder / 'password'}", "-E", "UTF8", "--locale=C", "--no-sync"],
            cwd="/", capture_output=True, text=True, check=False, **other,
        )  # fmt: skip
        assert made.returncode == 0, made.stderr
        port = free_port()
        with (folder / "log").open("wb") as log:
            running = subprocess.Popen(
                [binaries / "postgres", "-D", folder / "data", "-p", str(port), "-k", folder,
                 "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off"],
                cwd="/", stdout=log, stderr=log, **other,
            )  # fmt: skip
        try:
            while b"ready to accept connections" not in (folder / "log").read_bytes():
                assert running.poll() is None, (folder / "log").read_text()
                time.sleep(0.05)
            yield f"postgres://auditor:s3cr%40t%2F4@127.0.0.1:{port}/postgres"
        finally:
            running.send_signal(signal.SIGINT)  # does not wait for whoever is connected
            running.wait()
