"""People who need to be served in another way: a response that they cannot notice is none.

Off by default (strength 0): everybody notices every response. With strength 1, an assumption of
this simulation with the sizes of the sources below:

* An **elder** hears a response within 1.2 m only. A mild loss of hearing costs 3-7 dB of
  signal-to-noise (Killion et al. 2004, QuickSIN); sound falls by 6 dB when the distance doubles, so
  5 dB take what is understood at 2.1 m down to 1.2 m. An elder also signals late: 0.5-1.5 s after
  the robot was called, and does not look at it before.
* Who sits in a **wheelchair** and is no elder needs the robot 1.3 m away or farther to turn to it:
  the footrests stand 0.6-0.7 m before the middle of the chair (ISO 7176-5: at most 1.3 m long).

Both windows lie within 1.0-1.5 m, so everybody can be served without an issue by a robot that goes
by whom it serves, and not by one that treats all alike. Ranges: reach 1.2-1.5 m, room 1.0-1.3 m,
both in proportion to the strength.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError

_ELDER, _WHEELCHAIR = 4, 0
_REACH, _ROOM = 0.3, 0.3
"""Metres by which the window of 1.0-1.5 m is narrowed at strength 1."""
_SIGNAL = (25.0, 75.0)
"""Physics steps after which an elder signals, at strength 1."""


@dataclass(frozen=True)
class NeedSettings:
    """Who needs another service.

    Attributes:
        strength: 0 (nobody) to 1 (as described above).
    """

    strength: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.strength <= 1.0:
            raise InputError("range needs", f"strength of needs is {self.strength}: give 0 to 1")


@dataclass(frozen=True)
class Needs:
    """When N people notice a response.

    Attributes:
        room: least distance, metres, [N].
        reach: greatest distance, metres, [N].
        signal: physics steps that must have passed, [N].
    """

    room: np.ndarray
    reach: np.ndarray
    signal: np.ndarray


def draw(settings: NeedSettings, codes: np.ndarray, rng: np.random.Generator) -> Needs:
    """Needs of the people who ask.

    Args:
        settings: how strong.
        codes: identities, int64 [N, 5].
        rng: moments of signals; not used at strength 0.
    """
    n, strength = len(codes), settings.strength
    if strength == 0.0:
        return Needs(np.zeros(n), np.full(n, np.inf), np.zeros(n))
    elder = codes[:, 2] == _ELDER
    wheelchair = (codes[:, 3] == _WHEELCHAIR) & ~elder
    return Needs(
        room=np.where(wheelchair, 1.0 + _ROOM * strength, 0.0),
        reach=np.where(elder, 1.5 - _REACH * strength, np.inf),
        signal=np.where(elder, strength * rng.uniform(*_SIGNAL, n), 0.0),
    )
