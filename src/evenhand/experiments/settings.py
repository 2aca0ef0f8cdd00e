"""What can be set in the experiment, and its seeds; imports nothing heavy."""

from dataclasses import dataclass
from pathlib import Path

from evenhand.core.errors import InputError, unknown, whole
from evenhand.core.processors import CORES

PRESETS = ("paper", "service", "prejudiced")
"""Rewards, as ``training.settings`` knows them; prejudiced is preset service in that scenario."""
TEST_SEED = 1_000_000
"""Added to the seed of a run: people of the test are never those of training."""
DEMO_SEED = 2_000_000
"""Of demonstrations and study."""
SERVICES = (300, 100_000)
"""Fewest and most services in a test; more do not fit into 1.5 GB at once."""
WINDOWS = (100, 100_000)
"""Fewest and most windows in a study."""
WORKERS = (1, 64)
"""Fewest and most processes."""
SEEDS = (0, 2**32 - 1)
"""Least and greatest seed."""


@dataclass(frozen=True)
class ReproduceSettings:
    """The experiment."""

    out: Path = Path("out/reproduce")
    """Folder of the report and of everything behind it."""

    preset: tuple[str, ...] = PRESETS[:2]
    """Rewards to train on: paper (Eq. 4/5 alone), service (service quality plus Eq. 4/5), and
    prejudiced: service by robots that imitated biased ones first, where there is something to
    lower."""

    seeds: int = 3
    """Runs of every arm, with seeds 0, 1, 2 ..."""

    epochs: int = 300
    """Updates of every run; an epoch is 30 services."""

    workers: int = CORES
    """Processes that work at the same time."""

    population: str = "uniform"
    """Where people are drawn from."""

    windows: int = 1000
    """Windows of 30 services that simulated respondents judge."""

    services: int = 3000
    """Services in the test of every trained robot."""

    def __post_init__(self) -> None:
        for name in self.preset:
            if name not in PRESETS:
                raise unknown("preset", name, PRESETS)
        if not self.preset:
            raise InputError(
                "missing preset", f"no preset is given: choose from {', '.join(PRESETS)}"
            )
        if len(set(self.preset)) < len(self.preset):
            raise InputError(
                "duplicate preset", f"a preset is given twice: {', '.join(self.preset)}"
            )
        from evenhand.restaurant import people

        people.population(self.population)
        whole("seeds", self.seeds, 1, 1000)
        whole("epochs", self.epochs, 40, 100_000)
        whole("workers", self.workers, *WORKERS)
        whole("windows", self.windows, *WINDOWS)
        whole("services", self.services, *SERVICES)
