"""Drift corrected from recognised objects: odometry and firings in, the ring's pose in the map frame out.

The map frame is odometry's at the first firing. Objects that perception recognises become landmarks of the filter.
From then on each raw range of theirs corrects pose, landmarks and scales
(`perception.localization.drift.landmark_ranges`). The first objects are recognised after a metre or two. Until then
firings wait in a buffer, so that the filter can begin at the first one: otherwise the drift of that way would turn
the map for good.

Odometry is taken as exact until the readings refute that (`perception.localization.drift.drift_evidence`). Until then
poses, ranges and objects are left exactly as they are, while the filter runs beside them.

What perception holds stays in the frame in which the filter began. The map frame is the filter's frame after
the motion that `perception.localization.drift.map_heading` finds once the map is known.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from config.robot import RingConfig
from drivers.messages import IDENTITY, Firing, Pose
from perception.bounds import CONSTANT, COUNT, FINITE, PLACE, bounds
from perception.kernel import Floats
from perception.localization.drift.drift_evidence import DriftEvidence
from perception.localization.drift.landmark_filter import add_landmark, remove_landmark
from perception.localization.drift.landmark_state import FIRST, HEADING, OFFSET, EstimateRecord, X, Y
from perception.localization.drift.landmark_tracker import POSE, LandmarkTracker
from perception.localization.drift.map_heading import ENTERED_AT_ONCE, MapHeading
from perception.localization.drift.slip import echoes_of_cycle, find_slip
from perception.localization.localized_pose import LocalizedPose, Status
from perception.sensor_mounts import mounts_array
from perception.shared_numbers import FAR

LOST_SHARE: Final = 0.25
"""With fewer than this the robot is lost."""
FIRST_LANDMARK_SIGMA_M: Final = 0.05
"""Standard deviation of the first landmarks' places relative to the ring, which are perception's from a drifting
path."""
NEW_SIGMA_M: Final = 0.04
"""Standard deviation of later landmarks' places."""
MOVED_SIGMA_M: Final = 0.1
"""Standard deviation of the place of a landmark that has moved."""
FAILURES_MAX: Final = 3
"""A landmark that fails so often in succession, while others answer, has moved."""
FIRST_LANDMARKS: Final = 3
"""The filter begins with so many landmarks."""
FIRST_WAY_M: Final = 2.5
"""After this way the filter begins with one landmark."""
LONGEST_WAY_M: Final = 5.0
"""After this way the filter begins without a landmark."""
WAITING_MAX: Final = 240
"""Firings that can wait."""
NOT_FIRED: Final = -1.0
"""What a waiting firing holds in place of NaN, for a sensor that did not fire: recordings hold numbers."""
CYCLE_FIRINGS: Final = 3
"""Firings from one check for a slip to the next one."""
CYCLE_FIRINGS_MAX: Final = 24
"""Most firings of which one check looks at the echoes."""
TURN_PER_M: Final = math.radians(1.0)
SHIFT_PER_M: Final = 0.02
"""The map frame turns (rad/m) and shifts (m/m) no faster as the robot drives: it does not jump."""
MOTION_PER_M: Final = np.array([TURN_PER_M, SHIFT_PER_M, SHIFT_PER_M])
"""The map frame moves no faster than this, rad and m for each metre of way."""


class SeenObject(NamedTuple):
    """A round object that perception recognised, in the filter's frame, m."""

    number: int
    x: float
    y: float
    radius: float


def _failed(numbers: Iterable[int], failures: Iterable[int]) -> set[int]:
    """Return the landmarks that have failed so often that they have moved."""
    return {number for number, failed in zip(numbers, failures, strict=True) if failed >= FAILURES_MAX}


class LandmarkPlace(NamedTuple):
    """A landmark's place (m) and its covariance xx, xy, yy (m²)."""

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

    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        _range_min_m=CONSTANT,
        _waiting=PLACE,
        _arrived=COUNT,
        _way_m=FINITE,
        _motion=PLACE,
        _checked=COUNT,
    )

    def __init__(self, ring: RingConfig) -> None:
        self._tracker = LandmarkTracker(ring)
        self._evidence = DriftEvidence(ring)
        self._map_heading = MapHeading(ring)
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._range_min_m = ring.range_min_m + 0.5 * ring.resolution_m
        self._waiting = np.zeros((WAITING_MAX, POSE + len(ring.mounts)))
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing, whose odometry defines the map frame."""
        self._tracker.reset()
        self._evidence.reset()
        self._map_heading.reset()
        self._arrived = 0
        self._has_started = False
        self._way_m = 0.0
        self._motion = np.zeros(3)
        self._checked = 0
        self._stands_firm = False

    @property
    def e(self) -> EstimateRecord:
        """The mean, in the filter's frame."""
        return self._tracker.e

    @property
    def covariance(self) -> Floats:
        """Covariance of the errors that `perception.localization.drift.landmark_state` defines."""
        return self._tracker.covariance

    @property
    def is_applied(self) -> bool:
        """Whether the readings have shown that odometry drifts; until then nothing is corrected."""
        return self._evidence.is_refuted

    @property
    def heading_walk(self) -> float:
        """The estimated random walk of the heading by odometry, rad per √m."""
        return self._tracker.heading_walk

    def observe(self, firing: Firing) -> None:
        """Enter a firing, or let it wait for the first landmarks."""
        if self._arrived - self._tracker.entered == WAITING_MAX:
            self._enter_next()
        row = self._waiting[self._arrived % WAITING_MAX]
        row[:POSE] = firing.pose.x, firing.pose.y, firing.pose.theta, firing.ring_yaw
        row[POSE:] = np.nan_to_num(firing.ranges_m, nan=NOT_FIRED, posinf=FAR, neginf=NOT_FIRED)
        if self._arrived > 0:
            before = self._waiting[(self._arrived - 1) % WAITING_MAX]
            way = math.hypot(row[0] - before[0], row[1] - before[1])
            self._way_m += way
            most = way * MOTION_PER_M
            self._motion += np.maximum(np.minimum(self._map_heading.motion - self._motion, most), -most)
        self._arrived += 1
        self._has_started = self._has_started or self._way_m > LONGEST_WAY_M
        self._map_heading.keep(row)
        if self._has_started:
            for _ in range(min(ENTERED_AT_ONCE, self._arrived - self._tracker.entered)):
                self._enter_next()
            self._map_heading.renew(self._tracker, self._way_m)
            if self._arrived == self._tracker.entered:
                self._check_for_slip()

    def learn(self, seen: Iterable[SeenObject]) -> None:
        """Make landmarks of recognised objects that are none yet; drop those that are no longer recognised.

        Parameters
        ----------
        seen : iterable of SeenObject
            Near the robot. A landmark beyond the sensors' range stays: perception has archived its object.
        """
        objects = {one.number: one for one in seen}
        if self._has_started and self._arrived > self._tracker.entered:
            return  # what perception sees now is later than the filter
        if not self._has_started and len(objects) < (1 if self._way_m > FIRST_WAY_M else FIRST_LANDMARKS):
            return
        if self._tracker.entered == 0:
            self._enter_next()
        numbers, failures, xs, ys = self._tracker.landmarks("number", "failures", "x", "y")
        here_x, here_y, range_max = self.e[0].x, self.e[0].y, self._tracker.range_max_m
        is_near = [math.hypot(x - here_x, y - here_y) < range_max for x, y in zip(xs, ys, strict=True)]
        may_move = not self._tracker.is_doubtful or self._stands_firm  # otherwise rather the robot slipped
        moved = _failed(numbers, failures) if may_move else set()
        for i in range(len(numbers) - 1, -1, -1):
            if numbers[i] in moved or (is_near[i] and numbers[i] not in objects):
                for tracker in self._trackers():
                    remove_landmark(tracker.e, tracker.covariance, i)
        for number in sorted(objects.keys() - (set(numbers) - moved)):
            sigma = MOVED_SIGMA_M if number in moved else NEW_SIGMA_M if self._has_started else FIRST_LANDMARK_SIGMA_M
            self._add(objects[number], sigma, moved=int(number in moved))
        if not self._has_started:
            self._turn_landmarks(self.heading_walk**2 * self._way_m)
        self._has_started = True

    def corrected(self, firing: Firing) -> Firing:
        """Return the firing that was observed last, at its pose in the filter's frame, with ranges in true metres."""
        pose, ring_yaw = self._pose_of(firing.pose, firing.ring_yaw)
        return replace(firing.over_scale(self.e[0].range_scale), pose=pose, ring_yaw=ring_yaw)

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame, at the last firing."""
        return self.odometry_from_filter().compose(self.map_from_filter().inverse())

    def map_from_filter(self) -> Pose:
        """Return the pose of the filter's frame in the map frame: a turn about the first firing, and a shift."""
        if not self.is_applied:
            return IDENTITY
        turn, x, y = self._motion.tolist()
        start = Pose(self._map_heading.start_x, self._map_heading.start_y, 0.0)
        return Pose(start.x + x, start.y + y, turn).compose(start.inverse())

    def odometry_from_filter(self) -> Pose:
        """Return the pose of the filter's frame in odometry's frame, at the last firing."""
        if self._arrived == 0 or not self.is_applied:
            return IDENTITY
        x, y, theta, yaw = self._waiting[(self._arrived - 1) % WAITING_MAX, :POSE].tolist()
        here, here_yaw = self._pose_of(Pose(x, y, theta), yaw)
        return Pose(x, y, yaw).compose(Pose(here.x, here.y, here_yaw).inverse())

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing, in the map frame."""
        e = self.e[0]
        if self._arrived == 0:
            return LocalizedPose(IDENTITY, 0.0, np.zeros((3, 3)), "localizing", 1.0)
        x, y, theta, yaw = self._waiting[(self._arrived - 1) % WAITING_MAX, :POSE].tolist()
        pose, ring_yaw = self._pose_of(Pose(x, y, theta), yaw) if self.is_applied else (Pose(x, y, theta), yaw)
        to = np.zeros((3, FIRST))
        to[0, X] = to[1, Y] = to[2, HEADING] = to[2, OFFSET] = 1.0
        to[0, HEADING], to[1, HEADING] = -e.y, e.x
        to_map = self.map_from_filter()
        c, s = math.cos(to_map.theta), math.sin(to_map.theta)
        to = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ to
        covariance = to @ self.covariance[:FIRST, :FIRST] @ to.T
        share = float(e.fit_share)
        is_caught_up = e.count > 0 and self._arrived == self._tracker.entered
        status: Status = "lost" if share < LOST_SHARE else "tracking" if is_caught_up else "localizing"
        return LocalizedPose(to_map.compose(pose), ring_yaw + to_map.theta, covariance, status, share)

    def places(self) -> dict[int, LandmarkPlace]:
        """Return where the landmarks are in the filter's frame, by the objects' numbers."""
        found = {}
        for i, (number, x, y) in enumerate(zip(*self._tracker.landmarks("number", "x", "y"), strict=True)):
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
        columns = self._tracker.landmarks("number", "x", "y", "anchor_x", "anchor_y")
        for i, (number, x, y, anchor_x, anchor_y) in enumerate(zip(*columns, strict=True)):
            dx, dy = x - anchor_x, y - anchor_y
            if number in among and math.hypot(dx, dy) >= least_m:
                landmark = self.e[0].landmarks[i]
                landmark.anchor_x, landmark.anchor_y = x, y
                moved.append((number, dx, dy))
        return moved

    def _check_for_slip(self) -> None:
        """Once a cycle, while the pose is doubtful: look whether the robot slipped, and put it where it is now."""
        if not self._tracker.is_doubtful:
            self._stands_firm = False
            return
        if self._arrived - self._checked < CYCLE_FIRINGS:
            return
        self._checked = self._arrived
        newest = np.arange(self._arrived - 1, max(-1, self._arrived - 1 - CYCLE_FIRINGS_MAX), -1) % WAITING_MAX
        echoes = echoes_of_cycle(
            self._waiting[newest],
            self._mounts,
            self._turning,
            self._range_min_m,
            self._tracker.range_max_m,
            self.e[0].range_scale,
        )
        found = find_slip(self._tracker, echoes, self._half_angle, self._tracker.range_max_m)
        self._stands_firm = found is not None and found.pose == IDENTITY
        if found is not None and not self._stands_firm:
            self._tracker.displace(found.pose, found.covariance_matrix())

    def _enter_next(self) -> None:
        """Enter the oldest waiting firing."""
        row = self._waiting[self._tracker.entered % WAITING_MAX]
        self._evidence.enter(row, self._tracker)

    def _pose_of(self, pose: Pose, ring_yaw: float) -> tuple[Pose, float]:
        """Return pose and ring direction in the filter's frame for those by odometry, at a firing that may wait."""
        if self._tracker.entered == 0:
            return pose, ring_yaw
        x, y, _, yaw = self._tracker.entered_at.tolist()
        mean_x, mean_y, heading, offset = (
            float(self._tracker.estimate[name][0]) for name in ("x", "y", "heading", "offset")
        )
        off = heading - yaw
        c, s = math.cos(off), math.sin(off)
        dx, dy = pose.x - x, pose.y - y
        here = Pose(mean_x + c * dx - s * dy, mean_y + s * dx + c * dy, pose.theta + off + offset)
        return here, ring_yaw + off

    def _turn_landmarks(self, variance: float) -> None:
        """Add to all landmarks the error of a common turn about the robot's present place, of this variance (rad²).

        Perception sees the first ones from a way whose heading drifts.
        """
        x, y = self._waiting[(self._arrived - 1) % WAITING_MAX, :2].tolist()
        xs, ys = (np.array(values) for values in self._tracker.landmarks("x", "y"))
        lever = np.column_stack([y - ys, xs - x]).reshape(-1)
        end = FIRST + len(lever)
        self.covariance[FIRST:end, FIRST:end] += variance * np.outer(lever, lever)

    def _add(self, seen: SeenObject, sigma_m: float, moved: int) -> None:
        """Add a landmark that stands where perception sees it, relative to the ring, with this standard deviation."""
        trackers = self._trackers()
        ring = self.e[0]
        c, s = math.cos(ring.heading), math.sin(ring.heading)
        dx, dy = seen.x - ring.x, seen.y - ring.y
        for tracker in trackers:
            e, covariance, variance = tracker.e, tracker.covariance, sigma_m**2
            i = add_landmark(e, covariance, c * dx + s * dy, c * dy - s * dx, variance, 0.0, variance)
            if i < 0:
                return
            landmark = e[0].landmarks[i]
            landmark.radius, landmark.number, landmark.moved = seen.radius, seen.number, moved
            landmark.anchor_x, landmark.anchor_y = seen.x, seen.y

    def _trackers(self) -> tuple[LandmarkTracker, ...]:
        """Return the filter with drift and, until odometry is refuted, the one that takes odometry as exact."""
        return (self._tracker,) if self.is_applied else (self._tracker, self._evidence.exact)
