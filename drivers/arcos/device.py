"""The emulated Pioneer: the robot's side of the protocol, without I/O and in its own time.

It behaves as firmware does and not as the simulators do: motors are off until ENABLE, the watchdog stops the base,
each SIP holds only the ranges measured since the last one, and nothing is sent before OPEN.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np

from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.arcos.codec import Decoder, decode_command, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.device_motion import STILL, MotionServo
from drivers.arcos.device_packets import SONAR_MAX, RequestedPackets, make_sip
from drivers.arcos.device_sonar import SonarArrays, SonarReadings
from drivers.arcos.device_touch import Touch
from drivers.arcos.firmware import Firmware
from drivers.arcos.frames import BAUDS, Packet, ResetNotice, RobotName, SyncEcho
from drivers.arcos.wire_frame_counter import WireFrameCounter
from drivers.driver import DriverError
from drivers.emulator.body import BRAKE_S
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
from drivers.messages import Flags, Twist

TICK_US = 5_000
"""Longest step of the body's simulation, µs."""
PAUSE_MAX_US = 100_000
"""Longest pause inside a packet, µs."""
STALL_US = 200_000
"""The wheels are let go for this long after a stall, µs."""
RESET_NOTICE, MAINTENANCE_NOTICE = 0xFF, 0xFE
BATTERY_FULL, BATTERY_LOW, BATTERY_EMPTY = 126, 110, 107
"""The battery, 0.1 V: full, where it is called low, and nearly empty."""


class Session(Enum):
    """The state of the connection: three synchronising packets lead from one to the next."""

    WAIT = "wait"
    SYNCING = "syncing"
    READY = "ready"
    OPENED = "opened"


class ArcosDevice(EventDevice):
    """A `drivers.emulator.robot_device.RobotDevice` that speaks the protocol of the Pioneer family.

    `firmware` has its names, factors and flash settings.

    Raises
    ------
    DriverError
        The robot file describes a synchro drive.
    """

    # Reset by a restart; see `_boot`.
    _decoder: Decoder[Command]
    _session: Session
    _servo: MotionServo
    _arrays: SonarArrays
    _requested: RequestedPackets
    _sip_us: int | None
    """When the next SIP is due; None outside a session."""
    _watchdog_us: int
    """When the watchdog stops the base, unless a command comes before."""
    _tripped: bool
    """Whether it has stopped it, and no command has come since."""
    _battery: int
    """Voltage, 0.1 V."""

    def __init__(
        self, robot: RobotConfig, world: WorldConfig, firmware: Firmware, seed: int, faults: Sequence[Fault] = ()
    ) -> None:
        if robot.body.synchro:
            raise DriverError("a Pioneer's body turns with its wheels: set body.synchro = false")
        seeds = np.random.SeedSequence(seed).spawn(5)
        sonar_rng, drift_rng, outlier_rng, *line_rngs = map(np.random.default_rng, seeds)
        self._firmware = firmware
        super().__init__(robot, world, faults, firmware.baud, sonar_rng, drift_rng, line_rngs)
        self._touch = Touch(firmware, self._scene, robot.body.radius_m)
        self._heard_us = 0
        """When the host's last bytes came, µs."""
        faulty = FaultySonar(self._true_sonar, len(robot.ring.mounts), self._faults, outlier_rng)
        self._readings = SonarReadings(firmware, faulty, robot.ring.window_m)
        self._watchdog_ms = firmware.watchdog_ms
        """Time without a command after which the base stops; 0: never."""
        self._driven = STILL
        """The last velocity that the wheels went for by command."""
        self._stalled_until_us = 0
        self._boot()

    @property
    def flags(self) -> Flags:
        """The base's status; motors that are off count as latched."""
        front, rear, stalled = self._touched()
        status = {
            Flags.LATCHED: not self._servo.enabled,
            Flags.BUMPER: bool(front or rear),
            Flags.MOTOR_FAULT: stalled,
            Flags.DEADMAN: self._tripped,
            Flags.BATTERY_LOW: self._volts() <= BATTERY_LOW,
        }
        return Flags(sum(flag for flag, is_set in status.items() if is_set))

    def frame_counter(self) -> WireFrameCounter:
        """Return a new counter of this protocol's ranges and velocities, for a line that is in use already."""
        return WireFrameCounter()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host, at the time to which the robot has advanced.

        Every command resets the watchdog, a SYNC, too. The body is moved to the present before it, so that what it
        sets acts from now on.
        """
        if not (data := self._hear(data)):
            return
        # The rest of a packet does not come after a pause: a false length would swallow the next client's SYNCs.
        late = self._decoder.skip() if self._now_us - self._heard_us > PAUSE_MAX_US else []
        self._heard_us = self._now_us
        for command in (*late, *self._decoder.feed(data)):
            self._move()
            self._watchdog_us = self._now_us + 1000 * self._watchdog_ms
            self._tripped = False
            self._take(command)

    # Commands of the host.

    def _take(self, command: Command) -> None:
        """Obey a command as the state of the connection has it.

        In READY, OPEN has the bytes of SYNC1. In WAIT, SYNC2 has those of the CLOSE with which a client ends what an
        earlier one may have left: it expects no answer, and would take one for that to its SYNC0.
        """
        if self._session is Session.OPENED:
            self._obey(command)
        elif command.number == CommandNumber.OPEN and self._session is Session.READY:
            self._open()
        elif command.argument is None and command.number in (0, 1):
            self._session = Session.SYNCING
            self._send(SyncEcho(command.number))
        elif command.argument is None and command.number == 2 and self._session is not Session.WAIT:
            self._session = Session.READY
            self._send(RobotName(self._firmware.name, self._firmware.class_name, self._firmware.subclass))

    def _open(self) -> None:
        """Begin a session: the odometry and the arrays start anew, and the first SIP comes after one cycle."""
        self._session = Session.OPENED
        self._body.reset_odometry()
        self._arrays = SonarArrays(self._firmware.sensor_numbers, self._arrays.cycle_us // 1000)
        self._arrays.start(self._now_us)
        self._readings.clear()
        self._requested = RequestedPackets()
        self._sip_us = self._now_us + 1000 * self._firmware.sip_cycle_ms

    def _close(self) -> None:
        """End the session: motors off, no more packets, and the speed of the line as after power-on."""
        self._session = Session.WAIT
        self._sip_us = None
        self._servo.enable(on=False)
        self._arrays = SonarArrays(self._firmware.sensor_numbers, self._arrays.cycle_us // 1000)
        self._line.set_baud(self._firmware.baud, self._now_us)

    def _obey(self, command: Command) -> None:
        """Carry out a command of an open session; unknown ones are ignored, and ENABLE while motors cannot go on."""
        heading = self._body.odometry_pose.theta
        refused = command.number == CommandNumber.ENABLE and self._is_off()
        if refused or self._servo.obey(command, heading) or self._requested.obey(command):
            return
        match command.number:
            case CommandNumber.CLOSE:
                self._close()
            case CommandNumber.POLLING:
                self._arrays.poll(command.argument if isinstance(command.argument, bytes) else b"")
            case CommandNumber.SONAR:
                self._arrays.switch(command.value)
            case CommandNumber.SONARCYCLE:
                self._arrays.set_cycle(command.value)
            case CommandNumber.SETO:
                self._servo.shift_heading(-heading)
                self._body.reset_odometry()
            case CommandNumber.BUMPSTALL:
                self._touch.stalls_at = command.value
            case CommandNumber.HOSTBAUD if 0 <= command.value < len(BAUDS):
                self._line.set_baud(BAUDS[command.value], self._now_us)
            case CommandNumber.CONFIG:
                servo = self._servo
                self._send(
                    self._firmware.config_packet(servo.speed_mm_s, servo.turn_deg_s, self._watchdog_ms, servo.ramps)
                )
            case CommandNumber.BATTEST:
                self._battery = command.value or BATTERY_FULL
            case CommandNumber.RESET | CommandNumber.MAINTENANCE:
                self._restart(RESET_NOTICE if command.number == CommandNumber.RESET else MAINTENANCE_NOTICE)

    # Events.

    def _next_us(self) -> int:
        """Return the time of the next event, µs: a step of the body, a fault, a SIP, a firing or the watchdog."""
        next_us = self._moved_us // TICK_US * TICK_US + TICK_US
        others = [self._faults.next_us]
        if self._session is Session.OPENED and not self._faults.has(Reboot):
            others += [self._sip_us, self._arrays.next_us]
            others += [None if self._tripped or not self._watchdog_ms else self._watchdog_us]
        return max(self._now_us, min([next_us, *(other for other in others if other is not None)]))

    def _move(self) -> None:
        """Move the body up to the present event."""
        dt_s = (self._now_us - self._moved_us) * 1e-6
        if dt_s <= 0.0:
            return
        body, before = self._body, self._body.odometry_pose
        target, rates = self._wheels()
        within_s = BRAKE_S if rates is None else None
        if body.step(dt_s, target, within_s=within_s, rates=rates):
            self._stalled_until_us = self._now_us + STALL_US
        self._moved_us = self._now_us
        if body.odometry_pose is not before:
            self._servo.moved(before, body.odometry_pose)

    def _wheels(self) -> tuple[Twist, tuple[float, float] | None]:
        """Return the velocity that the wheels accelerate towards, and the accelerations; None for a hard brake.

        A velocity that was commanded is kept, for wheels that ignore a halt.
        """
        faults, servo, twist = self._faults, self._servo, self._body.twist
        if faults.has(Reboot) or faults.has(BlockedWheels) or self._is_off():
            return STILL, None
        if self._moved_us < self._stalled_until_us:
            return STILL, None
        if not servo.enabled and not faults.has(IgnoredHalt):
            return STILL, None
        for runaway in faults.all(Runaway):
            target = Twist(runaway.v_m_s, runaway.w_rad_s)
            return target, servo.rates(target, twist)
        target, rates = servo.target(self._body.odometry_pose.theta, twist)
        if self._tripped:
            target, rates = STILL, servo.rates(STILL, twist)
        if faults.has(IgnoredHalt) and target == STILL:
            return self._driven, servo.rates(self._driven, twist)
        self._driven = target
        front, rear, _ = self._touched()
        if self._touch.blocks(target.v, front, rear):
            return STILL, None
        return target, rates

    def _handle_events(self) -> None:
        """Carry out what is due now: the watchdog, firings, a SIP, garbage on the line."""
        now = self._now_us
        if self._session is Session.OPENED:
            if self._watchdog_ms and now >= self._watchdog_us:
                self._tripped = True
            self._readings.fire(self._arrays.fire(now), now, self._arrays.cycle_us, self._body)
            if self._sip_us is not None and self._sip_us <= now:
                self._sip_us += 1000 * self._firmware.sip_cycle_ms
                self._report()
        self._line.add_garbage(now, TICK_US)

    def _report(self) -> None:
        """Send a SIP with the ranges heard since the last one, and the packets that go with it."""
        touched = self._touched()
        known = self._readings.take(self._now_us)
        sip = make_sip(
            self._body,
            self._firmware,
            self._requested,
            touched=touched,
            battery=self._volts(),
            stop=self._faults.has(StopButton),
            arrays=self._arrays.flags,
            sonar=known[-SONAR_MAX:],
            servo=self._servo,
        )
        for packet in (sip, *self._requested.due(self._body, self._firmware, *touched[:2])):
            self._send(packet)

    def _volts(self) -> int:
        """Return the battery's voltage, 0.1 V."""
        return BATTERY_EMPTY if self._faults.has(LowBattery) else self._battery

    def _touched(self) -> tuple[int, int, bool]:
        """Return the pressed segments of the front and rear bumper as bits from 1 on, and whether wheels stall."""
        front, rear = self._touch.pressed(self._body.pose)
        if self._faults.has(Bumper):
            front |= self._touch.middle
        blocked = self._touch.blocks(self._driven.v, front, rear)
        stalled = self._now_us < self._stalled_until_us or self._faults.has(MotorFault) or blocked
        return front, rear, stalled

    # Faults.

    def _is_off(self) -> bool:
        """Return whether the motors cannot be switched on."""
        return self._faults.has(MotorFault) or self._faults.has(StopButton)

    def _start_fault(self, fault: Fault) -> None:
        """Carry out what a fault does at its start; most act while `_faults` has them."""
        match fault:
            case Reboot():
                self._boot()
            case MotorFault() | StopButton():
                self._servo.enable(on=False)
            case Deadman():
                self._watchdog_ms = fault.deadman_ms
                self._watchdog_us = self._now_us + 1000 * self._watchdog_ms
            case OdometryJump():
                self._body.jump_odometry(fault.dx_m, fault.dy_m, fault.dheading_rad)

    def _restart(self, notice: int = RESET_NOTICE) -> None:
        """Start again as after the reset button, and say so."""
        self._body.reset_odometry()
        self._boot()
        self._send(ResetNotice(notice))

    def _boot(self) -> None:
        """Start as after power-on, except for the body, which stays where it is."""
        firmware = self._firmware
        self._decoder = Decoder(decode_command)
        self._session = Session.WAIT
        self._servo = MotionServo(firmware)
        self._arrays = SonarArrays(firmware.sensor_numbers, firmware.sonar_cycle_ms)
        self._requested = RequestedPackets()
        self._readings.clear()
        self._sip_us = None
        self._watchdog_us = self._now_us + 1000 * self._watchdog_ms
        self._tripped = False
        self._battery = BATTERY_FULL
        self._line.clear()
        self._line.set_baud(firmware.baud, self._now_us)

    def _send(self, packet: Packet) -> None:
        self._line.send(encode(packet), self._now_us)
