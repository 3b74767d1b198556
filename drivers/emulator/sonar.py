"""The ring's electronics: what the sensors report of the echoes that the scene sends back.

Serves any ring, with the protocol or without it: ranges come out in metres, quantised by the ring's resolution.
The draws of a firing are always the same in number and order, so that one seed gives one run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from config.world import AcousticsConfig
from drivers.emulator.acoustics import CONVEX_EDGE_REACH_M, SIGHT_SLACK_M, first_echoes, hidden
from drivers.emulator.scene import Scene
from drivers.messages import Floats, Pose, wrap_angle

LISTENING_LOBE = 2.0
"""How far off its axis a sensor hears another's pulse, in beam half-angles. The beam's edge is where emission and
reception together fall below what the electronics detect; for a foreign pulse only reception is off its axis, which
costs half the decibels, so it is heard farther out: about √2 times for an ordinary echo, about twice for a strong
one, and strong ones are those that matter here."""


class Sonar:
    """A ring of ultrasonic sensors in a scene.

    Parameters
    ----------
    ring
        Where the sensors sit, their beam, and how they quantise.
    scene
        What answers.
    acoustics
        The model of reflection and everything that spoils a range.
    rng
        The only source of randomness.
    """

    def __init__(self, ring: RingConfig, scene: Scene, acoustics: AcousticsConfig, rng: np.random.Generator) -> None:
        self._ring = ring
        self._scene = scene
        self._acoustics = acoustics
        self._rng = rng
        self._mounts: Floats = np.array(ring.mounts, dtype=np.float64).reshape(-1, 3)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._is_clean = not (
            acoustics.noise_relative or acoustics.noise_m or acoustics.dropout or acoustics.outliers
        )
        self._echoes: Floats = np.empty((len(self._mounts), 3))

    def fire(
        self, pose: Pose, ring_yaw: float, sensors: Iterable[int] | None = None, window_m: float | None = None
    ) -> Floats:
        """Fire sensors together and listen.

        Parameters
        ----------
        pose
            The body's true pose; its place is the ring's centre.
        ring_yaw
            The true direction of the ring, radians.
        sensors
            Numbers of those that fire; all where not given.
        window_m
            How far to listen; the ring's own window where not given.

        Returns
        -------
        Floats
            Shape (sensors,), as in `drivers.messages.Firing.ranges_m`: metres, +inf nothing heard, NaN not fired.
        """
        window = self._ring.window_m if window_m is None else window_m
        fired = np.zeros(len(self._mounts), dtype=np.bool_)
        fired[slice(None) if sensors is None else list(sensors)] = True
        echoes = self.true_echoes(pose, ring_yaw, fired)
        distances = echoes[:, 0].copy()
        if self._acoustics.crosstalk > 0.0:
            self._mix_in_crosstalk(pose, ring_yaw, fired, echoes, distances)
        ranges = self._spoil(distances / self._acoustics.sound_speed_scale, window)
        ranges[ranges > window] = math.inf
        if self._ring.resolution_m > 0.0:
            ranges = np.rint(ranges / self._ring.resolution_m) * self._ring.resolution_m
        np.maximum(ranges, self._ring.range_min_m, out=ranges)
        ranges[~fired] = math.nan
        return ranges

    def true_echoes(self, pose: Pose, ring_yaw: float, fired: NDArray[np.bool_]) -> Floats:
        """Return distance and reflecting point of each first echo, shape (sensors, 3), before any electronics.

        The array is the ring's own and is overwritten by the next call.
        """
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

    def _spoil(self, ranges: Floats, window: float) -> Floats:
        """Apply noise, drop-outs and outliers; the same four draws a sensor whatever the settings."""
        count = len(ranges)
        noise = self._rng.standard_normal(count)
        dropout, outlier, anywhere = self._rng.random((3, count))
        if self._is_clean:
            return ranges
        heard = np.isfinite(ranges)
        spoilt = np.full(count, math.inf)
        sigma = np.hypot(self._acoustics.noise_relative * ranges[heard], self._acoustics.noise_m)
        spoilt[heard] = ranges[heard] + sigma * noise[heard]
        spoilt[dropout < self._acoustics.dropout] = math.inf
        wild = outlier < self._acoustics.outliers
        farthest = window if self._acoustics.outlier_max_m is None else min(window, self._acoustics.outlier_max_m)
        nearest = min(self._ring.range_min_m, farthest)
        spoilt[wild] = nearest + anywhere[wild] * (farthest - nearest)
        return spoilt

    def _mix_in_crosstalk(
        self, pose: Pose, ring_yaw: float, fired: NDArray[np.bool_], echoes: Floats, distances: Floats
    ) -> None:
        """Lower `distances` to half the way sensor j, its reflecting point, sensor i, where i hears that first."""
        count = len(self._mounts)
        chance = self._rng.random((count, count)) < self._acoustics.crosstalk
        lobe = LISTENING_LOBE * self._half_angle
        for i in np.flatnonzero(fired):
            place = Pose(pose.x, pose.y, ring_yaw).compose(Pose(*self._mounts[i]))
            for j in np.flatnonzero(fired & np.isfinite(echoes[:, 0]) & chance[i]):
                out, px, py = echoes[j]
                back = math.hypot(px - place.x, py - place.y)
                off_axis = abs(wrap_angle(math.atan2(py - place.y, px - place.x) - place.theta))
                if (
                    j != i
                    and 0.5 * (out + back) < distances[i]
                    and off_axis <= lobe
                    and not hidden(place.x, place.y, px, py, SIGHT_SLACK_M, self._scene.circles, self._scene.segments)
                ):
                    distances[i] = 0.5 * (out + back)
