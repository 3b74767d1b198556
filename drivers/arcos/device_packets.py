"""The packets of an emulated Pioneer: the SIP, and those that a client asks for beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.device_motion import MotionServo
from drivers.arcos.firmware import Firmware
from drivers.arcos.frames import (
    SIP_MOVING,
    SIP_STOPPED,
    EncoderPacket,
    IoPacket,
    JoystickPacket,
    Packet,
    Sip,
    SipFlags,
    SonarReading,
)
from drivers.emulator.body import Body
from drivers.messages import wrap_angle

SONAR_MAX: Final = 72
"""Most ranges that fit into a SIP."""
COUNTS_PER_TURN: Final = 4096
"""Of a heading."""
_NO_TEMPERATURE: Final = -127
_TICKS_PER_MM: Final = 138
_CENTRE: Final = 512
_AXIS_INPUTS: Final = 8
"""Analog inputs of the IOpac."""


class RequestedPackets:
    """The packets that a client asked for: one, or one with each SIP; and the settings that only SIPs show."""

    def __init__(self) -> None:
        self._asked: dict[int, int] = {}
        """For each request: 0 none, 1 a single packet, above that one with each SIP."""
        self.analog_port = 0
        """The analog port that SIPs show, set by ADSEL."""
        self.digital_out = 0
        """The digital outputs, set by DIGOUT."""

    def obey(self, command: Command) -> bool:
        """Carry out a command for such a packet or setting; return False if it is none."""
        match command.number:
            case CommandNumber.ENCODER | CommandNumber.IOREQUEST | CommandNumber.JOYINFO:
                self._asked[command.number] = max(0, command.value)
            case CommandNumber.ADSEL:
                self.analog_port = command.value & 0xFF
            case CommandNumber.DIGOUT:
                mask, bits = command.two_bytes
                self.digital_out = self.digital_out & ~mask | bits & mask
            case _:
                return False
        return True

    def due(self, body: Body, firmware: Firmware, front: int, rear: int) -> list[Packet]:
        """Return the packets that follow the present SIP; one that was asked for once is not sent again."""
        packets = [self._packet(number, body, firmware, front, rear) for number, left in self._asked.items() if left]
        self._asked = {number: left for number, left in self._asked.items() if left > 1}
        return packets

    def _packet(self, number: int, body: Body, firmware: Firmware, front: int, rear: int) -> Packet:
        """Return the packet that a command of this number asks for."""
        if number == CommandNumber.ENCODER:
            way, half = 1e3 * body.odometry_m, body.odometry_pose.theta / firmware.rad_s_per_mm_s
            left, right = (_signed(round(_TICKS_PER_MM * (way + side * half)), 32) for side in (-1, 1))
            return EncoderPacket(left, right)
        if number == CommandNumber.JOYINFO:
            return JoystickPacket(0, 0, _CENTRE, _CENTRE, 0)
        return IoPacket(bytes((0xFF, front, rear, 0)), bytes((self.digital_out,)), (0,) * _AXIS_INPUTS)


def make_sip(
    body: Body,
    firmware: Firmware,
    settings: RequestedPackets,
    *,
    touched: tuple[int, int, bool],
    battery: int,
    stop: bool,
    arrays: int,
    sonar: Sequence[SonarReading],
    servo: MotionServo,
) -> Sip:
    """Return the SIP.

    Parameters
    ----------
    body
        Odometry and speeds.
    firmware
        Factors.
    settings
        What else clients have set.
    touched
        Pressed segments of the front and the rear bumper, bit k is segment k; and whether the wheels stall.
    battery
        0.1 V.
    stop
        Whether the stop button is pressed.
    arrays
        Bits of the sonar arrays that are on, as in the flags.
    sonar
        The ranges since the last SIP.
    servo
        Whether the motors are enabled, and the goal of the rotation.
    """
    pose, twist = body.odometry_pose, body.twist
    (front, rear, stalled), heading_goal = touched, servo.heading_goal
    half = twist.w / firmware.rad_s_per_mm_s
    left, right = (int((1e3 * twist.v + side * half) / firmware.mm_s_per_count) for side in (-1, 1))
    moving = twist.v != 0.0 or twist.w != 0.0
    flags = arrays | SipFlags.POWER_GOOD
    flags |= SipFlags.MOTORS_ENABLED * servo.enabled | SipFlags.STOP_BUTTON * stop
    return Sip(
        SIP_MOVING if moving else SIP_STOPPED,
        _signed(round(1e3 * pose.x / firmware.mm_per_count), 16),
        _signed(round(1e3 * pose.y / firmware.mm_per_count), 16),
        heading_counts(pose.theta),
        left,
        right,
        battery,
        rear | stalled,
        front | stalled,
        heading_counts(pose.theta if heading_goal is None else heading_goal),
        int(flags),
        0,
        tuple(sonar),
        gripper=0,
        analog_port=settings.analog_port,
        analog=0,
        digital_in=0xFF,
        digital_out=settings.digital_out,
        battery_10=battery,
        charge=0,
        turn_10=round(10.0 * math.degrees(twist.w)),
        fault_flags=0,
        lateral=0,
        temperature=_NO_TEMPERATURE,
        charge_percent=0,
    )


def heading_counts(angle_rad: float) -> int:
    """Return an angle in units of 1/4096 turn, -2048 to 2047."""
    return _signed(round(wrap_angle(angle_rad) / (2.0 * math.pi) * COUNTS_PER_TURN), 12)


def _signed(value: int, bits: int) -> int:
    """Return the lowest `bits` of a number as a signed one."""
    half = 1 << bits - 1
    return (value + half) % (2 * half) - half
