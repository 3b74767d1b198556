"""By how much the ranges lag behind odometry, as echoes themselves show it.

Odometry and ranges of many robots have clocks or filters of their own, so that a firing's pose is that of a moment
before or after. Within a few metres of way with turns, echoes agree on one map only if each is entered at the pose
from which it was heard: the likelihood of the readings in their own map is compared for several lags, and summed over
all such windows of the way. It is estimated in quanta, until it is known well; then this costs nothing any more.

The ring's lag is right until refuted: another one is used once it is likelier by `LAG_REFUTED`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.bounds import CONSTANT, FINITE, PLACE, bounds, up_to
from perception.kernel import Floats
from perception.localization.submaps.local_grid import CHUNK, SHARING_ROUNDS, SUBMAP_CELLS, answers_of, make_grid
from perception.localization.submaps.map_match import BEAM_CELLS, MATCH_TEMPER, fit_of
from perception.localization.submaps.submap_records import (
    SUBMAP_M,
    SUBMAP_RAD,
    SUBMAP_READINGS_MAX,
    between,
    compose,
    fresh_sensors,
)
from perception.sensor_mounts import mounts_array, mounts_at

LAG_STEP_S: Final = 0.06
"""Time between two lags that are compared."""
LAGS: Final = LAG_STEP_S * np.arange(-6, 7)
"""Lags that are compared, beside the ring's. Between them the likelihood of real drives is a parabola."""
LAG_SIGMA_S: Final = 0.015
"""The lag is known well enough with this standard deviation: at 1 m/s it moves an echo by 1.5 cm."""
LAG_REFUTED: Final = 4.5
"""Log likelihood by which another lag than the ring's must be likelier: three standard deviations. Real drives
without a lag gain up to 0.5."""
LAG_READINGS_MIN: Final = 20
"""Readings of a window that say anything of the lag."""
TRAIL_MAX: Final = 1024
"""Poses of a window, the last ones before it among them."""
RECENT_POSES_MAX: Final = 256
"""Last poses that are kept: the newer half spans all lags that are compared at up to 180 firings a second."""
QUANTA_MAX: Final = len(LAGS) * (SUBMAP_READINGS_MAX // CHUNK + SHARING_ROUNDS + 2)
"""Quanta of one comparison."""
RATE_S: Final = 0.1
"""Poses after the newest one follow from the motion of so much time before it."""
_SENSORS_FRAME: Final = np.zeros(3)
_NOTHING_FOUND: Final = np.zeros(len(LAGS))


class FoundLag(NamedTuple):
    """By how much ranges lag behind odometry."""

    lag_s: float
    sigma_s: float
    gain: float
    """Log likelihood of this lag less that of the ring's."""

    @property
    def is_refuted(self) -> bool:
        """Whether the ring's own lag is too unlikely to be used."""
        return self.gain > LAG_REFUTED

    def __str__(self) -> str:
        which = "the ranges lag behind odometry" if self.lag_s > 0.0 else "odometry lags behind the ranges"
        return f"{which} by {abs(self.lag_s):.2f} s (± {self.sigma_s:.2f})"


class EchoLag:
    """Enters firings at the poses from which they were heard.

    Parameters
    ----------
    ring : RingConfig
        The sensors, and the lag with which to begin.

    Attributes
    ----------
    lag_s, given_s : float
        By how much ranges lag behind odometry: as used now, and as the ring's settings say.
    """

    SCRATCH: Final = ("_job",)
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        given_s=CONSTANT,
        lag_s=PLACE,
        _readings=PLACE._replace(infinite=True),
        _latest=PLACE._replace(infinite=True),
        _trail=PLACE,
        _recent=PLACE,
        _count=up_to(SUBMAP_READINGS_MAX),
        _trail_count=up_to(TRAIL_MAX),
        _recent_count=up_to(RECENT_POSES_MAX),
        _quanta=up_to(QUANTA_MAX),
        _log_likelihoods=FINITE,
        _moved=PLACE,
    )

    def __init__(self, ring: RingConfig) -> None:
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._half_angle, self.given_s = math.radians(ring.beam_half_angle_deg), ring.echo_lag_s
        self._log_likelihoods = np.zeros(len(LAGS))
        """Of all windows so far, by lag."""
        self.lag_s, self.is_known = ring.echo_lag_s, False
        self._job: Iterator[Floats | None] | None = None
        self._readings = np.zeros((SUBMAP_READINGS_MAX, 5))
        """Of the window: time (s), the sensor's place (m) and direction (rad) on the ring, range."""
        self._trail, self._recent = np.zeros((TRAIL_MAX, 5)), np.zeros((RECENT_POSES_MAX, 5))
        """Poses by odometry of the window, and of the last moments: time, x, y, directions of ring and travel, not
        wrapped."""
        self.reset()

    def reset(self) -> None:
        """Start a new window; what is known of the lag stays."""
        self._readings[:] = self._trail[:] = self._recent[:] = 0.0
        self._latest = np.full((len(self._mounts), 3), math.inf)
        """The ring's pose at each sensor's last reading of the window."""
        self._count = self._trail_count = self._recent_count = self._quanta = 0
        self._moved = np.zeros(2)
        """Way (m) and turns (rad) of the window."""
        self._job = None

    def follow(self, firing: Firing) -> Firing:
        """Take a firing down, and return it at the pose from which it was heard."""
        if self.is_known and self.lag_s == 0.0:
            return firing
        here = self._take_pose(firing)
        if not (self.is_known or self.can_refine):
            self._take_down(firing, here)
        if self.lag_s == 0.0:
            return firing
        x, y, yaw, theta = self._recent_pose(firing.robot_s - self.lag_s).tolist()
        return replace(firing, pose=Pose(x, y, theta), ring_yaw=yaw)

    def _take_pose(self, firing: Firing) -> Floats:
        """Remember a pose, and return it as a row of the trail."""
        count, recent = self._recent_count, self._recent
        here = np.array([firing.robot_s, firing.pose.x, firing.pose.y, firing.ring_yaw, firing.pose.theta])
        if count > 0:
            last = recent[count - 1]
            here[3:] = last[3] + wrap_angle(here[3] - last[3]), last[4] + wrap_angle(here[4] - last[4])
        if count == RECENT_POSES_MAX:
            count //= 2
            recent[:count] = recent[count:]
        recent[count] = here
        self._recent_count = count + 1
        return here

    def _recent_pose(self, at_s: float) -> Floats:
        """Return the pose at a time near the last firing: x, y, directions of ring and travel."""
        recent = self._recent[: self._recent_count]
        after_s = at_s - recent[-1, 0]
        if after_s <= 0.0:
            (pose,) = _poses_at(recent, np.array([at_s]))
            return np.asarray(pose)
        before = _poses_at(recent, recent[-1:, 0] - RATE_S)[0]
        moved = between(before[[0, 1, 2]], recent[-1, 1:4]) * (after_s / RATE_S)
        turn = (recent[-1, 4] - before[3]) * (after_s / RATE_S)
        return np.append(compose(recent[-1, 1:4], moved), recent[-1, 4] + turn)

    def _take_down(self, firing: Firing, here: Floats) -> None:
        """Note a firing's pose `here` (s; x, y, m; rad) and its new ranges, until the window ends."""
        if self._trail_count > 0:
            step = here - self._trail[self._trail_count - 1]
            self._moved += math.hypot(step[1], step[2]), abs(step[3])
        count = self._trail_count
        if count == TRAIL_MAX:
            return
        stands = count > 1 and bool((self._trail[count - 2 : count, 1:] == here[1:]).all())
        self._trail[count - stands] = here
        self._trail_count = count + 1 - stands
        if self._has_ended():
            return
        fresh = fresh_sensors(firing.ranges_m, here[1:4], self._latest)
        if fresh.any():
            rows = self._readings[self._count : self._count + int(fresh.sum())]
            rows[:, 0], rows[:, 1:4] = here[0], mounts_at(firing, self._mounts, self._turning)[fresh]
            rows[:, 4] = firing.ranges_m[fresh]
            self._count += len(rows)
            self._latest[fresh] = here[1:4]
        if self._has_ended() and self._count == 0:
            self._begin_window()

    def _has_ended(self) -> bool:
        """Whether the window takes no more readings."""
        way, turns = self._moved.tolist()
        is_full = self._count > SUBMAP_READINGS_MAX - len(self._mounts) or self._trail_count == TRAIL_MAX
        return is_full or way >= SUBMAP_M or turns >= SUBMAP_RAD

    @property
    def can_refine(self) -> bool:
        """Whether a window waits to be compared, with the poses after it that any lag may need."""
        if self.is_known or self._count == 0:
            return False
        is_full = self._trail_count == TRAIL_MAX
        after_s = float(self._trail[self._trail_count - 1, 0] - self._readings[self._count - 1, 0])
        return is_full or (self._has_ended() and after_s >= LAGS[-1] - self.given_s)

    def refine(self) -> int:
        """Do one quantum, and return 1."""
        if self._job is None:
            self._job = self._compare()
            for _ in itertools.islice(self._job, self._quanta):  # of a snapshot
                pass
        self._quanta += 1
        found = next(self._job, _NOTHING_FOUND)
        if found is not None:
            self._log_likelihoods += found
            lag = self.found()
            self.is_known = lag.sigma_s <= LAG_SIGMA_S
            self.lag_s = lag.lag_s if lag.is_refuted else self.given_s
            self._begin_window()
        return 1

    def drop_caches(self) -> None:
        """Forget what follows from the rest, after a snapshot was put back."""
        self._job = None

    def _begin_window(self) -> None:
        count = self._recent_count
        self._count, self._trail_count, self._quanta, self._job = 0, count, 0, None
        self._trail[:count] = self._recent[:count]
        self._latest[:], self._moved[:] = math.inf, 0.0

    def _compare(self) -> Iterator[Floats | None]:
        """Compute the log likelihood of the window by lag; yield None after each quantum, and it last."""
        rows, log_likelihoods, fit = self._readings[: self._count], np.zeros(len(LAGS)), np.empty(2)
        answers, goes_on = np.empty((2, SUBMAP_CELLS, SUBMAP_CELLS)), np.empty(BEAM_CELLS)
        beam = np.array([self._half_angle, 0.0])
        for k, lag in enumerate(LAGS if len(rows) >= LAG_READINGS_MIN else ()):
            readings = _heard_at(self._trail[: self._trail_count], rows, self.given_s + float(lag))
            grid = np.empty(0)
            for made in make_grid(readings, self._half_angle):
                grid = made
                yield None
            answers_of(grid[0], grid[1], answers[0], answers[1])
            yield None
            fit_of(readings, len(readings), 1, _SENSORS_FRAME, beam, answers, goes_on, fit)
            log_likelihoods[k] = MATCH_TEMPER * fit[0]
            yield None
        yield log_likelihoods

    def found(self) -> FoundLag:
        """Return the likeliest lag; its uncertainty is infinite where nothing shows it."""
        known = self._log_likelihoods
        best = int(np.argmax(known))
        gain = float(known[best] - known[len(LAGS) // 2])
        if not 0 < best < len(LAGS) - 1:
            return FoundLag(self.given_s, math.inf, 0.0)
        slope, curvature = (
            0.5 * (known[best + 1] - known[best - 1]),
            known[best + 1] + known[best - 1] - 2.0 * known[best],
        )
        if not curvature < 0.0:
            return FoundLag(self.given_s, math.inf, 0.0)
        lag = self.given_s + LAGS[best] - LAG_STEP_S * slope / curvature
        return FoundLag(float(lag), LAG_STEP_S / math.sqrt(-curvature), gain)


def lag_of(firings: Iterable[Firing], ring: RingConfig) -> FoundLag:
    """Return by how much the ranges of a drive lag behind its odometry."""
    lag = EchoLag(ring)
    for firing in firings:
        lag.follow(firing)
        while lag.can_refine:
            lag.refine()
    return lag.found()


def _poses_at(trail: Floats, times: Floats) -> Floats:
    """Return the poses of a trail at some times, shape (n, 4)."""
    return np.column_stack([np.interp(times, trail[:, 0], trail[:, k]) for k in range(1, 5)])


def _heard_at(trail: Floats, rows: Floats, lag_s: float) -> Floats:
    """Return the readings of a window with their sensors' places by a lag, in the frame of the ring's pose midway."""
    poses = _poses_at(trail, rows[:, 0] - lag_s)[:, :3]
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    poses[:, 0] += c * rows[:, 1] - s * rows[:, 2]
    poses[:, 1] += s * rows[:, 1] + c * rows[:, 2]
    placed = between(_poses_at(trail, rows[len(rows) // 2 : len(rows) // 2 + 1, 0])[0, :3], poses)
    placed[:, 2] += rows[:, 3]
    return np.ascontiguousarray(np.column_stack([placed, rows[:, 4]]))
