"""The landmark filter on recorded sightings, range and bearing, of landmarks at unknown places.

The recording is MRCLAM: robots among fifteen barcoded posts, whose true places are known (K. Leung et al., "The UTIAS
multi-robot cooperative localization and mapping dataset", 2011). It is not part of this repository.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from bench.beacons import errors_when_aligned
from perception.kernel import Floats
from perception.localization.drift.landmark_filter import (
    add_landmark,
    correct,
    innovation_variance,
    propagate,
    rows_used,
)
from perception.localization.drift.landmark_state import FIRST, ODOMETER, ROWS_MAX, TURN, Estimate, EstimateRecord
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


class Step(NamedTuple):
    """Odometry since the sighting before: half of a turn (rad), a displacement (m) in the frame there, the rest."""

    forward: float
    left: float
    turn: float
    way: float
    """Driven, ahead and back."""
    turned: float
    """To the left and to the right."""

    @property
    def turn_variance(self) -> float:
        """Of the turn's error, rad²."""
        return TURN_WALK * self.turned + TURN_WALK_M * self.way

    @property
    def place_variance(self) -> float:
        """Of the displacement on each axis, m²."""
        return PLACE_WALK * self.way


class Found(NamedTuple):
    """What the filter finds."""

    landmarks: dict[int, tuple[float, float]]
    """Their places at the end, m."""
    took_ms: Floats
    """Thread time of each sighting, with the step to it."""
    squared_innovations: Floats
    """Of each sighting but the first of a post, over their covariance: two degrees of freedom."""
    odometer_scale: float
    turn_scale: float


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


def steps_between(recording: Recording) -> Iterator[Step]:
    """Yield the step by odometry to each sighting."""
    odometry, i = recording.odometry.tolist(), 0
    at_s = odometry[0][0]
    for until_s in recording.sightings[:, 0].tolist():
        x = y = heading = way = turned = 0.0
        while at_s < until_s:
            while i + 1 < len(odometry) and odometry[i + 1][0] <= at_s:
                i += 1
            _, v, w = odometry[i]
            end_s = min(until_s, odometry[i + 1][0]) if i + 1 < len(odometry) else until_s
            distance, turn = v * (end_s - at_s), w * (end_s - at_s)
            x += distance * math.cos(heading + 0.5 * turn)
            y += distance * math.sin(heading + 0.5 * turn)
            heading, way, turned, at_s = heading + turn, way + abs(distance), turned + abs(turn), end_s
        c, s = math.cos(0.5 * heading), math.sin(0.5 * heading)
        yield Step(c * x + s * y, c * y - s * x, heading, way, turned)


def track(recording: Recording) -> Found:
    """Return what the filter of `perception.localization` finds from odometry and sightings."""
    array = zeros(Estimate, 1)
    e, covariance = records(Estimate, array), np.zeros((ROWS_MAX, ROWS_MAX))
    e[0].odometer_scale = e[0].range_scale = 1.0
    covariance[ODOMETER, ODOMETER], covariance[TURN, TURN] = ODOMETER_SIGMA**2, TURN_SIGMA**2
    index, squared, took_ms = dict[int, int](), list[float](), list[float]()
    for step, (_, number, distance, bearing) in zip(
        steps_between(recording), recording.sightings.tolist(), strict=True
    ):
        begin_s = time.thread_time()
        half, variance = 0.5 * step.turn, 0.5 * step.turn_variance
        propagate(e, covariance, 0.0, 0.0, 0.0, half, half, (variance, 0.0, 0.0))
        propagate(e, covariance, step.forward, step.left, 0.0, half, half, (variance, 0.0, step.place_variance))
        if number in index:
            squared.append(_enter(e, covariance, index[number], distance, bearing))
        else:
            index[int(number)] = _place(e, covariance, distance, bearing)
        took_ms.append(1e3 * (time.thread_time() - begin_s))
    places = {n: (float(e[0].landmarks[i].x), float(e[0].landmarks[i].y)) for n, i in index.items()}
    return Found(
        places, np.array(took_ms), np.array(squared), float(e[0].odometer_scale), 1.0 + float(e[0].turn_scale)
    )


def errors(recording: Recording, places: Mapping[int, tuple[float, float]]) -> Floats:
    """Return how far the places are from the truth after the best rigid motion, m."""
    there = {int(n): (x, y) for n, x, y in recording.landmarks.tolist()}
    return errors_when_aligned(np.array(list(places.values())), np.array([there[n] for n in places]))


def figures(recording: Recording, found: Found) -> dict[str, float]:
    """Return the errors of the landmarks, the innovations and the time."""
    off, squared = errors(recording, found.landmarks), found.squared_innovations
    used = squared[squared <= GATE_SIGMAS**2]
    return {
        "landmarks": len(off),
        "rms_m": float(np.sqrt(np.mean(off**2))),
        "max_m": float(off.max()),
        "nis_mean": float(used.mean()),
        "nis_median": float(np.median(squared)),
        "ignored": 1.0 - len(used) / len(squared),
        "odometer_scale": found.odometer_scale,
        "turn_scale": found.turn_scale,
        "median_ms": float(np.median(found.took_ms)),
        "mean_ms": float(found.took_ms.mean()),
    }


def noise(distance: float) -> tuple[float, float]:
    """Return the variances of a sighting along and across its direction, m²."""
    return (RANGE_SIGMA * distance) ** 2, (BEARING_SIGMA * distance) ** 2


def _place(e: EstimateRecord, covariance: Floats, distance: float, bearing: float) -> int:
    """Add a landmark where it is seen; return its index."""
    along, across = noise(distance)
    c, s = math.cos(e[0].heading + bearing), math.sin(e[0].heading + bearing)
    ahead, left = distance * math.cos(bearing), distance * math.sin(bearing)
    return add_landmark(
        e, covariance, ahead, left, c * c * along + s * s * across, c * s * (along - across),
        s * s * along + c * c * across,
    )  # fmt: skip


def _enter(e: EstimateRecord, covariance: Floats, landmark: int, distance: float, bearing: float) -> float:
    """Correct the estimate by a sighting; return the squared innovation over its covariance.

    Turned into the map frame, a sighting measures the landmark's place less the ring's, and its derivative by the
    heading's error is zero (see `perception.localization.drift.landmark_filter`). It is entered along its direction,
    then across.
    """
    est = e[0]
    row, axis = FIRST + 2 * landmark, est.heading + bearing
    along, across = noise(distance)
    axes = (along, math.cos(axis), math.sin(axis), distance), (across, -math.sin(axis), math.cos(axis), 0.0)

    def look(ux: float, uy: float, seen: float) -> tuple[float, float]:
        """Return the innovation in a direction, and the variance of what was predicted."""
        off = ux * (est.landmarks[landmark].x - est.x) + uy * (est.landmarks[landmark].y - est.y)
        return seen - off, innovation_variance(covariance, rows_used(e), row, ux, uy, 0.0, est.gain)

    squared = 0.0
    for variance, *direction in axes:
        innovation, predicted = look(*direction)
        squared += innovation**2 / (predicted + variance)
    if squared <= GATE_SIGMAS**2:
        excess = max(1.0, math.sqrt(squared) / ROBUST_SIGMAS) ** 2
        for variance, *direction in axes:
            innovation, predicted = look(*direction)
            correct(e, covariance, innovation, predicted + excess * variance)
    return squared
