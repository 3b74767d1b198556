"""Sensors and their bearings, as wire and ring logs have them, and the ring's mounts, one for each bearing.

A sensor on a servo reports a bearing with each reading. Everywhere else it counts as one sensor for each bearing of
its scan, as in `config.robot.RingConfig.mounts`; here the one is turned into the other.
"""

from __future__ import annotations

import math

from config.robot import RingConfig

_SLACK = 0.51
"""Bearings are taken for the nearest of the scan up to so many of its steps away: half a step, and rounding."""


class ServoViews:
    """The bearings of a ring's sensors.

    Without servos each sensor has one bearing.
    """

    def __init__(self, ring: RingConfig) -> None:
        self.sensor_of = ring.sensor_of
        """The sensor of each mount."""
        self.count = len(self.sensor_of)
        """Mounts: bearings of all sensors."""
        self.on_servo = tuple(sensor.servo for sensor in ring.sensors or ()) or (False,) * ring.sensor_count
        """Whether each sensor stands on a servo."""
        self._begins = [self.sensor_of.index(i) for i in range(ring.sensor_count)]
        """First mount of each sensor."""
        self._sizes = [self.sensor_of.count(i) for i in range(ring.sensor_count)]
        """How many mounts each sensor has."""
        self._angles = [mount.angle_rad for mount in ring.mounts]

    @property
    def has_servo(self) -> bool:
        """Whether a sensor stands on a servo."""
        return any(self.on_servo)

    def begin(self, sensor: int) -> int:
        """Return the first mount of a sensor."""
        return self._begins[sensor]

    def bearing(self, mount: int) -> float:
        """Return the direction of a mount, rad from the ring's front."""
        return self._angles[mount]

    def mount(self, sensor: int, bearing: float = math.nan) -> int | None:
        """Return the mount of a sensor at a bearing, rad; None if its servo does not go there."""
        begin, size = self._begins[sensor], self._sizes[sensor]
        if size == 1:
            return begin
        off = [abs(math.remainder(bearing - angle, math.tau)) for angle in self._angles[begin : begin + size]]
        nearest = min(range(size), key=off.__getitem__)
        step = abs(math.remainder(self._angles[begin + 1] - self._angles[begin], math.tau))
        return begin + nearest if off[nearest] <= _SLACK * step else None
