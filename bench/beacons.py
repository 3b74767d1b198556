"""The landmark filter on recorded ranges to radio beacons at unknown places; the ranges' scale is found on the way.

The recording is Plaza1: Carnegie Mellon's lawn mower among four beacons, whose ranges read about 7 % long, with its
true places. It comes with the examples of gtsam, and is not part of this repository.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.drift.landmark_filter import (
    add_landmark,
    correct,
    innovation_variance,
    propagate,
    rows_used,
)
from perception.localization.drift.landmark_state import (
    FIRST,
    ODOMETER,
    RANGE,
    ROWS_MAX,
    TURN,
    Estimate,
    EstimateRecord,
)
from perception.records import records, zeros

RANGE_SIGMA_M: Final = 0.5
TURN_WALK: Final = 1e-5
"""Variance of the heading's error after a metre, rad²/m."""
PLACE_WALK: Final = 2e-3
"""Variance of the place's error after a metre, m²/m."""
ODOMETER_SIGMA: Final = 1e-3
"""The odometer defines the metre here: ranges to unknown places show only the ratio of the two scales."""
TURN_SIGMA: Final = 0.02
RANGE_SCALE_SIGMA: Final = 0.05
BEACON_SIGMA_M: Final = 1.0
"""Of the first estimate of a beacon's place."""
FIRST_WAY_M: Final = 80.0
"""Way by odometry from whose ranges the beacons are first placed."""
FIRST_RANGES: Final = 6
"""Least number of its ranges with which a beacon is placed."""
SCALES: Final = tuple(np.linspace(0.9, 1.15, 11).tolist())
"""Range scales that are tried for it, …"""
REACH_M: Final = 120.0
STEP_M: Final = 2.0
"""… and places, on a grid."""
GRID_ERROR_MAX_M: Final = 2.0
ERROR_MAX_M: Final = 3.0
"""A range that is farther off than this counts as if it were this far off."""
FIT_STEPS: Final = 10
ROBUST_SIGMAS: Final = 2.0
"""A range that is farther off gets less weight, …"""
GATE_SIGMAS: Final = 5.0
"""… and one that is as far off as this none."""

HEADER_BYTES: Final = 128
COMPRESSED: Final = 15
SHAPE_AT: Final = 32
NAME_AT: Final = 42


class Recording(NamedTuple):
    """A drive among beacons; times in s, lengths in m, angles in rad."""

    odometry: Floats
    """Time, way and turn since the row before, shape (n, 3)."""
    ranges: Floats
    """Time, beacon and range, in order of time, shape (k, 3)."""
    truth: Floats
    """Time, x and y, shape (m, 3)."""
    beacons: Floats
    """Number, x and y, shape (b, 3)."""


class Track(NamedTuple):
    """What the filter finds."""

    places: Floats
    """Time, x and y after each range, as known then, shape (k, 3)."""
    beacons: dict[int, tuple[float, float]]
    """Their places at the end, m."""
    range_scale: float
    squared_innovations: Floats
    """Of each range, over its variance."""


def read_plaza(path: Path) -> Recording:
    """Read one of the recordings from its `.mat` file (MATLAB 5)."""
    data, arrays, at = path.read_bytes(), {}, HEADER_BYTES
    while at < len(data):
        kind, size = struct.unpack_from("<II", data, at)
        if kind == COMPRESSED:
            body = zlib.decompress(data[at + 8 : at + 8 + size])
            rows, columns = struct.unpack_from("<ii", body, SHAPE_AT)
            (length,) = struct.unpack_from("<H", body, NAME_AT)
            name = body[NAME_AT + 2 : NAME_AT + 2 + length].decode("ascii")
            arrays[name] = np.frombuffer(body[-8 * rows * columns :]).reshape(columns, rows).T
        at += 8 + size
    ranges = arrays["TD"][:, [0, 2, 3]]
    in_order = ranges[np.argsort(ranges[:, 0], kind="stable")]
    return Recording(arrays["DR"], in_order, arrays["GT"][:, :3], arrays["TL"])


def first_places(recording: Recording) -> tuple[float, dict[int, Floats]]:
    """Return range scale and places of the beacons by the ranges of the first way; odometry is taken as exact."""
    path = _path(recording.odometry)
    way_m = np.cumsum(np.abs(recording.odometry[:, 1]))
    end = min(int(np.searchsorted(way_m, FIRST_WAY_M)), len(path) - 1)
    first = recording.ranges[recording.ranges[:, 0] < path[end, 0]]
    numbers, counts = np.unique(first[:, 1], return_counts=True)
    of_beacon = {int(n): first[first[:, 1] == n] for n in numbers[counts >= FIRST_RANGES]}
    best: tuple[float, float, dict[int, Floats]] = (math.inf, 1.0, {})
    for scale in SCALES:
        placed = {n: _place(path, rows, scale) for n, rows in of_beacon.items()}
        error = sum(cost for _, cost in placed.values())
        best = min(best, (error, scale, {n: place for n, (place, _) in placed.items()}), key=lambda one: one[0])
    return best[1:]


def track(recording: Recording) -> Track:
    """Return what the filter of `perception.localization` finds from odometry and ranges."""
    scale, places = first_places(recording)
    array = zeros(Estimate, 1)
    e, covariance = records(Estimate, array), np.zeros((ROWS_MAX, ROWS_MAX))
    e[0].odometer_scale, e[0].range_scale = 1.0, scale
    for row, sigma in ((ODOMETER, ODOMETER_SIGMA), (TURN, TURN_SIGMA), (RANGE, RANGE_SCALE_SIGMA)):
        covariance[row, row] = sigma**2
    variance = BEACON_SIGMA_M**2
    index = {
        n: add_landmark(e, covariance, float(x), float(y), variance, 0.0, variance) for n, (x, y) in places.items()
    }
    known = recording.ranges[np.isin(recording.ranges[:, 1], list(index))]
    squared, found, k = list[float](), list[tuple[float, float, float]](), 0
    for t, way, turn in recording.odometry.tolist():
        while k < len(known) and known[k, 0] <= t:
            squared.append(_enter(e, covariance, index[int(known[k, 1])], float(known[k, 2])))
            found.append((float(known[k, 0]), float(e[0].x), float(e[0].y)))
            k += 1
        turn_variance, place_variance = TURN_WALK * abs(way), PLACE_WALK * abs(way)
        propagate(e, covariance, way, 0.0, 0.0, turn, turn, (turn_variance, 0.0, place_variance))
    beacons = {n: (float(e[0].landmarks[i].x), float(e[0].landmarks[i].y)) for n, i in index.items()}
    return Track(np.array(found), beacons, float(e[0].range_scale), np.array(squared))


def figures(recording: Recording, found: Track) -> dict[str, float]:
    """Return the errors of a track and of odometry alone, each laid rigidly on the truth as well as possible."""
    t = found.places[:, 0]
    truth = np.column_stack([np.interp(t, recording.truth[:, 0], recording.truth[:, k]) for k in (1, 2)])
    path = _path(recording.odometry)
    odometry = np.column_stack([np.interp(t, path[:, 0], path[:, k]) for k in (1, 2)])
    errors, by_odometry = errors_when_aligned(found.places[:, 1:], truth), errors_when_aligned(odometry, truth)
    there = {int(n): (x, y) for n, x, y in recording.beacons.tolist()}
    beacons = errors_when_aligned(np.array(list(found.beacons.values())), np.array([there[n] for n in found.beacons]))
    return {
        "ranges": len(t),
        "beacons": len(beacons),
        "rms_m": float(np.sqrt(np.mean(errors**2))),
        "median_m": float(np.median(errors)),
        "p95_m": float(np.percentile(errors, 95)),
        "beacons_m": float(beacons.max()),
        "range_scale": found.range_scale,
        "nis_median": float(np.median(found.squared_innovations)),
        "ignored": float(np.mean(found.squared_innovations > GATE_SIGMAS**2)),
        "odometry_rms_m": float(np.sqrt(np.mean(by_odometry**2))),
    }


def _path(odometry: Floats) -> Floats:
    """Return time, x and y by odometry after each row, shape (n, 3)."""
    before = np.concatenate([[0.0], np.cumsum(odometry[:-1, 2])])
    steps = odometry[:, 1, None] * np.column_stack([np.cos(before), np.sin(before)])
    return np.column_stack([odometry[:, 0], np.cumsum(steps, axis=0)])


def _place(path: Floats, rows: Floats, scale: float) -> tuple[Floats, float]:
    """Return a beacon's place by some of its ranges, and how far off they are: grid, then weighted least squares."""
    at = np.column_stack([np.interp(rows[:, 0], path[:, 0], path[:, k]) for k in (1, 2)])
    axis = np.arange(-REACH_M, REACH_M + STEP_M, STEP_M)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 1, 2)
    off = scale * np.hypot(*np.moveaxis(grid - at, -1, 0)) - rows[:, 2]
    place: Floats = grid[np.minimum(off**2, GRID_ERROR_MAX_M**2).sum(axis=1).argmin(), 0]
    for _ in range(FIT_STEPS):
        distance = np.hypot(*(place - at).T)
        off = scale * distance - rows[:, 2]
        weighted = (scale * (place - at) / distance[:, None]).T / np.maximum(1.0, np.abs(off))
        place = (
            place
            - np.linalg.lstsq(weighted @ (scale * (place - at) / distance[:, None]), weighted @ off, rcond=None)[0]
        )
    off = scale * np.hypot(*(place - at).T) - rows[:, 2]
    return place, float(np.minimum(np.abs(off), ERROR_MAX_M).sum())


def _enter(e: EstimateRecord, covariance: Floats, landmark: int, range_m: float) -> float:
    """Correct the estimate by a range; return the squared innovation over its variance."""
    est, place = e[0], e[0].landmarks[landmark]
    dx, dy = place.x - est.x, place.y - est.y
    distance, scale = math.hypot(dx, dy), est.range_scale
    row = FIRST + 2 * landmark
    predicted = innovation_variance(
        covariance, rows_used(e), row, scale * dx / distance, scale * dy / distance, distance, est.gain
    )
    innovation = range_m - scale * distance
    variance = predicted + RANGE_SIGMA_M**2
    squared = innovation**2 / variance
    if squared <= GATE_SIGMAS**2:
        excess = max(1.0, math.sqrt(squared) / ROBUST_SIGMAS)
        correct(e, covariance, innovation, predicted + (excess * RANGE_SIGMA_M) ** 2)
    return float(squared)


def errors_when_aligned(points: Floats, truth: Floats) -> Floats:
    """Return the distances of points (n, 2) from the truth after the best rigid motion, m."""
    a, b = points - points.mean(axis=0), truth - truth.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, np.linalg.det(u @ v)]) @ v
    found: Floats = np.hypot(*(a @ turn - b).T)
    return found
