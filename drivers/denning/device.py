"""The emulated robot's side of the ring-and-base protocol: without I/O, and in its own time.

The robot is an event simulation: body ticks, firings, ends of windows, odometry, the deadman, faults. `advance`
simulates all events up to a time and returns the bytes that have left the transmitter by then; how the time is split
into calls makes no difference. So the same robot serves a pty in real time and a test in virtual time.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.denning import frames
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Drive, Halt, Hello, Listen, NakCode, Pattern, Release, RobotFrame, Scan
from drivers.denning.pattern_rotation import Rotation, window_us
from drivers.denning.reported_echoes import EchoReporter
from drivers.denning.wire_frame_counter import WireFrameCounter
from drivers.denning.wire_units import emulated_version
from drivers.driver import DriverError
from drivers.emulator.body import BRAKE_S, RAMP_S
from drivers.emulator.event_device import EventDevice
from drivers.emulator.faults import (
    BlockedWheels,
    Bumper,
    Deadman,
    Fault,
    IgnoredHalt,
    LowBattery,
    MotorFault,
    OdometryJump,
    Reboot,
    Runaway,
    StopButton,
)
from drivers.messages import Flags, Twist

DEADMAN_MS = 500
"""The base ramps to a stop this long after the last DRIVE, unless a fault changes it; reported in IDENT."""
ODOMETRY_PERIOD_MS = 20
"""Time between odometry frames; reported in IDENT."""
TICK_US = 5_000
"""Longest step of the body's simulation, µs."""
NAME = "denning"
_LATCHED, _DEADMAN = int(Flags.LATCHED), int(Flags.DEADMAN)  # used at every event, where an enumeration is slow
_STILL = Twist(0.0, 0.0)


class DenningDevice(EventDevice):
    """A `drivers.emulator.robot_device.RobotDevice` that speaks the ring-and-base protocol.

    Its own clock begins at `clock_start_us`: 0 on a real robot, near 2³² to see it wrap soon.

    Raises
    ------
    DriverError
        The ring has more sensors than the protocol's masks have bits.
    """

    # Reset by a restart; see `_boot`.
    _clock_offset_us: int
    _decoder: Decoder
    _seq: int
    _version: int
    _echoes: deque[tuple[int, frames.Echo | frames.Echo2 | frames.Echo3]]
    """Echoes to send, and when, µs: as their windows close."""
    _rotation: Rotation
    _flags: Flags
    _target: Twist
    """The velocity of the last DRIVE, or zero."""
    _drive_seq: int
    """Number of the last DRIVE that was obeyed."""
    _deadman_us: int
    """When the deadman stops the base, unless a DRIVE comes before."""
    _odometry_us: int
    """When the next ODOM is due."""

    def __init__(
        self,
        robot: RobotConfig,
        world: WorldConfig,
        seed: int,
        faults: Sequence[Fault] = (),
        clock_start_us: int = 0,
    ) -> None:
        mounts = robot.ring.mounts
        self._sensors, sensors_max = robot.ring.sensor_count, frames.SENSORS_MAX
        if self._sensors > sensors_max:
            raise DriverError(f"the ring has {self._sensors} sensors: the protocol supports at most {sensors_max}")
        seeds = np.random.SeedSequence(seed).spawn(6)
        sonar_rng, drift_rng, self._boot_rng, *noises = map(np.random.default_rng, seeds)
        *line_rngs, outlier_rng = noises
        self._ring_radius_mm = round(1000.0 * max(math.hypot(m.x_m, m.y_m) for m in mounts))
        self._newest = emulated_version(robot)
        super().__init__(robot, world, faults, robot.link.baud, sonar_rng, drift_rng, line_rngs)
        self._reporter = EchoReporter(robot.ring, self._true_sonar, self._faults, outlier_rng)
        self._deadman_ms = DEADMAN_MS
        self._boot_id = self._new_boot_id()
        self._boot(clock_start_us)

    @property
    def flags(self) -> Flags:
        """The base's status; BUMPER and MOTOR_FAULT give the cause of the latch and are cleared with it."""
        return self._flags | Flags.BATTERY_LOW if self._faults.has(LowBattery) else self._flags

    @property
    def boot_id(self) -> int:
        """The random number of this start, as in IDENT."""
        return self._boot_id

    def frame_counter(self) -> WireFrameCounter:
        """Return a new counter of this protocol's echoes and drive commands, for a line that is in use already."""
        return WireFrameCounter()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the time to which the robot has advanced."""
        if not (data := self._hear(data)):
            return
        for frame in self._decoder.feed(data):
            self._move()
            self._obey(frame)
        for seq, code in self._decoder.take_rejected():
            self._send(frames.Nak(0, seq, code))

    # Commands of the host.

    def _obey(self, frame: frames.Frame) -> None:
        """Carry out a frame of the host and answer it; a DRIVE is answered only if it is refused."""
        match frame:
            case Hello() if not 1 <= frame.version <= self._newest:
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Hello():
                self._version = frame.version
                size, times = (self._sensors, self._ring_radius_mm), (self._deadman_ms, ODOMETRY_PERIOD_MS)
                can = frames.HAS_SERVOS if self._reporter.has_servo else frames.CAN_LISTEN
                more = (self._reporter.unit_um, can) if frame.version > 1 else ()
                self._send(frames.Ident(0, frame.version, *size, *times, self._boot_id, NAME, *more))
            case Listen() if self._version == 1:
                self._send(frames.Nak(0, frame.seq, NakCode.UNKNOWN_TYPE))
            case Listen() if self._can_listen(frame) and self._rotation.set_listeners(frame.masks):
                self._send(frames.Ack(0, frame.seq))
            case Listen():
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Scan() if self._version == 1 or not self._reporter.has_servo:
                self._send(frames.Nak(0, frame.seq, NakCode.UNKNOWN_TYPE))
            case Scan() if self._reporter.set_scan(frame.sweeps):
                self._send(frames.Ack(0, frame.seq))
            case Scan():
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Pattern() if self._is_possible(frame):
                self._rotation.set_pattern(frame, self._now_us)
                self._reporter.set_scan(())
                self._send(frames.Ack(0, frame.seq))
            case Pattern():
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Drive() if Flags.LATCHED in self._flags:
                self._send(frames.Nak(0, frame.seq, NakCode.LATCHED))
            case Drive():
                # The body clamps the velocity to its limits.
                self._target = Twist(frame.v_mm_s * 1e-3, frame.w_mrad_s * 1e-3)
                self._drive_seq = frame.seq
                self._deadman_us = self._now_us + 1000 * self._deadman_ms
                self._flags &= ~Flags.DEADMAN
            case Halt():
                self._latch(Flags.NONE)
                self._send(frames.Ack(0, frame.seq))
            case Release():
                self._flags &= Flags.DEADMAN
                self._latch_again()
                self._send(frames.Ack(0, frame.seq))

    def _is_possible(self, pattern: Pattern) -> bool:
        """Return whether the ring can carry out a pattern; one without masks stops it."""
        long_enough = 1000 * pattern.step_period_ms >= window_us(pattern)
        return not pattern.masks or (self._within_ring(pattern) and long_enough)

    def _can_listen(self, listen: Listen) -> bool:
        return self._within_ring(listen) and not (listen.masks and self._reporter.has_servo)

    def _within_ring(self, frame: Pattern | Listen) -> bool:
        return all(mask >> self._sensors == 0 for mask in frame.masks)

    def _latch(self, reason: Flags) -> None:
        """Latch the base for a reason, and let it brake."""
        self._flags |= Flags.LATCHED | reason
        self._end_drive()

    def _end_drive(self) -> None:
        """Let the base stand, unless it ignores halts."""
        if not self._faults.has(IgnoredHalt):
            self._target = _STILL

    def _latch_again(self) -> None:
        """Latch if a bumper or the stop is still pressed or a motor still faulty: that cannot be released."""
        if self._faults.has(Bumper):
            self._latch(Flags.BUMPER)
        if self._faults.has(MotorFault):
            self._latch(Flags.MOTOR_FAULT)
        if self._faults.has(StopButton):
            self._latch(Flags.NONE)

    # Events.

    def _next_us(self) -> int:
        """Return the time of the next event, µs; called at every event, so it allocates nothing."""
        next_us = self._moved_us // TICK_US * TICK_US + TICK_US
        fault_us = self._faults.next_us
        if fault_us is not None and fault_us < next_us:
            next_us = fault_us
        if not self._faults.has(Reboot):
            if self._odometry_us < next_us:
                next_us = self._odometry_us
            if self._deadman_us < next_us and not self._flags.value & _DEADMAN:
                next_us = self._deadman_us
            firing_us = self._rotation.next_us
            if firing_us is not None and firing_us < next_us:
                next_us = firing_us
            if self._echoes and self._echoes[0][0] < next_us:
                next_us = self._echoes[0][0]
        return max(self._now_us, next_us)

    def _move(self) -> None:
        """Move the body up to the present event."""
        dt_s = (self._now_us - self._moved_us) * 1e-6
        if dt_s <= 0.0:
            return
        target, within_s = self._wheels()
        if self._body.step(dt_s, target, within_s=within_s):
            self._latch(Flags.BUMPER)
        self._moved_us = self._now_us

    def _wheels(self) -> tuple[Twist, float | None]:
        """Return the velocity that the wheels accelerate towards, and the time for it if they brake."""
        flags, faults = self._flags.value, self._faults
        if faults.has(Reboot) or faults.has(BlockedWheels):
            return _STILL, BRAKE_S
        if flags & _LATCHED and not faults.has(IgnoredHalt):
            return _STILL, BRAKE_S
        for runaway in faults.all(Runaway):
            return Twist(runaway.v_m_s, runaway.w_rad_s), None
        return (_STILL, RAMP_S) if flags & _DEADMAN and not faults.has(IgnoredHalt) else (self._target, None)

    def _handle_events(self) -> None:
        """Carry out what is due now: the deadman, echoes whose window is over, a firing, odometry, garbage."""
        now = self._now_us
        if now >= self._deadman_us and not self._flags.value & _DEADMAN:
            self._flags |= Flags.DEADMAN
            self._end_drive()
        while self._echoes and self._echoes[0][0] <= now:
            self._send(self._echoes.popleft()[1])
        if (step := self._rotation.step(now)) is not None:
            t_us, body = self._clock_us(step.at_us), self._body
            echo = self._reporter.fire(step, t_us, body.pose, body.ring_yaw, self._version)
            self._echoes.append((step.closes_us, echo))
        if self._odometry_us <= now:
            self._report_odometry()
            self._odometry_us += 1000 * ODOMETRY_PERIOD_MS
        self._line.add_garbage(now, TICK_US)

    def _report_odometry(self) -> None:
        body, twist = self._body, self._body.odometry_twist
        self._send(
            frames.Odom(
                0,
                self._clock_us(self._now_us),
                round(body.odometry_pose.x * 1e4),
                round(body.odometry_pose.y * 1e4),
                round(body.odometry_pose.theta * 1e4),
                round(body.odometry_ring_yaw * 1e4),
                round(twist.v * 1e3),
                round(twist.w * 1e3),
                int(self.flags),
                self._drive_seq,
            )
        )

    # Faults.

    def _restart(self) -> None:
        """Start again with another boot number and the odometry at zero."""
        self._boot_id = self._new_boot_id()
        self._body.reset_odometry()
        self._boot(0)

    def _start_fault(self, fault: Fault) -> None:
        """Carry out what a fault does at its start; most act while `_faults` has them."""
        match fault:
            case Reboot():
                self._boot(0)
            case Bumper():
                self._latch(Flags.BUMPER)
            case MotorFault():
                self._latch(Flags.MOTOR_FAULT)
            case StopButton():
                self._latch(Flags.NONE)
            case Deadman():
                self._deadman_ms = fault.deadman_ms
                self._deadman_us = self._now_us + 1000 * self._deadman_ms
            case OdometryJump():
                self._body.jump_odometry(fault.dx_m, fault.dy_m, fault.dheading_rad)

    def _boot(self, clock_start_us: int) -> None:
        """Start as after power-on, except for the body, which stays where it is."""
        self._clock_offset_us = clock_start_us - self._now_us
        self._decoder = Decoder("host")
        self._version = 1
        self._seq = 0
        self._line.clear()
        self._echoes = deque()
        self._rotation = Rotation()
        self._reporter.set_scan(())
        self._flags = Flags.NONE
        self._latch_again()
        self._target = _STILL
        self._drive_seq = 0
        self._deadman_us = self._now_us + 1000 * self._deadman_ms
        self._odometry_us = self._now_us + 1000 * ODOMETRY_PERIOD_MS

    def _new_boot_id(self) -> int:
        return int(self._boot_rng.integers(1, 2**32))

    # The line.

    def _clock_us(self, at_us: int) -> int:
        """Return what the robot's counter shows at an emulated time, µs; it wraps."""
        return (self._faults.clock_us(at_us) + self._clock_offset_us) % 2**32

    def _send(self, frame: RobotFrame) -> None:
        """Queue `frame` with the next sequence number, which counts as used even if the frame is lost."""
        data = encode(frame, self._seq)
        self._seq = (self._seq + 1) % 256
        self._line.send(data, self._now_us)
