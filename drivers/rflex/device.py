"""The emulated robot with an rFLEX controller: its side of the protocol, without I/O and in its own time.

It reports nothing until it is asked, moves only with its brake off, fires its sonar banks by itself, and stops when
no motion command comes. It sends without escapes, and no ESC where it can choose: in packet numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from config.robot import SOUND_SPEED_M_S, RobotConfig
from config.world import WorldConfig
from drivers.emulator.acoustics import clearance
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
from drivers.emulator.faulty_sonar import FaultySonar
from drivers.messages import Flags, Pose, Twist
from drivers.rflex.codec import (
    DIO,
    JOYSTICK,
    NO_ECHO,
    ROTATION,
    TRANSLATION,
    AxisReport,
    Decoder,
    Frame,
    Input,
    Report,
    SonarReport,
    Status,
    direction_of,
    encode,
    frame_of,
    position_of,
    sonar_delays_of,
)
from drivers.rflex.wire_frame_counter import WireFrameCounter
from drivers.rflex.wire_units import sonar_ids

TICK_US = 5_000
"""Longest step of the body's simulation, µs."""
PERIOD_MIN_US = 10_000
"""Shortest period of reports, and shortest sonar step, µs."""
VOLTS, VOLTS_LOW = 25.2, 20.0
"""The battery: full, and nearly empty, V."""
VOLTS_OFFSET = 1.2
"""What the controller does not measure of it, V."""
STILL = Twist(0.0, 0.0)
_PRESSED_M = 1e-3
"""A bumper is pressed by a surface this near, m."""
_I32 = 1 << 32


class RflexDevice(EventDevice):
    """A `drivers.emulator.robot_device.RobotDevice` that speaks the rFLEX protocol.

    Raises
    ------
    DriverError
        The sonar banks do not fit the ring.
    """

    # Reset by a restart; see `_boot`.
    _decoder: Decoder
    _brake: bool
    _tripped: bool
    """Whether the fail-safe has stopped the base."""
    _target: Twist
    _driven: Twist
    """The last velocity that the wheels went for by command."""
    _rates: tuple[float, float]
    """Accelerations commanded, m/s² and rad/s²."""
    _commanded_us: int
    """When the last motion command came."""
    _zero_m: float
    """Way by odometry at which the count of the translation is zero."""
    _offsets: list[int]
    """What is added to the counts of each axis."""
    _report_us: int | None
    """When axes, bumpers and sonars are due next; None for never."""
    _input_us: int | None
    _fire_us: int | None
    _heard: tuple[tuple[int, int], ...] | None
    """What the last firing heard: reported at the next."""
    _was_touched: bool
    """What the last report of the bumpers said."""
    _has_touched: bool
    """Whether there was one."""
    _number: int

    def __init__(
        self, robot: RobotConfig, world: WorldConfig, seed: int, faults: Sequence[Fault] = (), clock_start_us: int = 0
    ) -> None:
        seeds = np.random.SeedSequence(seed).spawn(5)
        sonar_rng, drift_rng, outlier_rng, *line_rngs = map(np.random.default_rng, seeds)
        self._config, self._rflex = robot, robot.rflex
        self._ids = sonar_ids(robot)
        super().__init__(robot, world, faults, robot.link.baud, sonar_rng, drift_rng, line_rngs)
        self._sonar = FaultySonar(self._true_sonar, len(robot.ring.mounts), self._faults, outlier_rng)
        self._clock_start_us, self._booted_us = clock_start_us, 0
        self._fail_safe_us = round(1e6 * self._rflex.fail_safe_s)
        self._touched_at: tuple[Pose, bool] | None = None
        """The last pose that was tested, and whether a surface touches the base there."""
        self._boot()

    @property
    def flags(self) -> Flags:
        """The base's status; the brake counts as its latch."""
        status = {
            Flags.LATCHED: self._brake,
            Flags.BUMPER: self._is_touched(),
            Flags.MOTOR_FAULT: self._faults.has(MotorFault),
            Flags.DEADMAN: self._tripped,
            Flags.BATTERY_LOW: self._faults.has(LowBattery),
        }
        return Flags(sum(flag for flag, is_set in status.items() if is_set))

    def frame_counter(self) -> WireFrameCounter:
        """Return a new counter of this protocol's ranges and velocities, for a line that is in use already."""
        return WireFrameCounter()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the time to which the robot has advanced."""
        if not (data := self._hear(data)):
            return
        for frame in self._decoder.feed(data):
            self._move()
            self._obey(frame)

    # Commands of the host.

    def _obey(self, frame: Frame) -> None:
        """Carry out a command; unknown ones are ignored. None is acknowledged."""
        match frame.port, frame.opcode, len(frame.data):
            case 2, 7, 14:
                self._set_speed(*direction_of(frame))
            case 2, 8, 17:
                axis, position = position_of(frame)
                if axis in (TRANSLATION, ROTATION):
                    self._set_speed(axis, 0, 0)
                    self._offsets[axis] = position - self._counts()[axis]
            case 2, 10, _:
                self._target = STILL
            case 2, 11, _:
                self._brake, self._target = True, STILL
            case 2, 12, _:
                self._brake = self._faults.has(StopButton)
            case 2, 34, 8:
                self._mask = int.from_bytes(frame.data[4:], "big")
                self._report_period_us = self._period(frame.data[:4])
                self._report_us = self._start(self._report_period_us if self._mask & 3 else 0)
            case 1, 1, _:
                volts = VOLTS_LOW if self._faults.has(LowBattery) else VOLTS
                self._send(Status(self._clock(), round(100.0 * (volts - VOLTS_OFFSET)), int(self._brake)))
            case 3, 0, _:
                self._send(Frame(JOYSTICK, 0, self._clock().to_bytes(4, "big") + bytes(9)))
            case 4, 0, 13:
                step_us, on = sonar_delays_of(frame)
                self._heard, self._step = None, 0
                self._step_us = max(PERIOD_MIN_US, step_us)
                self._fire_us = self._now_us if on else None
            case 5, 0, 4:
                self._input_period_us = self._period(frame.data)
                self._input_us = self._start(self._input_period_us)
                self._send(Frame(DIO, 0, bytes(4) + self._clock().to_bytes(4, "big")))
            case _:
                pass

    def _set_speed(self, axis: int, speed: int, acceleration: int) -> None:
        """Take a motion command, which also keeps the fail-safe from stopping the base."""
        self._commanded_us, self._tripped = self._now_us, False
        if self._brake:
            return
        v, w = self._target.v, self._target.w
        body, rflex = self._config.body, self._rflex
        if axis == TRANSLATION:
            self._target = Twist(speed / rflex.distance_factor, w)
            self._rates = (acceleration / rflex.distance_factor or body.acceleration_max_m_s2, self._rates[1])
        elif axis == ROTATION:
            self._target = Twist(v, speed / rflex.angle_factor)
            self._rates = (self._rates[0], acceleration / rflex.angle_factor or body.turn_acceleration_max_rad_s2)

    @staticmethod
    def _period(data: bytes) -> int:
        """Return the period that a command asks for, µs, not below the least; 0 for never."""
        period_us = int.from_bytes(data, "big")
        return max(PERIOD_MIN_US, period_us) if period_us else 0

    def _start(self, period_us: int) -> int | None:
        """Return when something with this period is due first; None for a period of 0."""
        return self._now_us + period_us if period_us else None

    # Events.

    def _next_us(self) -> int:
        """Return the time of the next event, µs."""
        others = [self._moved_us // TICK_US * TICK_US + TICK_US, self._faults.next_us]
        if not self._faults.has(Reboot):
            others += [self._report_us, self._input_us, self._fire_us]
            others += [None if self._tripped else self._commanded_us + self._fail_safe_us]
        return max(self._now_us, min(other for other in others if other is not None))

    def _move(self) -> None:
        """Move the body up to the present event."""
        dt_s = (self._now_us - self._moved_us) * 1e-6
        if dt_s > 0.0:
            target, within_s = self._wheels()
            self._body.step(dt_s, target, within_s=within_s, rates=None if within_s else self._rates)
            self._moved_us = self._now_us

    def _wheels(self) -> tuple[Twist, float | None]:
        """Return the velocity that the wheels go for, and the time of a stop that is harder than commanded.

        A velocity that was commanded is kept, for wheels that ignore a halt.
        """
        faults = self._faults
        if any(faults.has(kind) for kind in (Reboot, BlockedWheels, MotorFault, StopButton)):
            return STILL, BRAKE_S
        if faults.has(IgnoredHalt) and (self._brake or self._target == STILL):
            return self._driven, None
        if self._brake:
            return STILL, BRAKE_S
        for runaway in faults.all(Runaway):
            return Twist(runaway.v_m_s, runaway.w_rad_s), None
        if self._tripped:
            return STILL, RAMP_S
        self._driven = self._target
        return self._target, None

    def _handle_events(self) -> None:
        """Carry out what is due now: the fail-safe, a firing, reports of axes and bumpers, garbage."""
        now = self._now_us
        if now >= self._commanded_us + self._fail_safe_us:
            self._tripped, self._target = True, STILL
        if self._fire_us is not None and self._fire_us <= now:
            self._fire()
        if self._report_us is not None and self._report_us <= now:
            self._report_us += self._report_period_us
            self._report_axes()
        if self._input_us is not None and self._input_us <= now:
            self._input_us += self._input_period_us
            self._report_bumpers(always=True)
        self._report_bumpers(always=False)
        self._line.add_garbage(now, TICK_US)

    def _fire(self) -> None:
        """Report what was heard since the last firing, and fire the next sonar of each bank."""
        if self._heard is not None:
            self._send(SonarReport(self._clock(), self._heard))
        indices = max(self._rflex.banks)
        sensors = [sensor for sensor, one in enumerate(self._ids) if one % 16 == self._step % indices]
        self._step += 1
        self._heard = self._readings(sensors)
        self._fire_us = self._now_us + self._step_us

    def _readings(self, sensors: list[int]) -> tuple[tuple[int, int], ...]:
        """Fire sonars together and return what they will report: number and raw range of each."""
        body = self._body
        window_m = min(self._config.ring.window_m, 0.5e-6 * self._step_us * SOUND_SPEED_M_S)
        ranges = self._sonar.fire(self._now_us, body.pose, body.ring_yaw, sensors, window_m)
        readings = []
        for sensor, range_m in zip(sensors, ranges, strict=True):
            if range_m is not None:  # else a sonar that reports nothing
                heard = math.isfinite(range_m)
                raw = min(NO_ECHO, round(range_m * self._rflex.range_factor)) if heard else NO_ECHO
                readings.append((self._ids[sensor], raw))
        return tuple(readings)

    def _counts(self) -> tuple[int, int]:
        """Return the counts of both axes before their offsets."""
        body, rflex = self._body, self._rflex
        way_m = body.odometry_m - self._zero_m
        return round(way_m * rflex.distance_factor), round(body.odometry_pose.theta * rflex.angle_factor)

    def _report_axes(self) -> None:
        """Report the axes that the host asked for."""
        twist, rflex, clock = self._body.odometry_twist, self._rflex, self._clock()
        speeds = (round(twist.v * rflex.distance_factor), round(twist.w * rflex.angle_factor))
        factors = (rflex.distance_factor, rflex.angle_factor)
        for axis, count in enumerate(self._counts()):
            if self._mask >> axis & 1:
                position = (count + self._offsets[axis] + _I32 // 2) % _I32 - _I32 // 2
                rate = round(self._rates[axis] * factors[axis])
                self._send(AxisReport(clock, axis, position, speeds[axis], rate & 0xFFFFFFFF))

    def _report_bumpers(self, *, always: bool) -> None:
        """Report the first panel when it changes, and with each period once it has been pressed."""
        is_touched = self._is_touched()
        changed = is_touched != self._was_touched
        if self._rflex.bumpers and self._input_us is not None and (changed or (always and self._has_touched)):
            self._was_touched, self._has_touched = is_touched, True
            self._send(Input(self._clock(), self._rflex.bumpers[0], int(is_touched)))

    def _is_touched(self) -> bool:
        """Return whether a surface touches the base, or a fault presses its bumper."""
        pose = self._body.pose
        if self._touched_at is None or self._touched_at[0] is not pose:
            room_m = clearance(pose.x, pose.y, self._scene.circles, self._scene.segments)
            self._touched_at = (pose, room_m - self._config.body.radius_m < _PRESSED_M)
        return self._touched_at[1] or self._faults.has(Bumper)

    # Faults.

    def _start_fault(self, fault: Fault) -> None:
        """Carry out what a fault does at its start; most act while `_faults` has them."""
        match fault:
            case Reboot():
                self._restart()
            case StopButton():
                self._brake, self._target = True, STILL
            case MotorFault():
                self._target = STILL
            case Deadman():
                self._fail_safe_us = 1000 * fault.deadman_ms
            case OdometryJump():
                heading = self._body.odometry_pose.theta
                self._zero_m -= fault.dx_m * math.cos(heading) + fault.dy_m * math.sin(heading)
                self._body.jump_odometry(fault.dx_m, fault.dy_m, fault.dheading_rad)
            case _:
                pass

    def _restart(self) -> None:
        """Start again with the odometry at zero."""
        self._body.reset_odometry()
        self._boot()

    def _boot(self) -> None:
        """Start as after power-on, except for the body, which stays where it is."""
        body = self._config.body
        self._decoder = Decoder()
        self._brake, self._tripped = True, True
        self._target = self._driven = STILL
        self._rates = (body.acceleration_max_m_s2, body.turn_acceleration_max_rad_s2)
        self._commanded_us = self._booted_us = self._now_us
        self._zero_m, self._offsets = self._body.odometry_m, [0, 0]
        self._mask = self._report_period_us = self._input_period_us = self._step = self._step_us = 0
        self._report_us = self._input_us = self._fire_us = None
        self._heard = None
        self._was_touched = self._has_touched = False
        self._number = 0
        self._line.clear()

    def _clock(self) -> int:
        return (self._clock_start_us + self._faults.clock_us(self._now_us) - self._booted_us) % _I32

    def _send(self, report: Report) -> None:
        self._number = (self._number + 1) % 0x100
        self._number += self._number == 0x1B
        frame = frame_of(report, self._number)
        self._line.send(encode(Frame(frame.port, frame.opcode, frame.data, self._number)), self._now_us)
