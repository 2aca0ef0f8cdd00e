"""``evenhand minari``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL, Plugin, Population, Robot, RunFolder, Strength
from evenhand.experiments.settings import TEST_SEED

if TYPE_CHECKING:
    from evenhand.experiments.minari.episodes import Server


@dataclass(frozen=True)
class Minari:
    """Let a trained or a scripted robot serve, and write the services as a Minari dataset.

    Episodes have observations, actions, rewards, and the identities and facts of the service. Each
    is begun with a seed of its own, which stands in the dataset. People are synthetic. Nothing is
    sent; the dataset lies in the folder that you name.

    For instance: evenhand minari out/run --out out/minari, then:
    MINARI_DATASETS_PATH=out/minari python -c "import minari; minari.load_dataset(...)"
    """

    out: Annotated[Path, arg(metavar="FOLDER")]
    """Folder of datasets, the MINARI_DATASETS_PATH of whoever reads them."""

    run_folder: Positional[RunFolder] = None
    """Folder of a run; its last checkpoint serves, in the world of its training."""

    robot: Robot = None
    """Instead of a run, a scripted robot: even, racist, sexist, ageist or ableist."""

    strength: Strength = None
    """Of the scripted robot's bias, 0 to 1."""

    plugin: Plugin = ()

    services: int = 1000
    """Episodes; one takes about 26 kB."""

    seed: int = TEST_SEED
    """Of the first service; every other one has the next seed."""

    population: Population = None
    """Where people are drawn from; that of the run's training, or uniform for a scripted robot."""

    name: Annotated[str | None, arg(metavar="NAME-vN", help_behavior_hint=OPTIONAL)] = None
    """Of the dataset, with a version.
    By default restaurant-, the algorithm or the scripted robot, and -v0."""

    author: Annotated[tuple[str, ...], arg(metavar="NAME ...", help_behavior_hint=OPTIONAL)] = ()
    """Who publishes the dataset; noted in it."""

    email: Annotated[tuple[str, ...], arg(metavar="TEXT ...", help_behavior_hint=OPTIONAL)] = ()
    """Where they can be reached; noted in it."""

    def run(self, command: str) -> int:
        """Serve, write, print where the dataset is."""
        inputs.check_server(self.run_folder, self.robot, self.strength)
        inputs.load_physics("minari")
        from evenhand.core import terminal
        from evenhand.experiments.minari import dataset as minari_data

        minari_data.check()
        server = self._server()
        dataset = minari_data.Dataset(
            self.name or f"restaurant-{server.name}-v0", self.author, self.email
        )
        with terminal.stages() as stage:
            tell = stage(server.name, self.services)
            path = minari_data.write(
                self.out, dataset, server, self.services, self.seed, lambda done: tell(done, {})
            )
        print(path)
        return 0

    def _server(self) -> Server:
        from evenhand.experiments.minari import episodes

        if self.run_folder is None:
            strength = 1.0 if self.strength is None else self.strength
            return episodes.scripted(str(self.robot), strength, self.population or "uniform")
        settings, state = inputs.load_policy(self.run_folder)
        return episodes.trained(state, settings, self.population)
