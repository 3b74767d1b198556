"""The heading of the map, found again from the first firings once the map is known.

The heading of the map is that of odometry at the first firing. The filter enters the first firings among landmarks
that it hardly knows. Which sensors hear them shows the heading then much worse than later, and an extended filter
cannot take back how little it made of that. So a second filter enters the first firings once more, with any heading
and with the landmarks' places relative to each other as they are known by now. What the first filter believes of the
heading of its map is replaced by what the second one finds, so that no firing counts twice for it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import wrap_angle
from perception.kernel import Floats
from perception.localization.landmark_state import FIRST, HEADING, OFFSET, X, Y
from perception.localization.landmark_tracker import OFFSET_SIGMA_RAD, POSE, LandmarkTracker, fit_of_turn

FIRST_FIRINGS: Final = 160
"""So many are kept, …"""
APART_M: Final = 0.01
APART_RAD: Final = math.radians(0.5)
"""… each at least so far from the one before, or turned so much."""
BEGIN_M: Final = 10.0
AGAIN: Final = 3.0
"""The map is known well enough after this way, better after so many times this way, and so on; so is the heading's
random walk."""
LANDMARKS_MIN: Final = 2
ENTERED_AT_ONCE: Final = 8
"""Kept firings that are entered with each new one: bounds the work."""
HEADING_SIGMA: Final = math.radians(3.0)
PLACE_SIGMA_M: Final = 0.05
"""Standard deviations of the map's turn about the start, and of its shift, before the second filter."""


class MapHeading:
    """The second filter.

    Parameters
    ----------
    ring : RingConfig
        The sensors.

    Attributes
    ----------
    turn : float
        By this the first filter's map is to be turned about the start, rad; 0 until the second one has finished.
    start_x, start_y : float
        The place of the first firing, m.
    """

    def __init__(self, ring: RingConfig) -> None:
        self._tracker = LandmarkTracker(ring)
        self._rows = np.zeros((FIRST_FIRINGS, POSE + len(ring.mounts)))
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing."""
        self._kept = 0
        self._is_entering = False
        self._due_m = BEGIN_M
        self.turn = self.start_x = self.start_y = 0.0

    def keep(self, row: Floats) -> None:
        """Keep a firing, as `LandmarkTracker` takes it, if it is one of the first."""
        if self._kept == FIRST_FIRINGS:
            return
        if self._kept == 0:
            self.start_x, self.start_y = row[:2].tolist()
        else:
            x, y, _, yaw = (row[:POSE] - self._rows[self._kept - 1, :POSE]).tolist()
            if math.hypot(x, y) < APART_M and abs(wrap_angle(yaw)) < APART_RAD:
                return
        self._rows[self._kept] = row
        self._kept += 1

    def renew(self, known: LandmarkTracker, way_m: float) -> None:
        """Do a part of the work after a firing; at its end, set `turn` and the covariance of the first filter.

        Parameters
        ----------
        known : LandmarkTracker
            The first filter; its covariance becomes one about the map turned by `turn`.
        way_m : float
            Way driven, m.
        """
        if known.is_synchro:  # the ring of a synchro drive keeps its direction: the heading is known
            return
        if not self._is_entering:
            if way_m < self._due_m or known.e[0].count < LANDMARKS_MIN:
                return
            self._begin(known)
            self._is_entering = True
            self._due_m = AGAIN * way_m
        for _ in range(min(ENTERED_AT_ONCE, self._kept - self._tracker.entered)):
            self._tracker.enter(self._rows[self._tracker.entered])
        if self._tracker.entered == self._kept:
            self._finish(known)

    def _begin(self, known: LandmarkTracker) -> None:
        """Give the second filter the first one's map, turned by an unknown angle about the start."""
        mine = self._tracker
        mine.reset()
        mine.assume_walk_of(known)
        mine.estimate[...] = known.estimate
        e = mine.e[0]
        for sensor in e.sensors:
            sensor.is_known = 0
        e.offset = e.offset_correction = e.heading_correction = 0.0
        e.fit_share = 1.0
        landmarks = points_of(known)
        fit = fit_of_heading(landmarks)
        n = len(fit)
        relative = without_heading(known.covariance[:n, :n], fit, self._turning(landmarks))
        for row in (HEADING, X, Y, OFFSET):
            relative[row, :] = relative[:, row] = 0.0
        relative[OFFSET, OFFSET] = OFFSET_SIGMA_RAD**2
        shifts = np.zeros((2, n))
        shifts[0, FIRST::2] = shifts[1, FIRST + 1 :: 2] = PLACE_SIGMA_M
        turn = np.zeros(n)
        turn[FIRST:] = (
            HEADING_SIGMA * np.column_stack([self.start_y - landmarks[:, 1], landmarks[:, 0] - self.start_x]).ravel()
        )
        for error in (turn, *shifts):
            relative += np.outer(error, error)
        mine.covariance[:n, :n] = relative

    def _finish(self, known: LandmarkTracker) -> None:
        """Compare the maps of both filters, and replace what the first believes of the heading of its own."""
        numbers, xs, ys = known.landmarks("number", "x", "y")
        mine = dict(zip(*self._tracker.landmarks("number"), points_of(self._tracker), strict=True))
        common = [k for k, number in enumerate(numbers) if number in mine]
        self._is_entering = False
        if len(common) < LANDMARKS_MIN:
            return
        before = np.column_stack([xs, ys])[common]
        after = np.array([mine[numbers[k]] for k in common])
        fit = fit_of_heading(points_of(self._tracker))
        n = len(fit)
        variance = float(fit @ self._tracker.covariance[:n, :n] @ fit)
        self.turn = turn_between(before, after)
        landmarks = points_of(known)
        turning, fit = self._turning(landmarks), fit_of_heading(landmarks)
        n = len(fit)
        relative = without_heading(known.covariance[:n, :n], fit, turning)
        known.covariance[:n, :n] = relative + variance * np.outer(turning, turning)

    def _turning(self, landmarks: Floats) -> Floats:
        """Return how the errors of all rows change as map and ring turn about the start: (rows,)."""
        turning = np.zeros(FIRST + landmarks.size)
        turning[HEADING] = 1.0
        turning[X], turning[Y] = self.start_y, -self.start_x
        turning[FIRST::2], turning[FIRST + 1 :: 2] = self.start_y, -self.start_x
        return turning


def points_of(tracker: LandmarkTracker) -> Floats:
    """Return the places of a filter's landmarks, m, shape (count, 2)."""
    return np.column_stack(tracker.landmarks("x", "y"))


def fit_of_heading(landmarks: Floats) -> Floats:
    """Return the weights of all rows' errors in that of the map's heading: the best turn of the landmarks.

    A landmark's error is relative to the ring's heading, which is why that counts in full.

    Parameters
    ----------
    landmarks : (count, 2) float
        Their places, m.

    Returns
    -------
    (rows,) float
    """
    fit = np.zeros(FIRST + landmarks.size)
    fit[HEADING] = 1.0
    fit[FIRST:] = fit_of_turn(landmarks)
    return fit


def without_heading(covariance: Floats, fit: Floats, turning: Floats) -> Floats:
    """Return the covariance of what is left when the fitted heading's error is taken out of all rows.

    Parameters
    ----------
    covariance : (rows, rows) float
        P.
    fit, turning : (rows,) float
        c and g, of which cᵀg = 1: the result is (I − g cᵀ) P (I − g cᵀ)ᵀ.
    """
    carried = covariance @ fit
    across = np.outer(turning, carried)
    left: Floats = covariance - across - across.T + float(fit @ carried) * np.outer(turning, turning)
    return left


def turn_between(before: Floats, after: Floats) -> float:
    """Return the angle of the best rigid motion from points to points, both of shape (n, 2), rad."""
    a, b = before - before.mean(axis=0), after - after.mean(axis=0)
    return math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
