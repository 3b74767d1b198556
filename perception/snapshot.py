"""Snapshots of a perception method's memory as named arrays, so that a replay can begin in the middle.

The functions walk over the objects' attributes, so that a snapshot includes every new field of a method. The method's
configuration, models and `settings` are left out, and so are the attributes that its class lists as `SCRATCH`, which
are overwritten before each use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from perception.bounds import FLAG, Bound, Declared, Fields

Snapshot: TypeAlias = dict[str, NDArray[Any]]
"""Copies of the memory's values, by dotted name; a number is an array of no dimension."""

GROWING: Final = "archived_rows"
"""An array of this name may have another length in a snapshot: what is archived grows with the map."""
SCRATCH_FIELD: Final = "scratch"
"""The field of an array that is overwritten before each use: zero in a snapshot, left alone when one is put back."""
CONFIGURED: Final = "settings"
OURS: Final = "perception."


def snapshot_of(owner: object) -> Snapshot:
    """Return copies of every array and number in the memory of an object and its parts."""
    return {name: _copied(array) for name, array in _arrays(owner)}


def bounds_of(owner: object) -> dict[str, Bound]:
    """Return the declared bounds of what `snapshot_of` takes of an object, by the dotted name of each number.

    A number without a declaration is missing; see `perception.bounds`.
    """
    found: dict[str, Bound] = {}
    _declared(owner, "", found)
    return found


def numbers_of(snapshot: Snapshot) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield name and values of every field of every array, inner records included; views of the same memory."""
    for name, array in snapshot.items():
        yield from _fields(name, array)


def put_back(owner: object, snapshot: Snapshot) -> None:
    """Overwrite an object's memory with a snapshot of another object made from the same settings.

    Raises
    ------
    ValueError
        The snapshot is of something else: names, shapes or fields differ. Or numbers that are each in their bounds
        contradict each other, as a part's method `contradiction` says; the object is of no use then.
    """
    mine = dict(_arrays(owner))
    if mine.keys() != snapshot.keys():
        strange = sorted(mine.keys() ^ snapshot.keys())
        raise ValueError(f"the snapshot is of another method or version: {', '.join(strange[:3])}")
    for name, array in mine.items():
        if array.dtype != snapshot[name].dtype:
            raise ValueError(f"the snapshot is of another version: {name} has other fields")
        if fixed_shape(name, array.shape) != fixed_shape(name, snapshot[name].shape):
            raise ValueError(
                f"the snapshot is of other settings: {name} is {snapshot[name].shape}, not {array.shape}"
            )
    _put(owner, "", snapshot)
    _refuse_contradictions(owner, "")


def is_scratch(name: str) -> bool:
    """Return whether a number, by its dotted name, belongs to what is overwritten before each use."""
    return f".{SCRATCH_FIELD}." in name


def _refuse_contradictions(owner: object, path: str) -> None:
    contradiction: Callable[[], str | None] | None = getattr(owner, "contradiction", None)
    if contradiction is not None and (found := contradiction()) is not None:
        raise ValueError(f"{path}{found}")
    for name, value in _parts(owner):
        if _is_ours(value):
            _refuse_contradictions(value, f"{path}{name}.")


def _declared(owner: object, path: str, found: dict[str, Bound]) -> None:
    """Add the bounds of an object's numbers, its parts' included, to `found`; `path` leads to the object."""
    declared: Mapping[str, Declared] = getattr(type(owner), "BOUNDS", {})
    for name, value in _parts(owner):
        if not isinstance(value, np.ndarray | bool | int | float):
            _declared(value, f"{path}{name}.", found)
        elif isinstance(value, bool) or (isinstance(value, np.ndarray) and value.dtype.kind == "b"):
            found[path + name] = FLAG
    for name, bound in declared.items():  # after the parts', of which they may replace some
        _flatten(bound if isinstance(bound, Bound | Mapping) else bound(owner), path + name, found)


def _flatten(bound: Bound | Fields, path: str, found: dict[str, Bound]) -> None:
    if isinstance(bound, Bound):
        found[path] = bound
    else:
        for name, inner in bound.items():
            if name != SCRATCH_FIELD:
                _flatten(inner, f"{path}.{name}", found)


def _fields(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if array.dtype.names is None:
        yield name, array
    else:
        for field in array.dtype.names:
            yield from _fields(f"{name}.{field}", array[field])


def _arrays(owner: object, path: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the dotted names and the arrays themselves; a number is an array of its own."""
    for name, value in _parts(owner):
        if isinstance(value, np.ndarray):
            yield path + name, value
        elif isinstance(value, bool | int | float):
            yield path + name, np.array(value)
        else:
            yield from _arrays(value, f"{path}{name}.")


def _copied(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy with zeros for scratch."""
    if array.dtype.fields is None:
        return array.copy()
    copied = np.zeros(array.shape, array.dtype)
    _overwrite(copied, array)
    return copied


def _overwrite(array: NDArray[Any], source: NDArray[Any]) -> None:
    """Copy all but scratch, records byte by byte: numpy copies them field by field, which takes six times as long."""
    fields = array.dtype.fields
    if fields is None:
        array[...] = source
        return
    if not (array.flags.c_contiguous and source.flags.c_contiguous):
        for name in fields.keys() - {SCRATCH_FIELD}:
            array[name] = source[name]
        return
    ours, theirs = _bytes_of(array), _bytes_of(source)
    begin = end = array.dtype.itemsize
    if SCRATCH_FIELD in fields:
        begin = fields[SCRATCH_FIELD][1]
        end = begin + array.dtype[SCRATCH_FIELD].itemsize
    ours[:, :begin], ours[:, end:] = theirs[:, :begin], theirs[:, end:]


def _bytes_of(records: NDArray[Any]) -> NDArray[np.uint8]:
    """Return a view of the bytes of each record, shape (records, bytes of one)."""
    return records.reshape(-1).view(np.uint8).reshape(records.size, records.dtype.itemsize)


def _put(owner: object, path: str, snapshot: Snapshot) -> None:
    """Overwrite an object's numbers, its parts' included, which `put_back` has checked."""
    for name, value in _parts(owner):
        if name == GROWING:
            setattr(owner, name, snapshot[path + name].copy())
        elif isinstance(value, np.ndarray):
            _overwrite(value, snapshot[path + name])
        elif isinstance(value, bool | int | float):
            setattr(owner, name, type(value)(snapshot[path + name].item()))
        else:
            _put(value, f"{path}{name}.", snapshot)


def fixed_shape(name: str, shape: Sequence[int]) -> tuple[int, ...]:
    """Return what is fixed of the shape of a snapshot's array; the length of a growing one is not."""
    return tuple(shape[1:]) if name.endswith(f".{GROWING}") else tuple(shape)


def _parts(owner: object) -> list[tuple[str, object]]:
    """Return the attributes that are remembered: arrays, numbers, and parts of this package that hold such."""
    left_out = (CONFIGURED, *getattr(type(owner), "SCRATCH", ()))
    return [
        (name, value)
        for name, value in vars(owner).items()
        if name not in left_out and (isinstance(value, np.ndarray | bool | int | float) or _is_ours(value))
    ]


def _is_ours(value: object) -> bool:
    return not isinstance(value, tuple) and type(value).__module__.startswith(OURS)
