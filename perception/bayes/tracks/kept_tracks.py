"""Tracks and walls as text, so that an operator's undo puts them back exactly, with the readings kept for them.

The text is part of an edit, and an edit may come from a file. So each number is checked against its bound before it
becomes part of the memory, which compiled kernels read without checks.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from perception.bayes.memory.state import FREE, Memory
from perception.bayes.tracks.archived_tracks import free_row
from perception.bayes.tracks.manual_tracks import leave_job
from perception.bounds import Bound, check_values
from perception.edits import ObjectRow, not_restorable
from perception.records import Structured
from perception.snapshot import numbers_of

CIRCLE: Final = "circle"
POLYGON: Final = "polygon"
BOUNDED: Final = MappingProxyType({CIRCLE: "memory.circles", POLYGON: "memory.state.polygons"})
"""The names by which the numbers of a track have their bounds."""
ROOM: Final = "memory.state.room"
"""The same of the walls' map."""
WALLS_LOST: Final = "the walls cannot be put back: nothing valid was kept of them"


def kept_track(memory: Memory, row: int) -> str:
    """Return a track as text; its row is as of `map_edits.row_of`."""
    t = row - len(memory.circles)
    kind, tracks, at = (CIRCLE, memory.circles, row) if t < 0 else (POLYGON, memory.polygons, t)
    return f"{kind}:{_packed(tracks[at])}"


def kept_walls(memory: Memory) -> str:
    """Return the map of the walls as text; empty where it has none."""
    room = memory.state["room"][0]
    has_any = room["walls"]["weight"].any() or any(room[points]["is_used"].any() for points in ("corners", "edges"))
    return _packed(room) if has_any else ""


def restore_track(memory: Memory, row: ObjectRow, bounds: Mapping[str, Bound]) -> str | None:
    """Put a track back in its own place, a free or a hypothesis' one; return None, or why that is impossible.

    Parameters
    ----------
    memory : Memory
        Updated.
    row : ObjectRow
        The object; its place is that of the track.
    bounds : mapping
        As of `perception.snapshot.bounds_of`.
    """
    kind, _, text = row.kept.partition(":")
    tracks = {CIRCLE: memory.circles, POLYGON: memory.polygons}.get(kind)
    track = None if tracks is None else _unpacked(text, tracks.dtype)
    if tracks is None or track is None or track["number"][0] != row.number:
        return not_restorable(row.number)
    if not _is_valid(BOUNDED[kind], track, bounds):
        return not_restorable(row.number)
    if row.number > int(memory.state["objects_numbered"][0]) or track["status"][0] == FREE:
        return not_restorable(row.number)
    places = np.flatnonzero((tracks["status"] != FREE) & (tracks["number"] == row.number))
    t = int(places[0]) if len(places) else free_row(tracks)
    if t < 0:
        return f"no room to put object {row.number} back: reject another one first"
    if kind == POLYGON:
        leave_job(memory.s, t)
    tracks[t] = track[0]
    return None


def restore_walls(memory: Memory, text: str, bounds: Mapping[str, Bound]) -> str | None:
    """Put the map of the walls back in place of the present one; return None, or why that is impossible.

    Parameters
    ----------
    memory : Memory
        Updated.
    text : str
        From `kept_walls`.
    bounds : mapping
        As of `perception.snapshot.bounds_of`.
    """
    room = _unpacked(text, memory.state["room"].dtype)
    if room is None or not _is_valid(ROOM, room, bounds):
        return WALLS_LOST
    numbers = int(memory.state["objects_numbered"][0])
    if max(room["walls"]["spans"]["number"].max(), room["walls"]["bins"]["number"].max()) > numbers:
        return WALLS_LOST
    room["jitter"] = np.zeros((), room["jitter"].dtype)  # odometry has gone on since
    memory.state["room"] = room
    return None


def _is_valid(name: str, record: Structured, bounds: Mapping[str, Bound]) -> bool:
    """Return whether each number of a record that the memory holds under this name is within its bound."""
    try:
        for path, values in numbers_of({name: record}):
            check_values(path, values, bounds[path])
    except ValueError:
        return False
    return True


def _packed(record: np.void) -> str:
    """Return a record as text."""
    return base64.b64encode(zlib.compress(record.tobytes(), 1)).decode()


def _unpacked(text: str, dtype: np.dtype[Any]) -> Structured | None:
    """Return the record in a text, shape (1,); None if it holds none of this type."""
    try:
        packed = base64.b64decode(text, validate=True)
        unpacker = zlib.decompressobj()
        data = unpacker.decompress(packed, dtype.itemsize + 1)
    except (binascii.Error, ValueError, zlib.error):
        return None
    return np.frombuffer(data, dtype).copy() if len(data) == dtype.itemsize else None
