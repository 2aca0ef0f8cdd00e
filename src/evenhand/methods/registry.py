"""The methods by name: what the command line, sweeps, figures and run folders know of them.

A method is a frozen dataclass; its fields are its settings. It has

    begin(scheme) -> memory                 before the first epoch
    teach(epoch, memory) -> result, memory  after every epoch

where the memory is arrays and numbers in dataclasses, tuples, lists or dicts, the epoch is a
`methods.epoch.Epoch`, and the result is rewards of the services [n], advantages of their
decisions [n, L], or a `methods.guidance.Guidance`. It may also have

    alone(epoch) -> rewards [n]             where evenness is all that is rewarded (preset paper)
    pay(services, window, memory) -> [m]    what is added to rewards, by what a window has shown
    worth(answers, memory) -> [n, A]        of services with other answers; by default by ``pay``
    direction(answers, memory) -> [n, A]    the same towards evenness alone, with `DIRECTION`
    needs                                   `VERDICT`, `DIRECTION`, `BLINDNESS`, `PREPROCESSING`

Wrappers ask ``pay`` before a window is over. Answers are `methods.epoch.Answers`.
"""

from __future__ import annotations

import importlib
import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from math import isfinite
from typing import Any, Protocol, TypeVar

from evenhand.core import plugins
from evenhand.core.errors import InputError, unknown

VERDICT, DIRECTION, BLINDNESS = "verdict", "direction", "blindness"
PREPROCESSING = "preprocessing"
"""A detector that judges epochs; a learner that follows a second direction; observations that hide
whom the robot serves; observations in which nothing depends on whom it serves."""
GROUP = "evenhand.methods"
"""Entry point by which packages bring methods."""
BUILT_IN: Mapping[str, str] = {
    "service": "printed",
    "score": "printed",
    "penalty": "printed",
    "influence": "beyond.influence",
    "surgery": "beyond.surgery",
    "levelup": "beyond.levelup",
    "blind": "controls.blind",
    "blind_spend": "controls.blind_spend",
    "unaware": "controls.unaware",
    "lagrangian": "rivals.lagrangian",
    "a_ppo": "rivals.a_ppo",
    "r_ppo": "rivals.r_ppo",
    "elbert": "rivals.elbert",
    "group_dro": "rivals.group_dro",
    "ggf": "rivals.ggf",
    "fair_ppo": "rivals.fair_ppo",
    "counterfactual": "rivals.counterfactual",
}
"""Methods that come with Evenhand, in the order in which they are listed, and their modules."""

Class = TypeVar("Class", bound=type)


class Method(Protocol):
    """A way to serve."""

    def begin(self, scheme: Any) -> Any:
        """Memory before the first epoch."""
        ...

    def teach(self, epoch: Any, memory: Any) -> tuple[Any, Any]:
        """Rewards [n], advantages [n, L] or a ``Guidance``, and the memory from now on."""
        ...


@dataclass(frozen=True)
class Entry:
    """A method as it was registered.

    Attributes:
        name: by which it is named everywhere.
        kind: its class.
        label: for readers, in figures and tables.
        colour: in figures; None for one that is free.
        marker: of Matplotlib; None for one that is free.
        filled: whether markers are filled.
        own: whether it is Evenhand's own contribution.
        strength: the field that an @ sets; None if there is none.
    """

    name: str
    kind: type
    label: str
    colour: str | None
    marker: str | None
    filled: bool
    own: bool
    strength: str | None


_entries: dict[str, Entry] = {}


def method(
    name: str,
    *,
    strength: float | None = None,
    field: str = "strength",
    label: str | None = None,
    colour: str | None = None,
    marker: str | None = None,
    filled: bool = True,
    own: bool = False,
) -> Callable[[Class], Class]:
    """Register a class as a method; it becomes a frozen dataclass if it is none.

    Args:
        name: by which the command line, sweeps and tables know it.
        strength: default of its strength, which ``NAME@STRENGTH`` sets. The class needs no field
            of that name; without ``strength`` and field, the method has none.
        field: the setting that is the strength.
        label: for figures and tables; the name by default.
        colour: in figures, as Matplotlib names colours; one that is free by default.
        marker: in figures; one that is free by default.
        filled: whether markers are filled.
        own: whether it is Evenhand's own contribution.

    Raises:
        InputError: for a name that is taken or cannot be one, or a class that cannot be a method.
    """

    def register(kind: Class) -> Class:
        if not name or not name.replace("_", "").replace("-", "").isalnum():
            raise InputError(
                "format name", f"method {name!r}: give a name of letters, digits, - and _"
            )
        _check_free(name, kind)
        for needed in ("begin", "teach"):
            if not callable(getattr(kind, needed, None)):
                raise InputError(
                    f"missing {needed}",
                    f"method {name!r} has no {needed}: add it to {kind.__name__}",
                )
        if strength is not None and not is_dataclass(kind):
            kind.__annotations__ = inspect.get_annotations(kind) | {field: float}
            setattr(kind, field, strength)
        if not is_dataclass(kind):
            if "__init__" in vars(kind):
                raise InputError(
                    "unsupported __init__",
                    f"method {name!r} has an __init__: make its settings fields of a dataclass",
                )
            kind = dataclass(frozen=True)(kind)
        elif not kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
            raise InputError(
                "unsupported method",
                f"method {name!r} is a dataclass that can change: make it frozen",
            )
        names = [one.name for one in fields(kind)]
        lacking = [
            one.name
            for one in fields(kind)
            if one.default is MISSING and one.default_factory is MISSING
        ]
        if lacking:
            raise InputError(
                "missing default", f"method {name!r}: give {', '.join(lacking)} a default"
            )
        if strength is not None and (field not in names or getattr(kind(), field) != strength):
            raise InputError(
                f"conflict {field}",
                f"method {name!r}: give {field} the default {strength} in the class",
            )
        has = field if field in names else None
        _entries[name] = Entry(name, kind, label or name, colour, marker, filled, own, has)
        return kind  # type: ignore[return-value]

    return register


def _check_free(name: str, kind: type) -> None:
    module = f"{__package__}.{BUILT_IN.get(name)}"
    other = _entries[name].kind if name in _entries else None
    # a cell that is run again defines the same class again
    again = other and (other.__module__, other.__qualname__) == (kind.__module__, kind.__qualname__)
    if (other is not None and not again) or (name in BUILT_IN and kind.__module__ != module):
        where = f"by {other.__module__}" if other and name not in BUILT_IN else "with Evenhand"
        raise InputError(
            "duplicate method", f"method {name!r} is there already, {where}: choose another name"
        )


def names() -> tuple[str, ...]:
    """Names of all methods, those that come with Evenhand first."""
    plugins.ready(GROUP)
    return (*BUILT_IN, *(name for name in _entries if name not in BUILT_IN))


def entry(name: str) -> Entry:
    """A method as it was registered.

    Raises:
        InputError: when there is none of that name.
    """
    if name not in _entries and name in BUILT_IN:
        importlib.import_module(f"{__package__}.{BUILT_IN[name]}")
    if name not in _entries and name not in names():
        hint = unknown("method", name, names())
        raise InputError(
            "unknown method", f"{hint}; the file of an own method is named by --plugin"
        )
    return _entries[name]


def parted(text: str) -> tuple[str, float | None]:
    """Name and strength of ``NAME`` or ``NAME@STRENGTH``.

    Raises:
        InputError: for an unknown name, or a strength that is none.
    """
    name, mark, after = text.partition("@")
    if not mark:
        return entry(name).name, None
    if entry(name).strength is None:
        raise InputError("unsupported strength", f"{text}: {name} has no strength, drop @{after}")
    try:
        strength = float(after) + 0.0  # which makes -0.0 the other zero
        if not isfinite(strength) or strength < 0:
            raise ValueError
    except ValueError:
        raise InputError(
            "range strength", f"{text}: give a finite strength of at least 0 after the @"
        ) from None
    return name, strength


def spelled(name: str, strength: float | None) -> str:
    """The inverse of `parted`: the one way in which a method is written."""
    if strength is None:
        return name
    short = f"{strength:g}"
    return f"{name}@{short if float(short) == strength else repr(strength)}"


def create(text: str, **settings: Any) -> Any:
    """A method by ``NAME`` or ``NAME@STRENGTH``.

    Args:
        text: which.
        **settings: its fields; defaults for what is not given.

    Raises:
        InputError: for a name or a setting that does not exist, or a value out of range.
    """
    name, strength = parted(text)
    found = entry(name)
    known = [one.name for one in fields(found.kind)]
    for given in settings:
        if given not in known:
            if not known:
                raise InputError(
                    "unsupported settings", f"method {name} has no settings: leave {given} out"
                )
            raise unknown(f"setting of {name}", given, known)
    if strength is not None and found.strength is not None:
        settings = {found.strength: strength} | settings
    return found.kind(**settings)


def as_method(value: Any) -> Any:
    """A method from its name, or itself.

    Raises:
        InputError: for an unknown name, or an object whose class is not registered.
    """
    found = create(value) if isinstance(value, str) else value
    entry_of(found)
    try:
        hash(found)
    except TypeError as error:
        raise InputError(
            "type settings",
            f"settings of method {name_of(found)!r} can change ({error}): give tuples and numbers",
        ) from error
    return found


def entry_of(found: Any) -> Entry:
    """The entry of a method.

    Raises:
        InputError: when its class is not registered.
    """
    for one in _entries.values():
        if type(found) is one.kind:
            return one
    raise InputError(
        "unknown method",
        f"{found!r} is no method: register its class with @evenhand.method, or give a name",
    )


def name_of(found: Any) -> str:
    """Its name."""
    return entry_of(found).name


def strength_of(found: Any) -> float | None:
    """Its strength; None if it has none."""
    field = entry_of(found).strength
    return None if field is None else getattr(found, field)


def needs_of(found: Any) -> frozenset[str]:
    """What it needs beside rewards: of `VERDICT`, `DIRECTION`, `BLINDNESS`, `PREPROCESSING`."""
    return frozenset(getattr(found, "needs", ()))


def described(found: Any) -> dict[str, Any]:
    """A method as JSON holds it: name, settings, and a hash of its source, None for our own."""
    kind = type(found)
    settings = {one.name: getattr(found, one.name) for one in fields(kind)}
    try:
        plain = json.loads(json.dumps(settings, allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InputError(
            "type settings",
            f"settings of method {name_of(found)!r} cannot be written down ({error}): use text, "
            "finite numbers and tuples of them",
        ) from error
    return {"name": name_of(found), "settings": plain, "source": plugins.source_of(kind)}


def restored(noted: Mapping[str, Any]) -> Any:
    """The method that `described` noted.

    Raises:
        InputError: when it is not registered, or has other settings now.
    """
    settings = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in noted["settings"].items()
    }
    return create(noted["name"], **settings)


def changed(found: Any, settings: Mapping[str, str]) -> Any:
    """A method with settings that were given as text.

    Args:
        found: the method.
        settings: texts by name of the field; of tuples, parts follow each other after commas.

    Raises:
        InputError: for a setting that it has not, or a text that is no value of it.
    """
    name, known = name_of(found), [one.name for one in fields(found)]
    values = {}
    for field, text in settings.items():
        if field not in known:
            if not known:
                raise InputError(
                    "unsupported settings", f"method {name} has no settings: leave {field} out"
                )
            raise unknown(f"setting of {name}", field, known)
        values[field] = _read(f"{field} of {name}", text, getattr(found, field))
    return replace(found, **values)


def _read(what: str, text: str, like: Any) -> Any:
    wanted = {bool: "true or false", int: "a whole number", float: "a number"}.get(type(like))
    try:
        if isinstance(like, bool):
            return {"true": True, "false": False}[text.lower()]
        if isinstance(like, tuple):
            first = like[0] if like else 0.0
            return tuple(_read(what, part, first) for part in text.split(","))
        return type(like)(text) if wanted else text
    except (KeyError, ValueError):
        field = what.partition(" ")[0]
        raise InputError(f"type {field}", f"{what} is {text!r}: give {wanted}") from None
