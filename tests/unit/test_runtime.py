"""How JAX is set up: where compiled functions are kept, and what happens when they cannot be."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from evenhand.training.jax_setup import cache_folder

SCRIPT = """
import os
from evenhand.training.jax_setup import set_up_jax
kept = set_up_jax()
import jax, jax.numpy as jnp
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
print(kept)
print(jax.default_backend())
print(float(jax.jit(lambda x: jnp.tanh(x) @ x)(jnp.ones(3))))
print(os.environ["XLA_FLAGS"])
"""


def run(cache: Path, flags: str = "") -> list[str]:
    environment = {**os.environ, "EVENHAND_CACHE": str(cache), "XLA_FLAGS": flags}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_compiled_functions_are_kept_and_used_again(tmp_path):
    kept, backend, number, flags = run(tmp_path)
    assert backend == "cpu"
    assert flags == "--xla_cpu_multi_thread_eigen=false"
    files = {path: path.stat().st_mtime_ns for path in Path(kept).iterdir()}
    assert files
    assert tmp_path in Path(kept).parents
    again = run(tmp_path)
    assert again[2] == number
    assert {path: path.stat().st_mtime_ns for path in Path(kept).iterdir()} == files


def test_a_damaged_entry_is_compiled_anew(tmp_path):
    kept, _, number, _ = run(tmp_path)
    for path in Path(kept).iterdir():
        path.write_bytes(path.read_bytes()[:50])
    assert run(tmp_path)[2] == number


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    kept, backend, _, flags = run(blocked, "--xla_cpu_enable_fast_math=false")
    assert kept == "None"
    assert backend == "cpu"
    assert flags == "--xla_cpu_enable_fast_math=false --xla_cpu_multi_thread_eigen=false"
    assert blocked.read_text() == "not a folder"


@pytest.mark.parametrize(
    ("own", "shared", "expected"),
    [
        ("/a", "/b", "/a"),
        (None, "/b", "/b/evenhand"),
        ("", "/b", "/b/evenhand"),
        (None, None, "/h/.cache/evenhand"),
        (None, "", "/h/.cache/evenhand"),
    ],
)
def test_the_cache_folder_follows_the_environment(monkeypatch, own, shared, expected):
    monkeypatch.setenv("HOME", "/h")
    for name, value in (("EVENHAND_CACHE", own), ("XDG_CACHE_HOME", shared)):
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    assert cache_folder() == Path(expected)
