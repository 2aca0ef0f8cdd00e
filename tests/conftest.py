"""What every test starts from: the same examples each time, one CPU, nothing skipped in CI."""

import os
from collections.abc import Callable

import pytest
from hypothesis import settings

os.environ["JAX_PLATFORMS"] = "cpu"  # before anything imports jax
# Several tests run at once, and threads that wait for each other cost more than they help.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The same examples on every run, and no verdict by the clock.
settings.register_profile("evenhand", derandomize=True, deadline=None)
settings.load_profile("evenhand")


@pytest.fixture(scope="session")
def require() -> Callable[[bool, str], None]:
    """``require(present, what)``: skip a test that lacks something of the machine.

    With EVENHAND_REQUIRE_ALL=1, as in CI, the test fails instead, so that nothing is skipped
    unseen.
    """

    def check(present: bool, what: str) -> None:
        if present:
            return
        if os.environ.get("EVENHAND_REQUIRE_ALL") == "1":
            pytest.fail(f"this machine lacks {what}, and EVENHAND_REQUIRE_ALL=1 allows no skip")
        pytest.skip(f"this machine lacks {what}")

    return check
