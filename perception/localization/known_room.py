"""The robot in a known room: global localisation from an unknown start, tracking, and kidnapping noticed.

Readings are compounded by odometry into keyframes, so that those of one sensor are independent. Without a pose, a
search of the whole room gives hypotheses, which the exact likelihood of all raw readings then weighs keyframe by
keyframe. The robot tracks once one place has nearly all probability and explains the readings as a true one would.
It is lost when its place no longer does.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drift_correction import LocalizedPose, Status
from perception.localization.expected_ranges import surfaces_near
from perception.localization.panorama import Panorama, all_readings, panoramas
from perception.localization.pose_grid import CELL_M, DIRECTIONS, PoseGrid
from perception.localization.pose_particles import PoseParticles
from perception.localization.range_likelihood import RangeModel, log_ratio_of_true_pose
from perception.localization.room import Room

KEYFRAME_M: Final = 0.1
KEYFRAME_RAD: Final = math.radians(6.0)
"""A keyframe ends after this way or this turn: two readings of one sensor are then independent."""
NOISE_M: Final = 0.02
DROPOUT: Final = 0.15
OUTLIERS: Final = 0.1
"""Errors of a range compared with the map, whose own errors they contain."""
STANDING_MAX: Final = 200
"""Firings that are kept of a robot that stands."""
WINDOW_M: Final = 6.0
"""Way over which odometry compounds keyframes for a search."""
SEARCH_M: Final = (1.0, 3.0)
SEARCH_GROWTH: Final = 1.5
"""Way until the first search, the longest one between two searches, and by how much it grows from one to the next."""
SEARCH_READINGS_MAX: Final = 72
"""Readings that are compared in the table of the room."""
TILE_M: Final = 3.0
"""Hypotheses in one tile of this side are compared with the same surfaces."""
HYPOTHESES_MAX: Final = 40
LEAST_LOG: Final = 12.0
"""Hypotheses less likely than the best by more than this are dropped, nat."""
RECENT_M: Final = 1.0
LATEST_M: Final = 0.2
RECENT_READINGS: Final = 30
RECENT_MIN: Final = 3
"""Ways over which it is judged whether a place explains the readings: before the robot is lost, and before the
probability falls; with at least so many readings and keyframes."""
MISSED_SHARE: Final = 0.35
"""A pose explains the readings if their log likelihood ratio is above this share of a true pose's."""
EXCESS_MAX: Final = 50.0
"""Greatest log odds that a place explains the readings, nat."""
SURE: Final = 0.9
"""Probability above which a place is the robot's."""
DOUBT: Final = 0.5
"""Probability below which a tracked place is no longer its own."""
SHARE_MEMORY: Final = 300.0
"""Readings over which the share of specular echoes is learned."""
SHARE_MIN: Final = 0.03


class _Keyframe(NamedTuple):
    odometry: Pose
    """Of the ring."""
    way_m: float
    """Since the one before."""
    readings: Panorama
    """In its frame."""


class _Recent(NamedTuple):
    way_m: float
    log_ratio: float
    of_true_pose: float
    readings: int


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
    status : str
        `localizing`, `tracking` or `lost`.
    probability : float
        That the reported place is the robot's.
    specular_share : float
        Share of the readings that mirrors explain, as learned so far.
    """

    def __init__(self, room: Room, ring: RingConfig, model: RangeModel | None = None, seed: int = 0) -> None:
        self._room, self._ring = room, ring
        self._model = model or RangeModel(
            ring.resolution_m, ring.window_m, noise_m=NOISE_M, dropout=DROPOUT, outliers=OUTLIERS
        )
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._rng = np.random.default_rng(seed)
        self._radius_m = max(math.hypot(x, y) for x, y, _ in ring.mounts)
        self._grid = PoseGrid(room, self._half_angle, ring.window_m, max(CELL_M, self._radius_m - CELL_M))
        self.status: Status = "localizing"
        self.probability = 0.0
        self.specular_share = 0.5
        self._firings: list[Firing] = []
        """Since the last keyframe."""
        self._window: deque[_Keyframe] = deque()
        self._recent: deque[_Recent] = deque()
        self._particles: PoseParticles | None = None
        self._searching: Iterator[None] | None = None
        self._way_m = self._searched_at_m = 0.0
        self._pause_m = SEARCH_M[0]
        self._odometry = Pose(0.0, 0.0, 0.0)
        self._travel = 0.0
        """Of the last firing: pose of the ring, and direction of travel."""
        self._began_at: Pose | None = None
        """Where the keyframe began."""

    def observe(self, firing: Firing) -> None:
        """Take a firing with its pose by odometry."""
        here = Pose(firing.pose.x, firing.pose.y, firing.ring_yaw)
        self._odometry, self._travel = here, firing.pose.theta
        self._firings.append(firing)
        if self._began_at is None:
            self._began_at = here
        way = math.hypot(here.x - self._began_at.x, here.y - self._began_at.y)
        if way >= KEYFRAME_M or abs(wrap_angle(here.theta - self._began_at.theta)) >= KEYFRAME_RAD:
            self._began_at = here
            self._add_keyframe(way)
        elif len(self._firings) > STANDING_MAX:
            del self._firings[: STANDING_MAX // 2]

    @property
    def can_refine(self) -> bool:
        """Whether a search has work left."""
        return self._searching is not None

    def refine(self) -> None:
        """Do one quantum of a search."""
        if self._searching is not None and next(self._searching, self) is self:
            self._searching = None

    def localized(self) -> LocalizedPose:
        """Return where the robot was at the last firing, as far as known."""
        at = self._odometry
        pose, covariance = Pose(at.x, at.y, at.theta), np.diag([np.inf, np.inf, np.inf])
        if self._particles is not None:
            best = int(self._particles.log_evidence().argmax())
            mean, covariance = self._particles.estimate(best)
            pose = mean.compose(self._window[-1].odometry.inverse().compose(at))
        travel = Pose(pose.x, pose.y, wrap_angle(pose.theta + self._travel - at.theta))
        return LocalizedPose(travel, wrap_angle(pose.theta), covariance, self.status, self.probability)

    def map_from_odometry(self) -> Pose:
        """Return the pose of odometry's frame in the map frame."""
        here = self.localized()
        return Pose(here.pose.x, here.pose.y, here.ring_yaw).compose(self._odometry.inverse())

    def _add_keyframe(self, way: float) -> None:
        """End a keyframe at the last firing, after this way (m)."""
        readings = _latest_of_each(panoramas(self._firings, self._ring))
        self._firings = []
        before = self._window[-1].odometry if self._window else self._odometry
        self._window.append(_Keyframe(self._odometry, way, readings))
        self._way_m += way
        while self._searching is None and len(self._window) > 1 and self._window_way_m() > WINDOW_M:
            self._window.popleft()
        if self._particles is not None:
            self._enter(self._particles, before, self._window[-1])
            self._judge()
        is_due = self._way_m - self._searched_at_m >= self._pause_m
        if self._searching is None and self.status != "tracking" and is_due:
            self._searched_at_m = self._way_m
            self._pause_m = min(SEARCH_M[1], SEARCH_GROWTH * self._pause_m)
            self._searching = self._search()

    def _window_way_m(self) -> float:
        return sum(frame.way_m for frame in self._window)

    def _enter(self, particles: PoseParticles, before: Pose, frame: _Keyframe) -> None:
        """Move particles by odometry to a keyframe and enter its readings."""
        step = before.inverse().compose(frame.odometry)
        particles.move(step.x, step.y, wrap_angle(step.theta), self._rng)
        if not len(frame.readings.range_m):
            return
        log_ratio, specular = np.zeros(len(particles)), np.zeros(len(particles))
        tiles, tile_of = np.unique(np.floor(particles.poses()[:, :2] / TILE_M), axis=0, return_inverse=True)
        for k, (x, y) in enumerate(((tiles + 0.5) * TILE_M).tolist()):
            which = np.flatnonzero(tile_of.reshape(-1) == k)
            room = surfaces_near(self._room, x, y, TILE_M + self._radius_m, self._ring.window_m)
            fit = particles.update(which, room, frame.readings, self._half_angle, self._model, self.specular_share)
            log_ratio[which], specular[which] = fit.log_ratio, fit.specular
        best, readings = int(particles.log_evidence().argmax()), len(frame.readings.range_m)
        of_true_pose, _ = log_ratio_of_true_pose(self._model, frame.readings.range_m)
        self._recent.append(_Recent(frame.way_m, float(log_ratio[best]), of_true_pose, readings))
        more_specular = readings * (float(specular[best]) - self.specular_share)
        particles.prune(LEAST_LOG, HYPOTHESES_MAX)
        particles.resample()
        while sum(one.way_m for one in self._recent) > RECENT_M and len(self._recent) > RECENT_MIN:
            self._recent.popleft()
        if self._explains(RECENT_M) > SURE:
            share = self.specular_share + more_specular / SHARE_MEMORY
            self.specular_share = min(1.0 - SHARE_MIN, max(SHARE_MIN, share))

    def _explains(self, way_m: float) -> float:
        """Return the probability that the best place explains the readings of the last way as a true one would."""
        excess, way, readings = 0.0, 0.0, 0
        for one in reversed(self._recent):
            excess += one.log_ratio - MISSED_SHARE * one.of_true_pose
            way += one.way_m
            readings += one.readings
            if way >= way_m and readings >= RECENT_READINGS:
                break
        return 1.0 / (1.0 + math.exp(-max(-EXCESS_MAX, min(EXCESS_MAX, excess)))) if readings else 0.0

    def _judge(self) -> None:
        """Set status and probability after a keyframe."""
        if self._particles is None or sum(one.readings for one in self._recent) < RECENT_READINGS:
            return
        log_evidence = self._particles.log_evidence()
        share = math.exp(float(log_evidence.max() - np.logaddexp.reduce(log_evidence)))
        explains = self._explains(RECENT_M)
        self.probability = share * min(explains, self._explains(LATEST_M))
        if self.status == "tracking":
            if explains < DOUBT:
                self._lose()
        elif self._searching is None:
            self.status = "tracking" if self.probability > SURE else "lost" if explains < DOUBT else "localizing"

    def _lose(self) -> None:
        """Begin anew: what was heard before may be from another place."""
        self.status = "lost"
        self._window = deque([self._window[-1]])
        self._pause_m, self._searched_at_m = SEARCH_M[0], self._way_m

    def _search(self) -> Iterator[None]:
        """Search the room for the window's keyframes, quantum by quantum, and replace the hypotheses."""
        first = self._window[0].odometry
        parts = [_turned(first.inverse().compose(frame.odometry), frame.readings) for frame in self._window]
        readings = all_readings(parts)
        chosen = np.linspace(0, len(readings.range_m) - 1, min(SEARCH_READINGS_MAX, len(readings.range_m)))
        picked = np.unique(chosen.astype(int))
        decimated = Panorama(*(getattr(readings, name)[picked] for name in ("x", "y", "axis", "range_m")))
        starts = yield from self._grid.search(decimated, self._model, self.specular_share)
        if not len(starts):
            return
        particles = PoseParticles(starts, CELL_M, math.pi / DIRECTIONS)
        self._recent.clear()
        before, done = first, 0
        while done < len(self._window):  # it grows while this goes on
            self._enter(particles, before, self._window[done])
            before, done = self._window[done].odometry, done + 1
            yield
        self._particles, self._searching = particles, None
        self._judge()


def _latest_of_each(parts: tuple[Panorama, ...]) -> Panorama:
    """Return the last reading of each sensor, without the sensors that did not fire."""
    last = parts[-1]
    columns = [last.x.copy(), last.y.copy(), last.axis.copy(), last.range_m.copy()]
    for part in reversed(parts[:-1]):
        missing = np.isnan(columns[3])
        for column, values in zip(columns, (part.x, part.y, part.axis, part.range_m), strict=True):
            column[missing] = values[missing]
    return all_readings([Panorama(*columns)])


def _turned(at: Pose, readings: Panorama) -> Panorama:
    """Return readings of a frame that lies at a pose, in the frame of that pose."""
    c, s = math.cos(at.theta), math.sin(at.theta)
    return Panorama(
        at.x + c * readings.x - s * readings.y, at.y + s * readings.x + c * readings.y, at.theta + readings.axis,
        readings.range_m,
    )  # fmt: skip
