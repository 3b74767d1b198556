"""Drift corrected from recognised objects: odometry and firings in, the ring's pose in the map frame out.

The map frame is odometry's at the first firing. Objects that perception recognises become landmarks of the filter.
From then on each raw range of theirs corrects pose, landmarks and scales (`perception.localization.landmark_ranges`).
The first objects are recognised after a metre or two. Until then firings wait in a buffer, so that the filter can
begin at the first one: otherwise the drift of that way would turn the map for good.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.kernel import Floats
from perception.localization.landmark_filter import add_landmark, propagate, remove_landmark
from perception.localization.landmark_ranges import update_with_firing
from perception.localization.landmark_state import (
    FIRST,
    HEADING,
    ODOMETER,
    OFFSET,
    RANGE,
    ROWS_MAX,
    TURN,
    Estimate,
    X,
    Y,
)
from perception.records import records, zeros
from perception.sensor_mounts import mounts_array

Status: TypeAlias = Literal["tracking", "localizing", "lost"]

OFFSET_SIGMA_RAD: Final = math.radians(0.5)
ODOMETER_SIGMA: Final = 0.03
TURN_SIGMA: Final = 0.01
RANGE_SIGMA: Final = 0.01
"""Standard deviations of the slow states at the start."""
HEADING_WALK: Final = math.radians(1.0) ** 2
"""Variance of the heading by odometry, rad²/m: the value at the start, …"""
HEADING_WALK_MIN: Final = math.radians(0.1) ** 2
WALK_WINDOW_M: Final = 0.5
WALK_PRIOR: Final = 4
WALK_MEMORY: Final = 0.06
"""… its least value, the way after which it is renewed, how many renewals the first value is worth, and the least
share of one renewal."""
PLACE_WALK: Final = 0.002**2
"""Variance of a displacement by odometry on each axis, m²/m."""
SLIP_SHARE: Final = 0.4
"""With fewer of the expected echoes than this, the wheels may have slipped: odometry is then trusted less."""
SLIP_M: Final = 0.02
SLIP_RAD: Final = math.radians(1.0)
"""Standard deviations that each firing adds then."""
LOST_SHARE: Final = 0.25
"""With fewer than this the robot is lost."""
RANGE_NOISE: Final = 0.01
RANGE_NOISE_M: Final = 0.001
"""Nominal noise of a range: a share of it, and one that does not depend on it; the filter estimates the true one."""

FIRST_SIGMA_M: Final = 0.05
NEW_SIGMA_M: Final = 0.04
MOVED_SIGMA_M: Final = 0.1
"""Standard deviation of a landmark's place relative to the ring, which is perception's from a drifting path: of the
first landmarks, of later ones, and of one that has moved."""
FAILURES_MAX: Final = 3
"""A landmark that fails so often in succession, while others answer, has moved."""
FIRST_LANDMARKS: Final = 3
FIRST_WAY_M: Final = 2.5
LONGEST_WAY_M: Final = 5.0
"""The filter begins with so many landmarks, after the first of these ways with one, after the second with none."""
WAITING_MAX: Final = 240
"""Firings that can wait."""
CATCHING_UP: Final = 8
"""Waiting firings that are entered with each new one: bounds the work."""
POSE: Final = 4
"""Numbers of a waiting firing before its ranges: the pose of the base, and the ring's direction."""
NOT_FIRED: Final = -1.0
SILENT_M: Final = 1e6
"""What a waiting firing holds in place of NaN and infinity: numbers, as everything that a recording holds."""
TURNED_RAD: Final = 1e-9
"""A ring that turns otherwise than the wheels, by more than this, is one of a synchro drive."""


class LocalizedPose(NamedTuple):
    """The robot in the map frame."""

    pose: Pose
    """Position (m) and direction of travel (rad)."""
    ring_yaw: float
    """Direction of the ring's sensor 0, rad."""
    covariance: Floats
    """Of x, y (m) and heading (rad), shape (3, 3)."""
    status: Status
    probability: float
    """Share of the expected echoes that came lately: near 1 where pose and map are right."""


class SeenObject(NamedTuple):
    """A round object that perception recognised, in the map frame, m."""

    number: int
    x: float
    y: float
    radius: float


class LandmarkPlace(NamedTuple):
    """A landmark's place in the map frame (m) and its covariance xx, xy, yy (m²)."""

    x: float
    y: float
    covariance: tuple[float, float, float]


class DriftCorrection:
    """The landmark filter of one run.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    """

    SCRATCH: Final = ("e",)
    """A view of the same memory, left out of snapshots."""

    def __init__(self, ring: RingConfig) -> None:
        self._mounts = mounts_array(ring.mounts)
        half_step_m = 0.5 * ring.resolution_m
        self._ring = np.array([
            half_step_m**2 / 3.0 + RANGE_NOISE_M**2, RANGE_NOISE**2, math.radians(ring.beam_half_angle_deg),
            ring.range_min_m + half_step_m, ring.range_max_m,
        ])  # fmt: skip
        """What `update_with_firing` takes after the pose."""
        self._estimate = zeros(Estimate, 1)
        self.e = records(Estimate, self._estimate)
        """The mean."""
        self.covariance = np.zeros((ROWS_MAX, ROWS_MAX))
        self._waiting = np.zeros((WAITING_MAX, POSE + len(self._mounts)))
        self._entered_at = np.zeros(POSE)
        """Odometry at the last firing that was entered: x, y (m), direction of travel and of the ring (rad)."""
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing, whose odometry defines the map frame."""
        self._estimate.view(np.uint8)[...] = 0
        self.covariance[...] = 0.0
        slow = (OFFSET, OFFSET_SIGMA_RAD), (ODOMETER, ODOMETER_SIGMA), (TURN, TURN_SIGMA), (RANGE, RANGE_SIGMA)
        for row, sigma in slow:
            self.covariance[row, row] = sigma**2
        e = self.e[0]
        e.odometer_scale = e.range_scale = e.noise = e.fit_share = 1.0
        self._arrived = self._entered = 0
        self._has_started = False
        self._is_synchro = False
        self._way_m = 0.0
        self._walk = HEADING_WALK
        self._windows = 0
        self._window_m = 0.0
        self._window_variance = -1.0

    @property
    def heading_walk(self) -> float:
        """The estimated random walk of the heading by odometry, rad per √m."""
        return math.sqrt(self._walk)

    def observe(self, firing: Firing) -> None:
        """Enter a firing, or let it wait for the first landmarks."""
        if self._arrived - self._entered == WAITING_MAX:
            self._enter_next()
        row = self._waiting[self._arrived % WAITING_MAX]
        row[:POSE] = firing.pose.x, firing.pose.y, firing.pose.theta, firing.ring_yaw
        row[POSE:] = np.nan_to_num(firing.ranges_m, nan=NOT_FIRED, posinf=SILENT_M, neginf=NOT_FIRED)
        if self._arrived > 0:
            before = self._waiting[(self._arrived - 1) % WAITING_MAX]
            self._way_m += math.hypot(row[0] - before[0], row[1] - before[1])
        self._arrived += 1
        self._has_started = self._has_started or self._way_m > LONGEST_WAY_M
        if self._has_started:
            for _ in range(min(CATCHING_UP, self._arrived - self._entered)):
                self._enter_next()

    def learn(self, seen: Iterable[SeenObject]) -> None:
        """Make landmarks of recognised objects that are none yet; drop those that are no longer recognised.

        Parameters
        ----------
        seen : iterable of SeenObject
            Near the robot. A landmark beyond the sensors' range stays: perception has archived its object.
        """
        objects = {one.number: one for one in seen}
        if self._has_started and self._arrived > self._entered:
            return  # what perception sees now is later than the filter
        if not self._has_started and len(objects) < (1 if self._way_m > FIRST_WAY_M else FIRST_LANDMARKS):
            return
        if self._entered == 0:
            self._enter_next()
        numbers, failures, xs, ys = self._landmarks("number", "failures", "x", "y")
        e, range_max = self.e[0], float(self._ring[-1])
        is_near = [math.hypot(x - e.x, y - e.y) < range_max for x, y in zip(xs, ys, strict=True)]
        has_slipped = e.fit_share <= SLIP_SHARE
        moved = {n for n, failed in zip(numbers, failures, strict=True) if failed >= FAILURES_MAX and not has_slipped}
        for i in range(len(numbers) - 1, -1, -1):
            if numbers[i] in moved or (is_near[i] and numbers[i] not in objects):
                remove_landmark(self.e, self.covariance, i)
        for number in sorted(objects.keys() - (set(numbers) - moved)):
            sigma = MOVED_SIGMA_M if number in moved else NEW_SIGMA_M if self._has_started else FIRST_SIGMA_M
            self._add(objects[number], sigma)
        if not self._has_started:
            self._turn_landmarks(HEADING_WALK * self._way_m)
        self._has_started = True

    def corrected(self, firing: Firing) -> Firing:
        """Return the firing that was observed last, at its pose in the map frame and with ranges in true metres."""
        pose, ring_yaw = self._pose_of(firing.pose, firing.ring_yaw)
        return Firing(firing.robot_s, pose, ring_yaw, firing.ranges_m / self.e[0].range_scale)

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame, at the last firing."""
        if self._arrived == 0:
            return Pose(0.0, 0.0, 0.0)
        x, y, theta, yaw = self._waiting[(self._arrived - 1) % WAITING_MAX, :POSE].tolist()
        here, here_yaw = self._pose_of(Pose(x, y, theta), yaw)
        return Pose(x, y, yaw).compose(Pose(here.x, here.y, here_yaw).inverse())

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing."""
        e = self.e[0]
        if self._arrived == 0:
            return LocalizedPose(Pose(0.0, 0.0, 0.0), 0.0, np.zeros((3, 3)), "localizing", 1.0)
        x, y, theta, yaw = self._waiting[(self._arrived - 1) % WAITING_MAX, :POSE].tolist()
        pose, ring_yaw = self._pose_of(Pose(x, y, theta), yaw)
        to = np.zeros((3, FIRST))
        to[0, X] = to[1, Y] = to[2, HEADING] = to[2, OFFSET] = 1.0
        to[0, HEADING], to[1, HEADING] = -e.y, e.x
        covariance = to @ self.covariance[:FIRST, :FIRST] @ to.T
        share = float(e.fit_share)
        is_caught_up = e.count > 0 and self._arrived == self._entered
        status: Status = "lost" if share < LOST_SHARE else "tracking" if is_caught_up else "localizing"
        return LocalizedPose(pose, ring_yaw, covariance, status, share)

    def places(self) -> dict[int, LandmarkPlace]:
        """Return where the landmarks are, by the objects' numbers."""
        found = {}
        for i, (number, x, y) in enumerate(zip(*self._landmarks("number", "x", "y"), strict=True)):
            rows = [HEADING, FIRST + 2 * i, FIRST + 2 * i + 1]
            to = np.array([[-y, 1.0, 0.0], [x, 0.0, 1.0]])
            (xx, xy), (_, yy) = (to @ self.covariance[np.ix_(rows, rows)] @ to.T).tolist()
            found[number] = LandmarkPlace(x, y, (xx, xy, yy))
        return found

    def moved_landmarks(self, least_m: float, among: Container[int]) -> list[tuple[int, float, float]]:
        """Return number and displacement (m) of each landmark that moved so far since it was last returned.

        Parameters
        ----------
        least_m : float
            Least displacement, m.
        among : container of int
            Numbers of the objects that perception can move: those that it has not archived.
        """
        moved = []
        columns = self._landmarks("number", "x", "y", "anchor_x", "anchor_y")
        for i, (number, x, y, anchor_x, anchor_y) in enumerate(zip(*columns, strict=True)):
            dx, dy = x - anchor_x, y - anchor_y
            if number in among and math.hypot(dx, dy) >= least_m:
                landmark = self.e[0].landmarks[i]
                landmark.anchor_x, landmark.anchor_y = x, y
                moved.append((number, dx, dy))
        return moved

    def _landmarks(self, *names: str) -> list[list[Any]]:
        """Return fields of all landmarks as lists of numbers."""
        landmarks = self._estimate["landmarks"][0, : int(self._estimate["count"][0])]
        return [landmarks[name].tolist() for name in names]

    def _pose_of(self, pose: Pose, ring_yaw: float) -> tuple[Pose, float]:
        """Return pose and ring direction in the map frame for those by odometry, at a firing that may still wait."""
        if self._entered == 0:
            return pose, ring_yaw
        x, y, _, yaw = self._entered_at.tolist()
        mean_x, mean_y, heading, offset = (float(self._estimate[name][0]) for name in ("x", "y", "heading", "offset"))
        off = heading - yaw
        c, s = math.cos(off), math.sin(off)
        dx, dy = pose.x - x, pose.y - y
        here = Pose(mean_x + c * dx - s * dy, mean_y + s * dx + c * dy, pose.theta + off + offset)
        return here, ring_yaw + off

    def _enter_next(self) -> None:
        """Move the filter to the oldest waiting firing and enter its ranges."""
        row = self._waiting[self._entered % WAITING_MAX]
        x, y, theta, yaw = row[:POSE].tolist()
        e = self.e[0]
        if self._entered == 0:
            e.x, e.y, e.heading = x, y, yaw
        else:
            self._move(x, y, theta, yaw)
        self._entered_at[:] = x, y, theta, yaw
        self._entered += 1
        update_with_firing(self.e, self.covariance, self._mounts, row[POSE:], x, y, yaw, *self._ring.tolist())

    def _move(self, x: float, y: float, theta: float, yaw: float) -> None:
        """Follow odometry to a position (m), a direction of travel and a direction of the ring (rad)."""
        x_before, y_before, theta_before, yaw_before = self._entered_at.tolist()
        c, s = math.cos(theta_before), math.sin(theta_before)
        dx, dy = x - x_before, y - y_before
        ring_turn, travel_turn = wrap_angle(yaw - yaw_before), wrap_angle(theta - theta_before)  # a log may wrap them
        self._is_synchro = self._is_synchro or abs(wrap_angle(travel_turn - ring_turn)) > TURNED_RAD
        way = math.hypot(dx, dy)
        self._renew_walk(way)
        turn_variance, place_variance = self._walk * way, PLACE_WALK * way
        slip_m2 = slip_rad2 = 0.0
        if self.e[0].fit_share < SLIP_SHARE:
            slip_m2, slip_rad2 = SLIP_M**2, SLIP_RAD**2
        propagate(
            self.e, self.covariance, c * dx + s * dy, c * dy - s * dx, theta_before - yaw_before, ring_turn,
            travel_turn, (0.0 if self._is_synchro else turn_variance) + slip_rad2,
            turn_variance if self._is_synchro else 0.0, place_variance + slip_m2,
        )  # fmt: skip

    def _renew_walk(self, way: float) -> None:
        """Estimate the random walk of the heading from the filter's corrections.

        Corrections of a consistent filter are uncorrelated: over a way w their sum has the variance
        P(start) + q w − P(end) (after K. Myers and B. Tapley, "Adaptive sequential estimation with unknown noise
        statistics", 1976).
        """
        self._window_m += way
        if self._window_m < WALK_WINDOW_M:
            return
        e, row = self.e[0], OFFSET if self._is_synchro else HEADING
        seen = e.offset_correction if self._is_synchro else e.heading_correction
        variance = float(self.covariance[row, row])
        if self._window_variance >= 0.0 and e.count >= 2:
            found = (seen * seen + variance - self._window_variance) / self._window_m
            self._windows += 1
            share = max(WALK_MEMORY, 1.0 / (self._windows + WALK_PRIOR))
            self._walk = max(HEADING_WALK_MIN, self._walk + share * (found - self._walk))
        self._window_m, self._window_variance = 0.0, variance
        e.offset_correction = e.heading_correction = 0.0

    def _turn_landmarks(self, variance: float) -> None:
        """Add to all landmarks the error of a common turn about the robot's present place, of this variance (rad²).

        Perception sees the first ones from a way whose heading drifts.
        """
        x, y = self._waiting[(self._arrived - 1) % WAITING_MAX, :2].tolist()
        xs, ys = (np.array(values) for values in self._landmarks("x", "y"))
        lever = np.column_stack([y - ys, xs - x]).reshape(-1)
        end = FIRST + len(lever)
        self.covariance[FIRST:end, FIRST:end] += variance * np.outer(lever, lever)

    def _add(self, seen: SeenObject, sigma_m: float) -> None:
        """Add a landmark that stands where perception sees it, relative to the ring, with this standard deviation."""
        e = self.e[0]
        c, s = math.cos(e.heading), math.sin(e.heading)
        dx, dy = seen.x - e.x, seen.y - e.y
        i = add_landmark(self.e, self.covariance, c * dx + s * dy, c * dy - s * dx, sigma_m**2, 0.0, sigma_m**2)
        if i < 0:
            return
        landmark = e.landmarks[i]
        landmark.radius, landmark.number = seen.radius, seen.number
        landmark.anchor_x, landmark.anchor_y = seen.x, seen.y
