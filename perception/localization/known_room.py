"""The robot in a known room: global localisation from an unknown start, tracking, and kidnapping noticed.

Readings are compounded by odometry into keyframes, so that those of one sensor are independent. Without a pose, a
search of the whole room gives hypotheses, which the exact likelihood of all raw readings then weighs keyframe by
keyframe. The robot tracks once one place has nearly all probability and explains the readings as a true one would.
It is lost when its place no longer does. A firing is only taken down; all else is done in quanta.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drift_correction import LocalizedPose, Status
from perception.localization.keyframes import Keyframes
from perception.localization.pose_grid import CELL_M, READINGS_MAX, STEP_RAD, PoseGrid
from perception.localization.pose_particles import HYPOTHESES_MAX
from perception.localization.pose_track import RECENT_M, RECENT_READINGS, PoseTrack, heading_noise
from perception.localization.range_likelihood import RangeModel
from perception.localization.room import Room
from perception.localization.surroundings import make_surroundings
from perception.sensor_mounts import mounts_array

NOISE_M: Final = 0.02
DROPOUT: Final = 0.15
OUTLIERS: Final = 0.1
"""Errors of a range compared with the map, whose own errors they contain."""
WINDOW_M: Final = 6.0
"""Way over which odometry compounds keyframes for a search."""
WINDOW_MAX: Final = 96
"""Most keyframes of it."""
SEARCH_M: Final = (1.0, 3.0)
SEARCH_GROWTH: Final = 1.5
"""Way until the first search, the longest one between two searches, and by how much it grows from one to the next."""
STAND_SEARCH_M: Final = 0.3
"""A robot that stands searches if it has driven so far since the last search."""
LOST_M: Final = 1.0
LATEST_M: Final = 0.2
"""Ways over which a place must explain the readings: otherwise it is lost, or its probability falls."""
MISSED_SHARE: Final = 0.35
REPORT_SHARE: Final = 0.7
REPORT_SHARE_STANDING: Final = 0.85
REPORT_M: Final = 0.5
"""Shares of a true pose's log likelihood ratio: a place below the first is lost, one above the second is sure. The
third is for a place known from less way than this: few readings fit somewhere in a wrong map by chance."""
ASSUMED_M: Final = 0.3
ASSUMED_RAD: Final = math.radians(12.0)
"""Standard deviation of a place that the operator names, on each axis, and half the width of its row of headings."""
SURE: Final = 0.9
"""Probability above which a place is the robot's."""
DOUBT: Final = 0.5
"""Probability below which a tracked place is no longer its own."""
SHARE_MEMORY: Final = 300.0
"""Readings over which the share of specular echoes is learned."""
SHARE_MIN: Final = 0.03
STATUSES: Final[tuple[Status, ...]] = ("localizing", "tracking", "lost")
LOCALIZING, TRACKING, LOST = range(3)
IDLE, DUE, COMPARING, WEIGHING = range(4)
"""Stages of a search: none, one is to begin, readings are compared with the grid, its hypotheses are weighed."""


class KnownRoom:
    """Localisation in one known room, firing by firing.

    Parameters
    ----------
    room : Room
        The surfaces, in the map frame.
    ring : RingConfig
        The sensors.
    model : RangeModel, optional
        Errors of a range compared with the map.
    seed : int
        Of the particles' random walk.

    Attributes
    ----------
    probability : float
        That the reported place is the robot's.
    specular_share : float
        Share of the readings that mirrors explain, as learned so far.
    """

    def __init__(self, room: Room, ring: RingConfig, model: RangeModel | None = None, seed: int = 0) -> None:
        model = model or RangeModel(
            ring.resolution_m, ring.window_m, noise_m=NOISE_M, dropout=DROPOUT, outliers=OUTLIERS
        )
        surroundings = make_surroundings(room, model, math.radians(ring.beam_half_angle_deg))
        radius_m = max(math.hypot(x, y) for x, y, _ in ring.mounts)
        noise = heading_noise(seed)
        self._grid = PoseGrid(room, surroundings, max(CELL_M, radius_m - CELL_M))
        self._tracked = PoseTrack(surroundings, model, noise)
        self._candidates = PoseTrack(surroundings, model, noise)
        """Hypotheses of a search, until they have entered all keyframes."""
        self._mounts = mounts_array(ring.mounts)
        self._odometry = np.zeros(3)
        """Of the ring at the last firing."""
        self.reset()

    def reset(self) -> None:
        """Start again with an unknown place, as after a reset of the odometry."""
        self._keyframes = Keyframes(self._mounts)
        self._tracked.clear()
        self._candidates.clear()
        self._grid.cancel()
        self._status = LOCALIZING
        self.probability = 0.0
        self.specular_share = 0.5
        self._window_begin = 0
        """Number of the first keyframe that a search uses."""
        self._stage = IDLE
        self._searched_at_m = -STAND_SEARCH_M
        self._pause_m = SEARCH_M[0]
        self._travel = 0.0
        """Direction of travel at the last firing."""

    @property
    def status(self) -> Status:
        """Whether the place is being looked for, known, or lost."""
        return STATUSES[self._status]

    def observe(self, firing: Firing) -> None:
        """Take a firing with its pose by odometry."""
        self._odometry[:] = firing.pose.x, firing.pose.y, firing.ring_yaw
        self._travel = float(firing.pose.theta)
        if not self._keyframes.observe(firing):
            return
        keyframes = self._keyframes
        if self._stage in {IDLE, DUE}:
            self._window_begin = max(self._window_begin, keyframes.count - WINDOW_MAX)
            while keyframes.way_since(self._window_begin) > WINDOW_M:
                self._window_begin += 1
        if self._stage != IDLE or self._status == TRACKING:
            return
        way_m = keyframes.driven_m - self._searched_at_m
        if way_m >= self._pause_m or (keyframes.is_stand and way_m >= STAND_SEARCH_M):
            self._searched_at_m = keyframes.driven_m
            self._pause_m = (
                min(SEARCH_M[1], SEARCH_GROWTH * self._pause_m) if way_m >= self._pause_m else self._pause_m
            )
            self._stage = DUE

    def assume(self, pose: Pose) -> None:
        """Take the operator's word that the robot is at a pose (position, direction of travel) in the map frame."""
        heading = pose.theta - self._travel + float(self._odometry[2])
        here = np.array([[pose.x, pose.y, heading]])
        self._grid.cancel()
        self._candidates.clear()
        self._stage = IDLE
        self._tracked.start(here, ASSUMED_M, ASSUMED_RAD, self._at_last_firing(), self._keyframes.count)
        self._tracked.conclude()
        self._keyframes.begin()
        self._status, self.probability = LOCALIZING, 0.0
        self._searched_at_m, self._pause_m = self._keyframes.driven_m, SEARCH_M[0]

    @property
    def can_refine(self) -> bool:
        """Whether keyframes are to be entered or a search has work left."""
        return self._stage != IDLE or self._tracked.is_behind(self._keyframes)

    def refine(self) -> None:
        """Do one quantum: of what the tracked hypotheses have not entered, then of a search."""
        if self._tracked.is_behind(self._keyframes):
            if self._enter(self._tracked):
                self._judge()
        elif self._stage == DUE:
            readings = self._keyframes.compounded(self._window_begin, READINGS_MAX)
            self._grid.begin(readings, self.specular_share)
            self._stage = COMPARING if len(readings) else IDLE
        elif self._stage == COMPARING:
            self._grid.refine()
            if not self._grid.is_searching:
                starts = self._grid.best_starts(HYPOTHESES_MAX)
                begin = self._window_begin
                self._candidates.start(starts, CELL_M, STEP_RAD, self._keyframes.pose(begin), begin)
                self._stage = WEIGHING if len(starts) else IDLE
        elif self._stage == WEIGHING:
            self._enter(self._candidates)
            if not self._candidates.is_behind(self._keyframes):
                self._tracked, self._candidates = self._candidates, self._tracked
                self._candidates.clear()
                self._stage = IDLE
                self._judge()

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing, as far as known."""
        at = self._at_last_firing()
        pose, covariance = at, np.diag([np.inf, np.inf, np.inf])
        if len(self._tracked):
            pose, covariance = self._tracked.pose(at), self._tracked.covariance()
        travel = Pose(pose.x, pose.y, wrap_angle(pose.theta + self._travel - at.theta))
        return LocalizedPose(travel, wrap_angle(pose.theta), covariance, self.status, self.probability)

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's frame; they are the same until a place is known."""
        at = self._at_last_firing()
        return at.compose(self._tracked.pose(at).inverse()) if len(self._tracked) else Pose(0.0, 0.0, 0.0)

    def drop_caches(self) -> None:
        """Discard cached results, after the memory was restored from a snapshot."""
        self._grid.drop_caches()

    def _at_last_firing(self) -> Pose:
        """Return the ring's pose by odometry at the last firing."""
        x, y, yaw = self._odometry.tolist()
        return Pose(x, y, yaw)

    def _enter(self, track: PoseTrack) -> bool:
        """Do a quantum of entering a keyframe; return whether it is done."""
        before = track.entered
        readings = track.enter(self._keyframes, self.specular_share)
        if readings and track.explains(LOST_M, MISSED_SHARE) > SURE:
            share = self.specular_share + readings * (track.best.specular - self.specular_share) / SHARE_MEMORY
            self.specular_share = min(1.0 - SHARE_MIN, max(SHARE_MIN, share))
        return track.entered > before

    def _judge(self) -> None:
        """Set status and probability after a keyframe."""
        track = self._tracked
        if track.readings < RECENT_READINGS:
            return
        explains = track.explains(LOST_M, MISSED_SHARE)
        report_share = REPORT_SHARE if track.way_m >= REPORT_M else REPORT_SHARE_STANDING
        reported = min(track.explains(RECENT_M, report_share), track.explains(LATEST_M, MISSED_SHARE))
        self.probability = float(track.best.share) * reported
        if self._status == TRACKING:
            if explains < DOUBT:
                self._lose()
        elif self._stage == IDLE:
            self._status = TRACKING if self.probability > SURE else LOST if explains < DOUBT else LOCALIZING

    def _lose(self) -> None:
        """Begin anew: what was heard before may be from another place."""
        self._status = LOST
        self._window_begin = self._keyframes.count - 1
        self._pause_m, self._searched_at_m = SEARCH_M[0], self._keyframes.driven_m
