"""The ring's electronics: the ranges that the sensors report, given the echoes of a scene.

Serves any ring and any protocol: ranges are in metres, quantised by the ring's resolution. A firing always draws the
same number of random numbers in the same order, so that the same seed gives the same run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from config.world import AcousticsConfig
from drivers.emulator.acoustics import ECHO, MOUNT, first_echoes
from drivers.emulator.cross_paths import first_cross_paths
from drivers.emulator.scene import Scene
from drivers.emulator.surfaces import CONE, SILENT, SURFACES, Records
from drivers.firing_pattern import LISTENING_LOBE
from drivers.messages import Floats, Pose

LATE_M = (0.3, 2.0)
"""A late echo's way leads over another surface: so much farther than the first one in the beam, m."""


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
        self._mounts: Records = np.array(list(ring.mounts), dtype=MOUNT)
        self._straight = self._mounts["angle"].copy()
        self._turning = ring.turning
        self._turning_poses = [Pose(*ring.mounts[i]) for i in ring.turning]
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
            The body's true pose, whose origin is the ring's centre; the acoustics' jitter is added to it.
        ring_yaw
            The true direction of the ring, rad; so here.
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
        pose, ring_yaw = self._jittered(pose, ring_yaw)
        distances = self.true_echoes(pose, ring_yaw, fired)["distance"].copy()
        if self._acoustics.late > 0.0:
            self._add_late(distances, pose, ring_yaw, fired)
        active = fired.copy()
        for i in listeners:
            active[i] = True
        heard = fired[:, np.newaxis] & (active & ~fired)
        if self._acoustics.crosstalk > 0.0:
            # [listener, transmitter]: who hears a pulse that is not its own, if that arrives first
            chance = self._rng.random((len(fired), len(fired))) < self._acoustics.crosstalk
            heard |= fired[:, np.newaxis] & fired & ~np.eye(len(fired), dtype=np.bool_) & chance.T
        if heard.any():
            np.minimum(distances, self.true_cross_paths(pose, ring_yaw, heard), out=distances)
        ranges = self._with_errors(distances / self._acoustics.sound_speed_scale, window)
        ranges[ranges > window] = math.inf
        if self._ring.resolution_m > 0.0:
            ranges = np.rint(ranges / self._ring.resolution_m) * self._ring.resolution_m
        np.maximum(ranges, self._ring.range_min_m, out=ranges)
        ranges[~active] = math.nan
        return ranges

    def turn_each(self, turns: Mapping[int, float]) -> None:
        """Turn sensors, each in its place, by angles against the robot file, rad; the others look as it says."""
        self._mounts["angle"] = self._straight
        for sensor, angle in turns.items():
            self._mounts["angle"][sensor] += angle

    @property
    def echoes(self) -> Records:
        """What the sensors heard first in the last firing, without errors: `acoustics.ECHO`, shape (sensors,)."""
        return self._echoes

    def _jittered(self, pose: Pose, ring_yaw: float) -> tuple[Pose, float]:
        """Return where the body and the ring truly are at a firing that odometry has at this pose."""
        acoustics = self._acoustics
        if not (acoustics.jitter_m or acoustics.jitter_rad):
            return pose, ring_yaw
        sigmas = acoustics.jitter_m, acoustics.jitter_m, acoustics.jitter_rad
        dx, dy, turn = (self._rng.standard_normal(3) * sigmas).tolist()
        return Pose(pose.x + dx, pose.y + dy, pose.theta + turn), ring_yaw + turn

    def _add_late(self, distances: Floats, pose: Pose, ring_yaw: float, fired: NDArray[np.bool_]) -> None:
        """Give some of the sensors that hear nothing a late echo, beyond the first surface in their beam."""
        chance, share = self._rng.random((2, len(fired)))
        is_late = fired & np.isinf(distances) & (chance < self._acoustics.late)
        if is_late.any():
            rough = self._scene._replace(circles=self._scene.circles.copy(), segments=self._scene.segments.copy())
            for surfaces in (rough.circles, rough.segments):
                surfaces["surface"][surfaces["surface"] != SILENT] = CONE
            nearest = np.empty(len(fired), dtype=ECHO)
            self._find(pose, ring_yaw, is_late, rough, nearest)
            farther = LATE_M[0] + share * (LATE_M[1] - LATE_M[0])
            distances[is_late] = (nearest["distance"] + farther)[is_late]

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
        self._find(pose, ring_yaw, fired, self._scene, self._echoes)
        return self._echoes

    def _find(self, pose: Pose, ring_yaw: float, fired: NDArray[np.bool_], scene: Scene, out: Records) -> None:
        """Find the first echoes from the surfaces of a scene."""
        self._turn_mounts(pose.theta - ring_yaw)
        first_echoes(
            (float(pose.x), float(pose.y), float(ring_yaw)),
            self._mounts,
            fired,
            self._half_angle,
            SURFACES[self._acoustics.model],
            self._acoustics.rays,
            scene,
            out,
        )

    def _turn_mounts(self, turn: float) -> None:
        """Turn the sensors of the part that follows the wheels by an angle in the ring's frame, rad."""
        part = Pose(0.0, 0.0, turn)
        for i, straight in zip(self._turning, self._turning_poses, strict=True):
            mount = part.compose(straight)
            self._mounts[i] = (mount.x, mount.y, mount.theta)

    def true_cross_paths(self, pose: Pose, ring_yaw: float, heard: NDArray[np.bool_]) -> Floats:
        """Return half the shortest path to each sensor from the others that it hears, without errors.

        Parameters
        ----------
        pose
            The body's true pose.
        ring_yaw
            The true direction of the ring, rad.
        heard
            Whose pulse is heard by whom: [transmitter, listener], shape (sensors, sensors).

        Returns
        -------
        Floats
            Shape (sensors,), m; +inf where nothing is heard.
        """
        self._turn_mounts(pose.theta - ring_yaw)
        out = np.empty(len(self._mounts))
        first_cross_paths(
            (float(pose.x), float(pose.y), float(ring_yaw)),
            self._mounts,
            heard,
            self._half_angle,
            LISTENING_LOBE * self._half_angle,
            SURFACES[self._acoustics.model],
            self._scene,
            out,
        )
        return out

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
