"""A robot that speaks lines, emulated: fulfils `drivers.emulator.robot_device.RobotDevice`."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.body import RAMP_S
from drivers.emulator.event_device import EventDevice
from drivers.emulator.faults import Bumper, Fault, LowBattery, MotorFault, OdometryJump, Reboot, StopButton
from drivers.emulator.faulty_sonar import FaultySonar
from drivers.emulator.latency_trace import FrameCounter
from drivers.firing_pattern import FiringPattern, firing_pattern, sensors, time_of_flight_s
from drivers.lines.wire import NOISE, LineReader, Ranges, Sample, Wire
from drivers.messages import Flags, Twist

TICK_US: Final = 5_000
STILL: Final = Twist(0.0, 0.0)
FLAGS: Final = (
    (Bumper, Flags.BUMPER),
    (MotorFault, Flags.MOTOR_FAULT),
    (StopButton, Flags.LATCHED),
    (LowBattery, Flags.BATTERY_LOW),
)
STOPPING: Final = Flags.BUMPER | Flags.MOTOR_FAULT | Flags.LATCHED


class LineDevice(EventDevice):
    """It lives in ticks of 5 ms; all that happens, happens at one."""

    # Reset by a restart; see `_boot`.
    _reader: LineReader
    _target: Twist
    _pattern: FiringPattern
    _heard: deque[tuple[int, bytes]]

    def __init__(
        self, robot: RobotConfig, world: WorldConfig, seed: int, faults: Sequence[Fault], wire: Wire
    ) -> None:
        seeds = np.random.SeedSequence(seed).spawn(5)
        sonar_rng, drift_rng, outlier_rng, *line_rngs = map(np.random.default_rng, seeds)
        super().__init__(robot, world, faults, robot.link.baud, sonar_rng, drift_rng, line_rngs)
        self._sonar = FaultySonar(self._true_sonar, robot.ring.sensor_count, self._faults, outlier_rng)
        self._wire, self._own_pattern = wire, firing_pattern(robot.ring)
        self._report_us = round(1e6 * wire.period_s)
        self._boot()

    def _boot(self) -> None:
        """Start as after power-on, except for the body, which stays where it is."""
        self._booted_us = self._driven_us = self._step_us = self._next_report_us = self._now_us
        self._reader, self._target, self._pattern, self._step = LineReader(), STILL, self._own_pattern, 0
        self._heard = deque()
        self._line.clear()

    @property
    def flags(self) -> Flags:
        """What is wrong with the base, by the faults in force."""
        return Flags(sum(flag for kind, flag in FLAGS if self._faults.has(kind)))

    def frame_counter(self) -> FrameCounter:
        """Return a new counter of the lines of ranges and of velocities."""
        return _Lines(self._wire)

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        for line in self._reader.feed(self._hear(data)):
            with contextlib.suppress(*NOISE):
                asked = self._wire.heard(line)
                if isinstance(asked, FiringPattern):
                    self._pattern, self._step, self._step_us = asked, 0, self._now_us
                elif math.isfinite(asked.v) and math.isfinite(asked.w):
                    self._target, self._driven_us = asked, self._now_us

    def _next_us(self) -> int:
        return self._moved_us + TICK_US

    def _move(self) -> None:
        """Move the body up to the present event; a base without commands for its deadman, or with a fault, stops."""
        deadman_s, is_off = self._wire.deadman_s, self._faults.has(Reboot)
        is_late = deadman_s is not None and self._moved_us - self._driven_us >= 1e6 * deadman_s
        if is_late or is_off or self.flags & STOPPING:
            self._target = STILL
        took_us, self._moved_us = self._now_us - self._moved_us, self._now_us
        self._body.step(1e-6 * took_us, self._target, within_s=RAMP_S if is_late or is_off else None)

    def _start_fault(self, fault: Fault) -> None:
        """Carry out what a fault does at its start; most act while `_faults` has them."""
        if isinstance(fault, OdometryJump):
            self._body.jump_odometry(fault.dx_m, fault.dy_m, fault.dheading_rad)
        elif isinstance(fault, Reboot):
            self._line.clear()

    def _restart(self) -> None:
        self._body.reset_odometry()
        self._boot()

    def _handle_events(self) -> None:
        """Carry out what is due now: ranges whose window is over, a firing, odometry, garbage."""
        while self._heard and self._heard[0][0] <= self._now_us:
            self._line.send(self._heard.popleft()[1], self._now_us)
        if self._now_us >= self._step_us:
            self._fire()
        if self._now_us >= self._next_report_us:
            self._next_report_us += self._report_us
            sample = Sample(self._body.odometry_pose, self._body.twist, self._clock_s, self.flags)
            self._line.send(self._wire.say(sample), self._now_us)
        self._line.add_garbage(self._now_us, TICK_US)

    def _fire(self) -> None:
        """Fire the next step of the pattern; its ranges are sent when the window is over."""
        pattern = self._pattern
        fired = list(sensors(pattern.masks[self._step % len(pattern.masks)]))
        self._step, self._step_us = self._step + 1, self._step_us + round(1e6 * pattern.step_period_s)
        ranges = self._sonar.fire(self._now_us, self._body.pose, self._body.ring_yaw, fired, pattern.window_m)
        heard = {sensor: range_m for sensor, range_m in zip(fired, ranges, strict=True) if range_m is not None}
        said = self._wire.say(Ranges(heard, self._clock_s))
        self._heard.append((self._now_us + round(1e6 * time_of_flight_s(pattern.window_m)), said))

    @property
    def _clock_s(self) -> float:
        return 1e-6 * (self._now_us - self._booted_us)


class _Lines:
    """Counts echoes and velocities among whole lines."""

    def __init__(self, wire: Wire) -> None:
        self._wire, self._sent, self._received = wire, LineReader(), LineReader()

    def echoes(self, sent: bytes) -> int:
        """Return how many lines of ranges the bytes complete."""
        return sum(self._is(self._wire.read, line, Ranges) for line in self._sent.feed(sent))

    def drives(self, received: bytes) -> int:
        """Return how many velocities the bytes complete."""
        return sum(self._is(self._wire.heard, line, Twist) for line in self._received.feed(received))

    @staticmethod
    def _is(read: Callable[[bytes], object], line: bytes, kind: type) -> bool:
        with contextlib.suppress(*NOISE):
            return isinstance(read(line), kind)
        return False
