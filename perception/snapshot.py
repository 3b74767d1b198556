"""Everything a perception method remembers, as named arrays, and back: what lets a replay begin in the middle.

The walk is over the objects themselves, so that a field added to a method is remembered here the same day. What a
method is told and never changes (its configuration, its models, `settings`) is left out, and so is what its class
lists as `SCRATCH`: that is written anew before each use, also by those who only look on. What it lists as `LATER`
older programs did not remember: a snapshot of theirs may lack it.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Snapshot: TypeAlias = dict[str, NDArray[Any]]
"""Copies of all that is remembered, by dotted name; a number is an array of no dimension."""

TOLD: Final = "settings"
OURS: Final = "perception."


def snapshot_of(thing: object) -> Snapshot:
    """Return copies of every array and number that `thing` and the parts of it remember."""
    taken: Snapshot = {}
    _take(thing, "", taken)
    return taken


def put_back(thing: object, snapshot: Snapshot) -> None:
    """Overwrite what `thing` remembers with a snapshot of another one made from the same settings.

    Raises
    ------
    ValueError
        The snapshot is of something else: names or shapes differ.
    """
    mine = snapshot_of(thing)
    later = _later(thing, "")
    for name in mine.keys() - snapshot.keys():
        if any(f"{name}.".startswith(f"{held}.") for held in later):
            snapshot = {**snapshot, name: np.zeros_like(mine[name])}
    if mine.keys() != snapshot.keys():
        strange = sorted(mine.keys() ^ snapshot.keys())
        raise ValueError(f"the snapshot is of another method or version: {', '.join(strange[:3])}")
    for name, array in mine.items():
        if array.shape != snapshot[name].shape or array.dtype != snapshot[name].dtype:
            raise ValueError(
                f"the snapshot is of other settings: {name} is {snapshot[name].shape}, not {array.shape}"
            )
    _put(thing, "", snapshot)


def _take(thing: object, path: str, taken: Snapshot) -> None:
    for name, value in _parts(thing):
        if isinstance(value, np.ndarray):
            taken[path + name] = value.copy()
        elif isinstance(value, bool | int | float):
            taken[path + name] = np.array(value)
        else:
            _take(value, f"{path}{name}.", taken)


def _later(thing: object, path: str) -> list[str]:
    """Return the dotted names of what a snapshot may lack, and of what holds such."""
    found = [path + name for name in getattr(type(thing), "LATER", ())]
    for name, value in _parts(thing):
        if not isinstance(value, np.ndarray | bool | int | float):
            found += _later(value, f"{path}{name}.")
    return found


def _put(thing: object, path: str, snapshot: Snapshot) -> None:
    for name, value in _parts(thing):
        if isinstance(value, np.ndarray):
            value[...] = snapshot[path + name]
        elif isinstance(value, bool | int | float):
            setattr(thing, name, type(value)(snapshot[path + name].item()))
        else:
            _put(value, f"{path}{name}.", snapshot)


def _parts(thing: object) -> list[tuple[str, object]]:
    """Return the attributes that are remembered: arrays, numbers, and what of our own holds such."""
    if isinstance(thing, tuple):
        named: dict[str, object] = dict(zip(getattr(thing, "_fields", ()), thing, strict=False))
    else:
        named = vars(thing)
    left_out = (TOLD, *getattr(type(thing), "SCRATCH", ()))
    return [
        (name, value)
        for name, value in named.items()
        if name not in left_out and (isinstance(value, np.ndarray | bool | int | float) or _is_ours(value))
    ]


def _is_ours(value: object) -> bool:
    many = isinstance(value, tuple) and not hasattr(value, "_fields")
    return not many and type(value).__module__.startswith(OURS)
