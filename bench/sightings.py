"""The landmark filter on recorded sightings, range and bearing, of landmarks at unknown places.

The recording is MRCLAM: robots among fifteen barcoded posts, whose true places are known (K. Leung et al., "The UTIAS
multi-robot cooperative localization and mapping dataset", 2011). It is not part of this repository.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from rich.table import Table

from bench.beacons import errors_when_aligned
from perception.kernel import Floats
from perception.localization.landmark_filter import add_landmark, correct, innovation_variance, propagate, rows_used
from perception.localization.landmark_state import FIRST, ODOMETER, ROWS_MAX, TURN, Estimate, EstimateRecord
from perception.records import records, zeros

RANGE_SIGMA: Final = 0.04
BEARING_SIGMA: Final = 0.03
"""Noise of a sighting: share of the range, and rad."""
TURN_WALK: Final = 4e-3
"""Variance of the heading's error after a turn of a radian, rad²."""
TURN_WALK_M: Final = 1e-3
PLACE_WALK: Final = 1e-4
"""Variances after a metre: of the heading, rad², and of the place on each axis, m²."""
ODOMETER_SIGMA: Final = 0.05
TURN_SIGMA: Final = 0.05
"""Standard deviations of odometry's scales at the start; the camera's ranges define the metre."""
ROBUST_SIGMAS: Final = 1.5
"""A sighting that is farther off gets less weight, …"""
GATE_SIGMAS: Final = 6.0
"""… and one that is as far off as this none."""
ROBOTS: Final = 5
"""The subjects up to this number are robots, which move."""
EXCHANGED: Final = (11, 17)
"""These two landmarks have each other's places in the recording's table."""


class Recording(NamedTuple):
    """A drive among posts; times in s, lengths in m, angles in rad."""

    odometry: Floats
    """Time, speed and turn rate, shape (n, 3)."""
    sightings: Floats
    """Time, landmark, range and bearing, in order of time, shape (k, 4)."""
    landmarks: Floats
    """Number, x and y, shape (b, 3)."""


class Found(NamedTuple):
    """What the filter finds."""

    landmarks: dict[int, tuple[float, float]]
    """Their places at the end, m."""
    squared_innovations: Floats
    """Of each sighting, over their covariance: two degrees of freedom."""
    odometer_scale: float


def read_mrclam(folder: Path, robot: int) -> Recording:
    """Read the drive of one robot from the recording's folder."""
    barcodes = {int(code): int(subject) for subject, code in np.loadtxt(folder / "Barcodes.dat").tolist()}
    rows = [
        (t, float(barcodes[int(code)]), distance, bearing)
        for t, code, distance, bearing in np.loadtxt(folder / f"Robot{robot}_Measurement.dat").tolist()
        if barcodes.get(int(code), 0) > ROBOTS
    ]
    landmarks = np.loadtxt(folder / "Landmark_Groundtruth.dat")[:, :3]
    first, second = (landmarks[:, 0] == number for number in EXCHANGED)
    landmarks[first, 1:], landmarks[second, 1:] = landmarks[second, 1:], landmarks[first, 1:].copy()
    return Recording(np.loadtxt(folder / f"Robot{robot}_Odometry.dat"), np.array(rows), landmarks)


def track(recording: Recording) -> Found:
    """Return what the filter of `perception.localization` finds from odometry and sightings."""
    array = zeros(Estimate, 1)
    e, covariance = records(Estimate, array), np.zeros((ROWS_MAX, ROWS_MAX))
    e[0].odometer_scale = e[0].range_scale = 1.0
    covariance[ODOMETER, ODOMETER], covariance[TURN, TURN] = ODOMETER_SIGMA**2, TURN_SIGMA**2
    index, squared, k = dict[int, int](), list[float](), 0
    odometry, sightings = recording.odometry.tolist(), recording.sightings.tolist()
    for (t, v, w), (until_s, _, _) in itertools.pairwise(odometry):
        while k < len(sightings) and sightings[k][0] < until_s:
            at_s, number, distance, bearing = sightings[k]
            k += 1
            _move(e, covariance, v, w, max(0.0, at_s - t))
            t = max(t, at_s)
            if number in index:
                squared.append(_enter(e, covariance, index[number], distance, bearing))
            else:
                index[int(number)] = _place(e, covariance, distance, bearing)
        _move(e, covariance, v, w, until_s - t)
    places = {n: (float(e[0].landmarks[i].x), float(e[0].landmarks[i].y)) for n, i in index.items()}
    return Found(places, np.array(squared), float(e[0].odometer_scale))


def figures(recording: Recording, found: Found) -> dict[str, float]:
    """Return the errors of the landmarks, laid rigidly on the truth as well as possible, and the innovations."""
    there = {int(n): (x, y) for n, x, y in recording.landmarks.tolist()}
    errors = errors_when_aligned(
        np.array(list(found.landmarks.values())), np.array([there[n] for n in found.landmarks])
    )
    used = found.squared_innovations[found.squared_innovations <= GATE_SIGMAS**2]
    return {
        "sightings": len(found.squared_innovations),
        "landmarks": len(errors),
        "rms_m": float(np.sqrt(np.mean(errors**2))),
        "max_m": float(errors.max()),
        "nis_mean": float(used.mean()),
        "nis_median": float(np.median(found.squared_innovations)),
        "ignored": 1.0 - len(used) / len(found.squared_innovations),
        "odometer_scale": found.odometer_scale,
    }


def sightings_table(row: dict[str, float]) -> Table:
    """Return the table of figures."""
    table = Table(title="landmark filter on sightings of posts at unknown places", title_justify="left")
    for column in row:
        table.add_column(column, justify="right")
    table.add_row(*(f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()))
    return table


def _move(e: EstimateRecord, covariance: Floats, v: float, w: float, dt_s: float) -> None:
    """Follow odometry for a while: half of the turn, the way, the other half."""
    way, turn = v * dt_s, w * dt_s
    if way == 0.0 and turn == 0.0:
        return
    walk = 0.5 * (TURN_WALK * abs(turn) + TURN_WALK_M * abs(way))
    propagate(e, covariance, 0.0, 0.0, 0.0, 0.5 * turn, 0.5 * turn, walk, 0.0, 0.0)
    propagate(e, covariance, way, 0.0, 0.0, 0.5 * turn, 0.5 * turn, walk, 0.0, PLACE_WALK * abs(way))


def _noise(distance: float) -> tuple[float, float]:
    """Return the variances of a sighting along and across its direction, m²."""
    return (RANGE_SIGMA * distance) ** 2, (BEARING_SIGMA * distance) ** 2


def _place(e: EstimateRecord, covariance: Floats, distance: float, bearing: float) -> int:
    """Add a landmark where it is seen; return its index."""
    along, across = _noise(distance)
    c, s = math.cos(e[0].heading + bearing), math.sin(e[0].heading + bearing)
    ahead, left = distance * math.cos(bearing), distance * math.sin(bearing)
    return add_landmark(
        e, covariance, ahead, left, c * c * along + s * s * across, c * s * (along - across),
        s * s * along + c * c * across,
    )  # fmt: skip


def _enter(e: EstimateRecord, covariance: Floats, landmark: int, distance: float, bearing: float) -> float:
    """Correct the estimate by a sighting; return the squared innovation over its covariance.

    Turned into the map frame, a sighting measures the landmark's place less the ring's, and its derivative by the
    heading's error is zero (see `perception.localization.landmark_filter`). It is entered along its direction, then
    across.
    """
    est = e[0]
    row, axis = FIRST + 2 * landmark, est.heading + bearing
    along, across = _noise(distance)
    axes = (along, math.cos(axis), math.sin(axis), distance), (across, -math.sin(axis), math.cos(axis), 0.0)

    def look(ux: float, uy: float, seen: float) -> tuple[float, float]:
        """Return the innovation in a direction, and the variance of what was predicted."""
        off = ux * (est.landmarks[landmark].x - est.x) + uy * (est.landmarks[landmark].y - est.y)
        return seen - off, innovation_variance(covariance, rows_used(e), row, ux, uy, 0.0, est.gain)

    squared = 0.0
    for noise, *direction in axes:
        innovation, predicted = look(*direction)
        squared += innovation**2 / (predicted + noise)
    if squared <= GATE_SIGMAS**2:
        excess = max(1.0, math.sqrt(squared) / ROBUST_SIGMAS) ** 2
        for noise, *direction in axes:
            innovation, predicted = look(*direction)
            correct(e, covariance, innovation, predicted + excess * noise)
    return squared
