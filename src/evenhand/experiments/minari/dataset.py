"""Services of a robot as a Minari dataset: episodes for offline reinforcement learning.

People, places and readings are synthetic, and the dataset says so. Minari is used to write files
and for nothing else: no network.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import gymnasium as gym
import numpy as np

from evenhand import __version__
from evenhand.core import extras, files
from evenhand.core.errors import InputError, whole
from evenhand.experiments.minari.episodes import ENVIRONMENT, Server, episodes
from evenhand.experiments.settings import SEEDS, SERVICES
from evenhand.restaurant import people

if TYPE_CHECKING:
    from minari.data_collector.episode_buffer import EpisodeBuffer

_ID = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*-v[0-9]+")
_FORMAT = "hdf5"
_WITHOUT = r"`(code_permalink|author|author_email|eval_env)` is set to None"
"""What Minari warns of: whoever publishes the data says it, and Evenhand knows no such link."""


@dataclass(frozen=True)
class Dataset:
    """What the dataset is called, and whose it is.

    Attributes:
        name: its identifier, with a version: ``restaurant-ppo-v0``.
        authors: who publishes it; may be empty.
        emails: where they can be reached; may be empty.
    """

    name: str
    authors: tuple[str, ...] = ()
    emails: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _ID.fullmatch(self.name):
            raise InputError(
                "format name",
                f"a dataset cannot be called {self.name!r}: give letters, digits, - and _, and a "
                "version at the end, as restaurant-ppo-v0",
            )


def check() -> None:
    """Before long work: is Minari there?"""
    extras.require("minari", "a Minari dataset")


def write(
    folder: str | os.PathLike[str],
    dataset: Dataset,
    server: Server,
    services: int,
    seed: int,
    tell: Callable[[int], None] = lambda done: None,
) -> Path:
    """Let a robot serve, and write a dataset that ``minari.load_dataset`` reads.

    Returns:
        Folder of the dataset.

    Raises:
        InputError: without Minari, when there is such a dataset already, or the folder cannot be
            written.
    """
    check()
    whole("services", services, 1, SERVICES[1])
    whole("seed", seed, *SEEDS)
    root = files.make_folder(folder)
    target = root / dataset.name
    if target.exists():
        raise InputError(
            "duplicate file",
            f"{target} is there already: give the dataset another version, or delete that one",
        )
    aside = root / f".{dataset.name}.{os.getpid()}.part"
    try:
        with _datasets_in(aside), _as_input_error(target):
            _create(dataset, server, _buffers(server, services, seed, tell), services, seed)
            os.replace(aside / dataset.name, target)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return target


def _buffers(
    server: Server, services: int, seed: int, tell: Callable[[int], None]
) -> list[EpisodeBuffer]:
    from minari.data_collector.episode_buffer import EpisodeBuffer

    names = [identity.name for identity in people.IDENTITIES]
    found = []
    for one in episodes(server, services, seed):
        codes = dict(zip(names, one.identities.tolist(), strict=True))
        found.append(
            EpisodeBuffer(
                seed=one.seed,
                observations=one.observations,  # type: ignore[arg-type]
                actions=one.actions,  # type: ignore[arg-type]
                rewards=one.rewards,  # type: ignore[arg-type]
                terminations=one.terminations,  # type: ignore[arg-type]
                # the time is part of the state, so its end is no truncation
                truncations=np.zeros(len(one.actions), bool),  # type: ignore[arg-type]
                infos={"identities": codes, "facts": one.facts},
            )
        )
        tell(1)
    return found


def _create(
    dataset: Dataset, server: Server, buffers: list[EpisodeBuffer], services: int, seed: int
) -> None:
    import minari

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", _WITHOUT, UserWarning)
        made = minari.create_dataset_from_buffers(
            dataset.name,
            buffers,
            env=gym.make(ENVIRONMENT, **server.world).spec,
            algorithm_name=server.name,
            author=set(dataset.authors) or None,
            author_email=set(dataset.emails) or None,
            description=_description(server, services, seed),
            requirements=[f"evenhand=={__version__}"],
            data_format=_FORMAT,
        )
    made.storage.update_metadata(
        {
            "synthetic": True,
            "seeds": [seed, seed + services - 1],
            "robot": server.facts,
            "identities": {one.name: list(one.groups) for one in people.IDENTITIES},
        }
    )


def _description(server: Server, services: int, seed: int) -> str:
    return (
        f"{services} services in a simulated restaurant by {server.about}. The people are "
        "synthetic: their identities are drawn by chance, and nobody took part. Episode i was "
        f"begun with reset(seed={seed} + i). infos has codes of the identities of who asked (their "
        "names are in the metadata) and the facts of the service; a fact that a service lacks is "
        "NaN. Import evenhand.restaurant before the environment is recovered."
    )


@contextlib.contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Minari looks for its folder in the environment, and by default in that of the user."""
    name = "MINARI_DATASETS_PATH"
    before = os.environ.get(name)
    os.environ[name] = str(folder.resolve())
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


@contextlib.contextmanager
def _as_input_error(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            "unavailable file", f"{target} cannot be written: {error.strerror or error}"
        ) from error
