"""The ring's electronics: the ranges that the sensors report, given the echoes of a scene.

Serves any ring and any protocol: ranges are in metres, quantised by the ring's resolution. A firing always draws the
same number of random numbers in the same order, so that the same seed gives the same run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from config.world import AcousticsConfig
from drivers.emulator.acoustics import (
    CONVEX_EDGE_REACH_M,
    ECHO,
    MOUNT,
    SIGHT_SLACK_M,
    Records,
    first_echoes,
    hidden,
)
from drivers.emulator.scene import Scene
from drivers.messages import Floats, Pose, wrap_angle

LISTENING_LOBE = 2.0
"""How far off its axis a sensor hears another sensor's pulse, in beam half-angles. At the beam's edge the losses of
emission and reception together reach the detection limit. For a foreign pulse only reception is off axis, which costs
half the decibels, so the limit lies farther out: about √2 times for an ordinary echo, about twice for a strong one.
Strong echoes are those that cause crosstalk."""


class Sonar:
    """A ring of ultrasonic sensors in a scene.

    Parameters
    ----------
    ring
        The sensors' places, beam and resolution.
    scene
        The surfaces that reflect.
    acoustics
        The model of reflection and the errors of a range.
    rng
        The only source of random numbers.
    """

    def __init__(self, ring: RingConfig, scene: Scene, acoustics: AcousticsConfig, rng: np.random.Generator) -> None:
        self._ring = ring
        self._scene = scene
        self._acoustics = acoustics
        self._rng = rng
        self._mount_poses = [Pose(*mount) for mount in ring.mounts]
        self._mounts: Records = np.array(list(ring.mounts), dtype=MOUNT)
        self._turning = ring.turning
        self._turning_poses = [self._mount_poses[i] for i in ring.turning]
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._is_clean = not (
            acoustics.noise_relative or acoustics.noise_m or acoustics.dropout or acoustics.outliers
        )
        self._echoes: Records = np.empty(len(self._mounts), dtype=ECHO)

    def fire(
        self,
        pose: Pose,
        ring_yaw: float,
        sensors: Iterable[int] | None = None,
        window_m: float | None = None,
        listeners: Iterable[int] = (),
    ) -> Floats:
        """Return the ranges that sensors report when they fire together.

        Parameters
        ----------
        pose
            The body's true pose, whose origin is the ring's centre.
        ring_yaw
            The true direction of the ring, rad.
        sensors
            Numbers of the sensors that fire; all if not given.
        window_m
            How far the sensors listen, m; the ring's own window if not given.
        listeners
            Numbers of the sensors that listen without firing. Their range is half the shortest path from a sensor
            that fires over a surface to them.

        Returns
        -------
        Floats
            Shape (sensors,), as in `drivers.messages.Firing.ranges_m`: m, +inf no echo, NaN not fired.
        """
        window = self._ring.window_m if window_m is None else window_m
        fired = np.zeros(len(self._mounts), dtype=np.bool_)
        fired[slice(None) if sensors is None else list(sensors)] = True
        echoes = self.true_echoes(pose, ring_yaw, fired)
        distances = echoes["distance"].copy()
        ring_pose, active = Pose(pose.x, pose.y, ring_yaw), fired.copy()
        for i in listeners:
            active[i] = True
            distances[i] = self._foreign_distance(ring_pose, i, np.flatnonzero(fired), echoes, math.inf)
        if self._acoustics.crosstalk > 0.0:
            self._mix_in_crosstalk(ring_pose, fired, echoes, distances)
        ranges = self._with_errors(distances / self._acoustics.sound_speed_scale, window)
        ranges[ranges > window] = math.inf
        if self._ring.resolution_m > 0.0:
            ranges = np.rint(ranges / self._ring.resolution_m) * self._ring.resolution_m
        np.maximum(ranges, self._ring.range_min_m, out=ranges)
        ranges[~active] = math.nan
        return ranges

    def true_echoes(self, pose: Pose, ring_yaw: float, fired: NDArray[np.bool_]) -> Records:
        """Return the first echo of each sensor, without errors of the electronics.

        Parameters
        ----------
        pose
            The body's true pose.
        ring_yaw
            The true direction of the ring, rad.
        fired
            Which sensors fire, shape (sensors,).

        Returns
        -------
        Records
            `acoustics.ECHO`, shape (sensors,); the next call overwrites it.
        """
        self._turn_mounts(pose.theta - ring_yaw)
        first_echoes(
            pose.x,
            pose.y,
            ring_yaw,
            self._mounts,
            fired,
            self._half_angle,
            self._acoustics.model == "specular",
            CONVEX_EDGE_REACH_M,
            SIGHT_SLACK_M,
            self._scene.circles,
            self._scene.segments,
            self._scene.corners,
            self._echoes,
        )
        return self._echoes

    def _turn_mounts(self, turn: float) -> None:
        """Turn the sensors of the part that follows the wheels by an angle in the ring's frame, rad."""
        part = Pose(0.0, 0.0, turn)
        for i, straight in zip(self._turning, self._turning_poses, strict=True):
            mount = self._mount_poses[i] = part.compose(straight)
            self._mounts[i] = (mount.x, mount.y, mount.theta)

    def _with_errors(self, ranges: Floats, window: float) -> Floats:
        """Return ranges with noise, dropouts and outliers; draws four numbers a sensor whatever the settings."""
        count = len(ranges)
        noise = self._rng.standard_normal(count)
        dropout, outlier, anywhere = self._rng.random((3, count))
        if self._is_clean:
            return ranges
        heard = np.isfinite(ranges)
        reported = np.full(count, math.inf)
        sigma = np.hypot(self._acoustics.noise_relative * ranges[heard], self._acoustics.noise_m)
        reported[heard] = ranges[heard] + sigma * noise[heard]
        reported[dropout < self._acoustics.dropout] = math.inf
        wild = outlier < self._acoustics.outliers
        farthest = window if self._acoustics.outlier_max_m is None else min(window, self._acoustics.outlier_max_m)
        nearest = min(self._ring.range_min_m, farthest)
        reported[wild] = nearest + anywhere[wild] * (farthest - nearest)
        return reported

    def _mix_in_crosstalk(
        self, ring_pose: Pose, fired: NDArray[np.bool_], echoes: Records, distances: Floats
    ) -> None:
        """Replace the distance of each sensor that first hears another one's pulse by half of that pulse's path."""
        count = len(self._mounts)
        chance = self._rng.random((count, count)) < self._acoustics.crosstalk
        for i in map(int, np.flatnonzero(fired)):
            others = np.flatnonzero(fired & chance[i] & (np.arange(count) != i))
            distances[i] = self._foreign_distance(ring_pose, i, others, echoes, float(distances[i]))

    def _foreign_distance(
        self, ring_pose: Pose, sensor: int, others: NDArray[np.intp], echoes: Records, at_most_m: float
    ) -> float:
        """Return half the shortest path of the others' pulses to a sensor, m; `at_most_m` if none is shorter."""
        lobe = LISTENING_LOBE * self._half_angle
        place = ring_pose.compose(self._mount_poses[sensor])
        for j in others:
            if not math.isfinite(echoes["distance"][j]):
                continue
            out, px, py = map(float, echoes[j])
            back = math.hypot(px - place.x, py - place.y)
            off_axis = abs(wrap_angle(math.atan2(py - place.y, px - place.x) - place.theta))
            if (
                0.5 * (out + back) < at_most_m
                and off_axis <= lobe
                and not hidden(place.x, place.y, px, py, SIGHT_SLACK_M, self._scene.circles, self._scene.segments)
            ):
                at_most_m = 0.5 * (out + back)
        return at_most_m
