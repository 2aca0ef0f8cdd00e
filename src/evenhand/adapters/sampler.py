"""Groups for episodes of environments that know nobody: drawn, and invented for the purpose."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.scheme import Scheme

Sampler = Callable[[int, np.random.Generator], np.ndarray]
"""From how many and a source of randomness to codes of groups, int [n, D], -1 for not known."""

BLOCK = 512
"""People are drawn so many at a time, so that a lane's people do not depend on other lanes."""


def invented(scheme: Scheme, shares: Mapping[str, Sequence[float]] | None = None) -> Sampler:
    """People drawn at random, each identity for itself.

    Args:
        scheme: whose identities.
        shares: of the groups of an identity, in their order, summing to 1; all groups of an
            identity that is not named are as frequent.

    Raises:
        InputError: for an unknown identity, or shares that are negative, too few, too many, or do
            not sum to 1.
    """
    chosen = dict(shares or {})
    for name in chosen:
        if name not in scheme.names:
            raise unknown("identity", name, scheme.names)
    limits = []
    for one in scheme.identities:
        size = len(one.groups)
        share = np.asarray(chosen.get(one.name, np.full(size, 1 / size)), float)
        if share.shape != (size,) or not (share >= 0).all() or abs(share.sum() - 1) > 1e-6:
            raise InputError(
                "range shares",
                f"shares of {one.name!r} are {share.tolist()}: give {size} numbers of at least 0 "
                f"that sum to 1, for {', '.join(one.groups)}",
            )
        limits.append(np.cumsum(share)[:-1])

    def draw(n: int, rng: np.random.Generator) -> np.ndarray:
        drawn = rng.random((n, len(limits)))
        columns = [limit.searchsorted(drawn[:, d], side="right") for d, limit in enumerate(limits)]
        return np.stack(columns, axis=1)

    return draw


class Queue:
    """Who is served next in each lane; every lane draws from a stream of its own."""

    def __init__(
        self, sampler: Sampler, rng: np.random.Generator, lanes: int, scheme: Scheme
    ) -> None:
        """Draw the first people."""
        self._sampler, self._scheme = sampler, scheme
        self._rngs = rng.spawn(lanes)
        self._codes = np.zeros((lanes, 2 * BLOCK, len(scheme.identities)), np.int64)
        for lane in range(lanes):
            for half in (slice(0, BLOCK), slice(BLOCK, None)):
                self._codes[lane, half] = self._draw(lane)
        self._place = np.zeros(lanes, np.int64)

    def state(self) -> dict[str, np.ndarray]:
        """All that `restore` needs, as arrays by name."""
        states = [json.dumps(rng.bit_generator.state, default=list) for rng in self._rngs]
        return {
            "queue.codes": self._codes.copy(),
            "queue.place": self._place.copy(),
            "queue.rngs": np.array(states),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on where another queue of as many lanes stood.

        Raises:
            InputError: when it had other lanes or identities.
        """
        codes = np.asarray(state.get("queue.codes", np.zeros(0)))
        if codes.shape != self._codes.shape:
            raise InputError(
                "shape state",
                f"what was saved of people has shape {codes.shape}, and here it is "
                f"{self._codes.shape}: keep the number of environments and the identities",
            )
        self._codes, self._place = codes.copy(), np.array(state["queue.place"])
        for rng, text in zip(self._rngs, state["queue.rngs"].tolist(), strict=True):
            rng.bit_generator.state = json.loads(text)

    def now(self, ahead: np.ndarray | int = 0) -> np.ndarray:
        """Who is served now, codes int64 [n, D].

        Args:
            ahead: episodes of each lane that have ended without `serve` being told yet, [n].
        """
        return self._codes[np.arange(len(self._place)), self._place + ahead]

    def serve(self, lane: np.ndarray, rank: np.ndarray) -> np.ndarray:
        """Who was served in episodes that have ended; their lanes go on to the next person.

        Args:
            lane: of each episode, int [m].
            rank: how many of the others were in the same lane before it, [m].

        Returns:
            Codes, int64 [m, D].
        """
        served = np.empty((len(lane), self._codes.shape[2]), np.int64)
        before = np.zeros(len(self._place), np.int64)
        for first in range(0, len(lane), BLOCK):  # so many at most are drawn ahead
            part = slice(first, first + BLOCK)
            of = lane[part]
            served[part] = self._codes[of, self._place[of] + rank[part] - before[of]]
            times = np.bincount(of, minlength=len(before))
            before += times
            self._place += times
            for used in np.flatnonzero(self._place >= BLOCK).tolist():
                self._codes[used, :BLOCK] = self._codes[used, BLOCK:]
                self._codes[used, BLOCK:] = self._draw(used)
                self._place[used] -= BLOCK
        return served

    def _draw(self, lane: int) -> np.ndarray:
        drawn = np.asarray(self._sampler(BLOCK, self._rngs[lane]))
        wanted = (BLOCK, len(self._scheme.identities))
        if drawn.shape != wanted or drawn.dtype.kind not in "iu":
            raise InputError(
                "type sampler",
                f"the sampler of people gave {drawn.dtype} of shape {drawn.shape} for {BLOCK} "
                f"people: give whole numbers of shape {wanted}, one column an identity",
            )
        for d, one in enumerate(self._scheme.identities):
            odd = (drawn[:, d] < -1) | (drawn[:, d] >= len(one.groups))
            if odd.any():
                raise InputError(
                    "range sampler",
                    f"the sampler of people gave {drawn[odd, d][0]} for {one.name!r}, which takes "
                    f"0 to {len(one.groups) - 1}, or -1 for not known",
                )
        return drawn
