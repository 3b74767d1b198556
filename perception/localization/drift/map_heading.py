"""Where the map lies relative to the first firing, found again from the first firings once the map is known.

The map frame is odometry's at the first firing. The filter enters the first firings among landmarks that it hardly
knows, with a random walk of the heading that it only guesses. Which sensors hear the landmarks shows the heading then
much worse than later, and an extended filter cannot take back how little, or how much, it made of that. So a second
filter enters the first firings once more, with any heading, with the walk found by now, and with the landmarks'
places relative to each other as they are known by now. What the first filter believes of the heading and the place of
its map is replaced by what the second one finds, so that no firing counts twice for it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import wrap_angle
from perception.bounds import FINITE, PLACE, bounds, up_to
from perception.kernel import Floats
from perception.localization.drift.landmark_filter import remove_landmark
from perception.localization.drift.landmark_state import FIRST, HEADING, ODOMETER, OFFSET, RANGE, TURN, X, Y
from perception.localization.drift.landmark_tracker import OFFSET_SIGMA_RAD, POSE, LandmarkTracker

FIRST_FIRINGS: Final = 160
"""So many first firings are kept."""
ENTERED_APART_M: Final = 0.01
"""Each kept firing is at least so far from the one before, or turned by `ENTERED_APART_RAD`."""
ENTERED_APART_RAD: Final = math.radians(0.5)
"""Turn in `ENTERED_APART_M`."""
BEGIN_M: Final = 10.0
"""The map is known well enough after this way."""
AGAIN: Final = 3.0
"""The map is known better after so many times this way, and so on; so is the heading's random walk."""
LANDMARKS_MIN: Final = 2
"""Least landmarks that determine a map's turn and shift."""
ENTERED_AT_ONCE: Final = 8
"""Firings that wait or are kept that are entered with each new one: bounds the work."""
MOTION_SIGMAS: Final = (math.radians(3.0), 0.05, 0.05)
"""Standard deviations of the map's turn about the start (rad), and of its shift (m), before the second filter."""
FITTED_TIMES: Final = 3
"""The motion between two maps is fitted so often: each time, what is left of the turn is squared."""


class MapHeading:
    """The second filter.

    Parameters
    ----------
    ring : RingConfig
        The sensors.

    Attributes
    ----------
    motion : (3,) float
        The first filter's map is to be turned by this about the start (rad), and shifted along x and y (m); 0 until
        the second one has finished.
    start_x, start_y : float
        The place of the first firing, m.
    """

    BOUNDS: Final = bounds(
        {"_tracker.entered": up_to(FIRST_FIRINGS)},
        _rows=PLACE,
        motion=PLACE,
        _kept=up_to(FIRST_FIRINGS),
        _due_m=FINITE,
        start_x=PLACE,
        start_y=PLACE,
    )

    def __init__(self, ring: RingConfig) -> None:
        self._tracker = LandmarkTracker(ring)
        self._rows = np.zeros((FIRST_FIRINGS, POSE + len(ring.mounts)))
        self.motion = np.zeros(3)
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing."""
        self._kept = 0
        self._is_entering = False
        self._due_m = BEGIN_M
        self.motion[:] = self.start_x = self.start_y = 0.0

    def keep(self, row: Floats) -> None:
        """Keep a firing, as `LandmarkTracker` takes it, if it is one of the first."""
        if self._kept == FIRST_FIRINGS:
            return
        if self._kept == 0:
            self.start_x, self.start_y = row[:2].tolist()
        else:
            x, y, _, yaw = (row[:POSE] - self._rows[self._kept - 1, :POSE]).tolist()
            if math.hypot(x, y) < ENTERED_APART_M and abs(wrap_angle(yaw)) < ENTERED_APART_RAD:
                return
        self._rows[self._kept] = row
        self._kept += 1

    def renew(self, known: LandmarkTracker, way_m: float) -> None:
        """Do a part of the work after a firing; at its end, set `motion` and the covariance of the first filter.

        Parameters
        ----------
        known : LandmarkTracker
            The first filter; its covariance becomes one about the map after `motion`.
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
        """Give the second filter the first one's map, after an unknown motion; its ring has the known start."""
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
        moving, of_places = self._moving(landmarks), place_errors(landmarks)
        n = len(moving)
        covariance = known.covariance[:n, :n]
        weights, _ = fit_of_motion(of_places @ covariance @ of_places.T, of_places @ moving)
        kept = np.zeros((n, n))
        for row in (ODOMETER, TURN, RANGE):
            kept[row, row] = 1.0
        kept[FIRST:] = of_places  # of a ring whose heading is right
        mine.covariance[:n, :n] = kept @ without_motion(covariance, of_places.T @ weights, moving) @ kept.T
        mine.covariance[OFFSET, OFFSET] = OFFSET_SIGMA_RAD**2
        spread = of_places @ moving * MOTION_SIGMAS
        mine.covariance[FIRST:n, FIRST:n] += spread @ spread.T
        (moved,) = mine.landmarks("moved")
        for i in range(len(moved) - 1, -1, -1):
            if moved[i] == 1:  # it stood elsewhere at the first firings
                remove_landmark(mine.e, mine.covariance, i)

    def _finish(self, known: LandmarkTracker) -> None:
        """Compare the maps of both filters, and replace what the first believes of where its own lies."""
        self._is_entering = False
        (numbers,), (mine,) = known.landmarks("number"), self._tracker.landmarks("number")
        common = [number for number in numbers if number in mine]
        if len(common) < LANDMARKS_MIN:
            return
        places, own_places = points_of(known), points_of(self._tracker)
        at, own_at = [numbers.index(number) for number in common], [mine.index(number) for number in common]
        moving, of_common = self._moving(places), rows_of(place_errors(places), at)
        own_common = rows_of(place_errors(own_places), own_at)
        n, m = len(moving), own_common.shape[1]
        weights, variance = fit_of_motion(
            own_common @ self._tracker.covariance[:m, :m] @ own_common.T, of_common @ moving
        )
        start = np.array([self.start_x, self.start_y])
        self.motion[:] = motion_between(places[at] - start, own_places[own_at] - start, weights)
        relative = without_motion(known.covariance[:n, :n], of_common.T @ weights, moving)
        known.covariance[:n, :n] = relative + moving @ variance @ moving.T

    def _moving(self, landmarks: Floats) -> Floats:
        """Return how the errors of all rows change with a turn of map and ring about the start, and with a shift.

        Parameters
        ----------
        landmarks : (count, 2) float
            Their places, m.

        Returns
        -------
        (rows, 3) float
        """
        moving = np.zeros((FIRST + landmarks.size, 3))
        moving[HEADING, 0] = 1.0
        for rows, column, lever in (
            ([X, *range(FIRST, len(moving), 2)], 1, self.start_y),
            ([Y, *range(FIRST + 1, len(moving), 2)], 2, -self.start_x),
        ):
            moving[rows, 0], moving[rows, column] = lever, 1.0
        return moving


def points_of(tracker: LandmarkTracker) -> Floats:
    """Return the places of a filter's landmarks, m, shape (count, 2)."""
    return np.column_stack(tracker.landmarks("x", "y"))


def place_errors(landmarks: Floats) -> Floats:
    """Return how the landmarks' places err with the errors of all rows.

    A landmark's row is relative to the ring's heading: a true place is p = R(δθ) p̂ + δp, to first order.

    Parameters
    ----------
    landmarks : (count, 2) float
        Their places, m.

    Returns
    -------
    (2 count, rows) float
    """
    errors = np.zeros((landmarks.size, FIRST + landmarks.size))
    errors[:, HEADING] = np.column_stack([-landmarks[:, 1], landmarks[:, 0]]).ravel()
    errors[:, FIRST:] = np.eye(landmarks.size)
    return errors


def rows_of(errors: Floats, landmarks: list[int]) -> Floats:
    """Return the rows of some landmarks from what `place_errors` returns: shape (2 n, rows)."""
    chosen: Floats = errors.reshape(-1, 2, errors.shape[1])[landmarks].reshape(-1, errors.shape[1])
    return chosen


def fit_of_motion(covariance: Floats, moving: Floats) -> tuple[Floats, Floats]:
    """Return the weights of places' errors in the most likely common motion, and that motion's covariance.

    It is the generalised least squares of A. C. Aitken (1935): what it leaves of the errors is independent of it.

    Parameters
    ----------
    covariance : (2 n, 2 n) float
        W, of the errors, m².
    moving : (2 n, 3) float
        M, how a turn about the start and a shift change the places.

    Returns
    -------
    weights : (2 n, 3) float
        W⁻¹ M V.
    variance : (3, 3) float
        V = (Mᵀ W⁻¹ M)⁻¹.
    """
    solved = np.linalg.solve(covariance, moving)
    variance = np.linalg.inv(moving.T @ solved)
    return solved @ variance, variance


def without_motion(covariance: Floats, weights: Floats, moving: Floats) -> Floats:
    """Return the covariance of what is left when the fitted motion is taken out of all rows.

    Parameters
    ----------
    covariance : (rows, rows) float
        P.
    weights, moving : (rows, 3) float
        C and G, of which CᵀG = I: the result is (I − G Cᵀ) P (I − G Cᵀ)ᵀ.
    """
    carried = covariance @ weights
    across = moving @ carried.T
    left: Floats = covariance - across - across.T + moving @ (weights.T @ carried) @ moving.T
    return left


def motion_between(before: Floats, after: Floats, weights: Floats) -> Floats:
    """Return the motion from places to places, relative to the start: turn (rad) and shift (m).

    Parameters
    ----------
    before, after : (n, 2) float
        m.
    weights : (2 n, 3) float
        As from `fit_of_motion`.
    """
    motion = np.zeros(3)
    for _ in range(FITTED_TIMES):
        c, s = math.cos(motion[0]), math.sin(motion[0])
        moved = before @ np.array([[c, s], [-s, c]]) + motion[1:]
        motion += weights.T @ (after - moved).ravel()
    return motion
