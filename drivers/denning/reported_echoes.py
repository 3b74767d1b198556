"""The emulated ring's echo frames: what its sensors report of one firing, in either version of the protocol."""

from __future__ import annotations

import numpy as np

from config.robot import RingConfig
from drivers.denning.frames import BEARING_RAD, Echo, Echo2, Echo3, Sweep
from drivers.denning.pattern_rotation import Step
from drivers.denning.wire_units import echo_byte, echo_count, range_unit_um, sweep_bearing
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faulty_sonar import FaultySonar
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import sensors
from drivers.messages import Pose
from drivers.servo_views import ServoViews


class EchoReporter:
    """Fires the ring's sensors and reports what they hear, faults of sensors included."""

    def __init__(self, ring: RingConfig, sonar: Sonar, faults: FaultSchedule, rng: np.random.Generator) -> None:
        self.unit_um = range_unit_um(ring)
        """What a count of ECHO2 stands for, µm."""
        self._sonar = FaultySonar(sonar, len(ring.mounts), faults, rng)
        self._views = ServoViews(ring)
        self._sweeps: dict[int, Sweep] = {}
        """Of each sensor whose servo scans."""
        self._turned: dict[int, int] = {}
        """How many bearings each of these has taken so far."""

    @property
    def has_servo(self) -> bool:
        """Whether a sensor of the ring stands on a servo."""
        return self._views.has_servo

    def set_scan(self, sweeps: tuple[Sweep, ...]) -> bool:
        """Let servos scan from their first bearing on; without sweeps they stand there, and echoes have no bearings.

        Returns
        -------
        bool
            False, and nothing changes, if a servo of the ring does not go to all bearings of its sweep.
        """
        reachable = all(
            0 <= sweep.sensor < len(self._views.on_servo)
            and self._views.on_servo[sweep.sensor]
            and sweep.bearings > 1
            and all(self._mount(sweep, k) is not None for k in range(sweep.bearings))
            for sweep in sweeps
        )
        if reachable:
            self._sweeps = {sweep.sensor: sweep for sweep in sweeps}
            self._turned = dict.fromkeys(self._sweeps, 0)
        return reachable

    def _mount(self, sweep: Sweep, turned: int) -> int | None:
        """Return the mount of a sweep after so many turns; None if the servo does not go there."""
        return self._views.mount(sweep.sensor, sweep_bearing(sweep, turned) * BEARING_RAD)

    def fire(self, step: Step, t_us: int, pose: Pose, ring_yaw: float, version: int) -> Echo | Echo2 | Echo3:
        """Return the frame of one firing at `t_us` of the robot's clock; listeners report in version 2 only."""
        if self.has_servo:
            return self._fire_servos(step, t_us, pose, ring_yaw)
        fired, heard = sensors(step.mask), sensors(step.listeners) if version > 1 else ()
        reported = self._sonar.fire(step.at_us, pose, ring_yaw, fired, step.window_m, heard)
        if version == 1:
            return Echo(0, t_us, step.number, step.mask, tuple(map(echo_byte, reported)))
        counts = tuple(echo_count(range_m, self.unit_um) for range_m in reported)
        return Echo2(0, t_us, step.number, step.mask, step.listeners, counts)

    def _fire_servos(self, step: Step, t_us: int, pose: Pose, ring_yaw: float) -> Echo2 | Echo3:
        """Return the frame of one firing of a ring with servos, which then go on to their next bearings."""
        fired, mounts, bearings = sensors(step.mask), [], []
        for sensor in fired:
            sweep, mount = self._sweeps.get(sensor), None
            if sweep is not None:
                mount, turned = self._mount(sweep, self._turned[sensor]), self._turned[sensor]
                bearings.append(sweep_bearing(sweep, turned))
                self._turned[sensor] = turned + 1
            mounts.append(self._views.begin(sensor) if mount is None else mount)
        reported = self._sonar.fire(step.at_us, pose, ring_yaw, mounts, step.window_m)
        counts = tuple(echo_count(range_m, self.unit_um) for range_m in reported)
        if not self._sweeps:
            return Echo2(0, t_us, step.number, step.mask, 0, counts)
        mask = step.mask & sum(1 << sensor for sensor in self._sweeps)
        return Echo3(0, t_us, step.number, step.mask, mask, counts, tuple(bearings))
