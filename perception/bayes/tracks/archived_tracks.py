"""Tracks as archived records: everything but the readings as it is, and of the readings the newest of each bearing.

Of a bearing that is kept there are as many as the check of the outline needs: where everything echoes, a drum of
which it had fewer lost its name as the robot came back.

A track takes up to 30 kB, nearly all of it readings; an archived record takes less than 1.8 kB. Readings are kept in
single precision about the object's centre, which is exact to a micrometre. Cross paths are not kept.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.circles.outline_check import OUTLINE_READINGS_MIN
from perception.bayes.memory.state import FREE, TENTATIVE, CircleTrack, PolygonTrack
from perception.bounds import COUNT, FLAG, PLACE, Fields, up_to
from perception.kernel import Floats
from perception.map_moves import MapMoves
from perception.records import Structured
from perception.shared_numbers import FAR

ARCHIVED_READINGS: Final = 48
"""Readings of an archived track: `OUTLINE_READINGS_MIN` of 16 bearings, or more of fewer."""
BINS: Final = "bins"
"""The field of a track that holds its readings, which an archived one keeps in another form."""


def free_row(tracks: Structured) -> int:
    """Return a free track's row, else that of the unmarked tentative one with the least evidence, else −1.

    It is `track_labels.free_track` for what no kernel calls.

    Parameters
    ----------
    tracks : (n,) record of `CircleTrack` or `PolygonTrack`
        The tracks.
    """
    status = tracks["status"]
    free = np.flatnonzero(status == FREE)
    if len(free):
        return int(free[0])
    tentative = np.flatnonzero((status == TENTATIVE) & (tracks["marks"] == 0))
    return int(tentative[tracks["log_likelihood_ratio"][tentative].argmin()]) if len(tentative) else -1


def archived_dtype(track: type[CircleTrack | PolygonTrack]) -> np.dtype[Any]:
    """Return the dtype of an archived track.

    Besides the track's own fields it has `is_reported` (int; 1 where it is reported as a model), `submap` (int; the
    number of the map of the way with which it moves), `kept` (int), and `readings`: x and y of the sensor about the
    track's centre (m), direction of its axis (rad) and range (m).
    """
    fields = [(name, track.DTYPE[name]) for name in (track.DTYPE.names or ())[:-1]]  # the last are the readings
    readings = ("readings", np.float32, (ARCHIVED_READINGS, 4))
    numbers = [(name, np.int64) for name in ("is_reported", "submap", "kept")]
    return np.dtype((np.record, [*fields, *numbers, readings]))


def archived_bounds(track: type[CircleTrack | PolygonTrack]) -> Fields:
    """Return the bounds of the fields of an archived track."""
    own = {name: bound for name, bound in track.BOUNDS.items() if name != BINS}
    return {**own, "is_reported": FLAG, "submap": COUNT, "kept": up_to(ARCHIVED_READINGS), "readings": PLACE}


def pack(track: Structured, dtype: np.dtype[Any], *, is_reported: bool) -> Structured:
    """Return a track as an archived record, shape (1,).

    Parameters
    ----------
    track : (1,) record of `CircleTrack` or `PolygonTrack`
        The track.
    dtype : dtype
        From `archived_dtype`.
    is_reported : bool
        Whether it is reported as a model.
    """
    row = np.zeros(1, dtype)
    _copy_numbers(track, row)
    readings = newest_readings(track[BINS][0])
    row["is_reported"], row["kept"] = is_reported, len(readings)
    kept = row["readings"][0, : len(readings)]
    with np.errstate(over="ignore"):  # a state from a damaged file may lie anywhere
        kept[:, 0], kept[:, 1] = readings["x"] - track["x"], readings["y"] - track["y"]
    kept[:, 2], kept[:, 3] = np.arctan2(readings["axis_y"], readings["axis_x"]), readings["range_m"]
    return row


def unpack(row: Structured, track: Structured) -> None:
    """Write an archived record to a track.

    Parameters
    ----------
    row : (1,) record of `archived_dtype`
        The archived track.
    track : (1,) record of `CircleTrack` or `PolygonTrack`
        Overwritten.
    """
    _copy_numbers(row, track)
    bins = track[BINS][0]
    kept = row["readings"][0, : int(row["kept"][0])][::-1].astype(np.float64)  # the oldest first
    b = bearing_bins(kept, len(bins))
    order = np.argsort(b, kind="stable")
    # They were binned about earlier centres: about this one a bin may get more than it holds, and keeps the newest.
    order = order[np.searchsorted(b[order], b[order], "right") - np.arange(len(b)) <= bins["readings"].shape[1]]
    b, kept = b[order], kept[order]
    bins["count"] = np.bincount(b, minlength=len(bins))
    in_bin, readings = np.arange(len(b)) - np.searchsorted(b, b), bins["readings"]
    readings["x"][b, in_bin], readings["y"][b, in_bin] = row["x"] + kept[:, 0], row["y"] + kept[:, 1]
    readings["axis_x"][b, in_bin], readings["axis_y"][b, in_bin] = np.cos(kept[:, 2]), np.sin(kept[:, 2])
    readings["range_m"][b, in_bin] = kept[:, 3]
    readings["listener_x"][b, in_bin] = readings["listener_y"][b, in_bin] = 0.0


def move_rows(rows: Structured, moves: MapMoves) -> None:
    """Move archived tracks with their maps of the way; corrections turn too little to turn covariances.

    Parameters
    ----------
    rows : (n,) record of `archived_dtype`
        Updated.
    moves : MapMoves
        Of the maps.
    """
    for place in (rows, rows["challenger"]) if "challenger" in (rows.dtype.names or ()) else (rows,):
        place["x"], place["y"], turn = moves.moved(rows["submap"], place["x"], place["y"])
        if "heading" in (place.dtype.names or ()):
            place["heading"] += turn
    turn, readings = moves.of(rows["submap"])[:, 2, None], rows["readings"]
    c, s, x, y = np.cos(turn), np.sin(turn), readings[..., 0].copy(), readings[..., 1].copy()
    readings[..., 0], readings[..., 1] = c * x - s * y, s * x + c * y
    readings[..., 2] += turn


def newest_readings(bins: Structured) -> Structured:
    """Return the newest readings of bearings that lie evenly round, then the newest of each one: (≤ 48,) `Reading`.

    Before them come the silences that are the newest of their bearing: they show that the object has left.

    Parameters
    ----------
    bins : (n,) record of `CircleBin` or `PolygonBin`
        The bins.
    """
    counts, capacity = bins["count"], bins["readings"].shape[1]
    rank = np.arange(capacity)[:, None]
    ranks, which = np.nonzero(rank < counts)
    found: Structured = bins["readings"][which, (counts[which] - 1 - ranks) % capacity]
    is_own = (found["listener_x"] == 0.0) & (found["listener_y"] == 0.0)
    found, which = found[is_own], which[is_own]
    order = np.argsort(which, kind="stable")
    ranks = np.zeros(len(found), np.int64)
    ranks[order] = np.arange(len(found)) - np.searchsorted(which[order], which[order])
    is_new = ranks < OUTLINE_READINGS_MIN
    heard = np.bincount(which[is_new & (found["range_m"] < FAR)], minlength=len(bins))
    many, most = np.flatnonzero(heard == OUTLINE_READINGS_MIN), ARCHIVED_READINGS // OUTLINE_READINGS_MIN
    if len(many) > most:
        many = many[np.arange(most) * len(many) // most]
    is_silence = (ranks == 0) & (found["range_m"] >= FAR)
    order = np.lexsort((which, ranks, ~(is_new & np.isin(which, many)), ~is_silence))
    return found[order][:ARCHIVED_READINGS]


def bearing_bins(places: Floats, count: int) -> NDArray[np.int64]:
    """Return the bearing bins of places about the centre, as `reservoir.keep_reading` computes them; shape (n,).

    Parameters
    ----------
    places : (n, ≥ 2) float
        x and y about the centre, m.
    count : int
        Number of bins of the full circle.
    """
    turns = np.arctan2(places[:, 1], places[:, 0]) / (2.0 * math.pi) + 0.5
    return (turns * count).astype(np.int64) % count


def _copy_numbers(source: Structured, target: Structured) -> None:
    """Copy all fields before the readings; a track and an archived record begin with the same ones."""
    (size,) = (one.dtype.fields[BINS][1] for one in (source, target) if one.dtype.fields and BINS in one.dtype.fields)
    target.view(np.uint8)[:size] = source.view(np.uint8)[:size]
