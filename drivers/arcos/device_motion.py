"""The motion servo of an emulated Pioneer: set-points from commands, and the velocity that follows from them."""

from __future__ import annotations

import math

from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.firmware import Firmware, RampSettings
from drivers.messages import Pose, Twist, wrap_angle

STILL = Twist(0.0, 0.0)
_ARRIVED_M, _ARRIVED_RAD = 1e-3, math.radians(0.2)
"""MOVE and HEAD end this near to their goal."""
_APPROACH_S = 0.1
"""Time constant of the last part of an approach, s."""
_BRAKE_SHARE = 0.8
"""Share of the deceleration that an approach plans with."""


def _approach(left: float, speed_max: float, deceleration: float) -> float:
    """Return the speed at which to cover what is left of a way or turn."""
    fastest = math.sqrt(2.0 * _BRAKE_SHARE * deceleration * abs(left))
    return math.copysign(min(speed_max, fastest, abs(left) / _APPROACH_S), left)


class MotionServo:
    """Set-points of two independent channels, translation and rotation, and the ramps between them.

    `firmware` gives limits, factors, and the ramps at the start.

    Attributes
    ----------
    enabled
        Whether the motors are on. Off, no command moves anything, and no set-point is kept.
    heading_goal
        Goal of HEAD, DHEAD or DCHEAD, rad in odometry; None while the rotation follows a rate.
    ramps
        Accelerations in force.
    speed_mm_s, turn_deg_s
        Maxima in force: of VEL and RVEL, and the speeds of MOVE and HEAD.
    """

    def __init__(self, firmware: Firmware) -> None:
        self._firmware = firmware
        self.enabled = False
        self.ramps = RampSettings(
            firmware.acceleration_mm_s2,
            firmware.acceleration_mm_s2,
            firmware.turn_acceleration_deg_s2,
            firmware.turn_acceleration_deg_s2,
        )
        self.speed_mm_s, self.turn_deg_s = firmware.speed_top_mm_s, firmware.turn_top_deg_s
        self._v = self._w = 0.0
        """Velocities asked for, m/s and rad/s, where there is no goal."""
        self._way_left_m: float | None = None
        """What is left of a MOVE; None without one."""
        self.heading_goal: float | None = None
        self._braking = False
        """An ESTOP is under way: until the base stands, other commands of motion are ignored."""

    def obey(self, command: Command, heading: float) -> bool:
        """Carry out a command of motion at a heading by odometry, rad; return False if it is none."""
        value, number = command.value, command.number
        match number:
            case CommandNumber.ENABLE:
                self.enable(on=value != 0)
            case CommandNumber.STOP:
                self.stop()
            case CommandNumber.ESTOP:
                self.stop()
                self._braking = True
            case CommandNumber.SETV:
                self.speed_mm_s = min(abs(value), self._firmware.speed_top_mm_s)
            case CommandNumber.SETRV:
                self.turn_deg_s = min(abs(value), self._firmware.turn_top_deg_s)
            case CommandNumber.SETA | CommandNumber.SETRA:
                self._set_ramp(value, turning=number == CommandNumber.SETRA)
            case (
                CommandNumber.VEL
                | CommandNumber.RVEL
                | CommandNumber.ROTATE
                | CommandNumber.VEL2
                | CommandNumber.MOVE
                | CommandNumber.HEAD
                | CommandNumber.DHEAD
                | CommandNumber.DCHEAD
            ):
                if self.enabled and not self._braking:
                    self._move(command, heading)
            case _:
                return False
        return True

    def enable(self, *, on: bool) -> None:
        """Switch the motors on or off; neither keeps a set-point."""
        if not (on and self.enabled):
            self.stop()
        self.enabled = on

    def stop(self) -> None:
        """Set both channels to zero."""
        self._v = self._w = 0.0
        self._way_left_m = self.heading_goal = None

    def target(self, heading: float, twist: Twist) -> tuple[Twist, tuple[float, float]]:
        """Return the velocity to go for, and the accelerations towards it, m/s² and rad/s².

        `heading` is that by odometry, rad; `twist` is the present velocity.
        """
        firmware, ramps = self._firmware, self.ramps
        if self._braking:
            self._braking = twist != STILL
            tops = (firmware.acceleration_top_mm_s2, firmware.turn_acceleration_top_deg_s2)
            return STILL, (1e-3 * tops[0], math.radians(tops[1]))
        v, w = self._v, self._w
        if self._way_left_m is not None:
            v = _approach(self._way_left_m, 1e-3 * self.speed_mm_s, 1e-3 * ramps.down)
        if self.heading_goal is not None:
            left = wrap_angle(self.heading_goal - heading)
            w = _approach(left, math.radians(self.turn_deg_s), math.radians(ramps.turn_down))
            w = 0.0 if abs(left) < _ARRIVED_RAD else w
        return Twist(v, w), self.rates(Twist(v, w), twist)

    def rates(self, target: Twist, twist: Twist) -> tuple[float, float]:
        """Return the accelerations from a velocity to another, m/s² and rad/s²."""
        ramps = self.ramps
        slower = abs(target.v) < abs(twist.v) or target.v * twist.v < 0.0
        slower_turn = abs(target.w) < abs(twist.w) or target.w * twist.w < 0.0
        rate, turn_rate = ramps.down if slower else ramps.up, ramps.turn_down if slower_turn else ramps.turn_up
        return 1e-3 * rate, math.radians(turn_rate)

    def moved(self, before: Pose, after: Pose) -> None:
        """Count the way by odometry towards the goal of a MOVE."""
        if self._way_left_m is None:
            return
        direction = 0.5 * (before.theta + after.theta)
        self._way_left_m -= (after.x - before.x) * math.cos(direction) + (after.y - before.y) * math.sin(direction)
        if abs(self._way_left_m) < _ARRIVED_M:
            self._way_left_m = None

    def shift_heading(self, by: float) -> None:
        """Turn the goal with the odometry's frame, which SETO turns."""
        if self.heading_goal is not None:
            self.heading_goal += by

    def _set_ramp(self, value: int, *, turning: bool) -> None:
        """Set the acceleration, or for a value below zero the deceleration; zero changes nothing."""
        ramps, firmware = self.ramps, self._firmware
        top = firmware.turn_acceleration_top_deg_s2 if turning else firmware.acceleration_top_mm_s2
        size = min(abs(value), top)
        if size == 0:
            return
        up, down = (ramps.turn_up, ramps.turn_down) if turning else (ramps.up, ramps.down)
        up, down = (size, down) if value > 0 else (up, size)
        self.ramps = (
            RampSettings(ramps.up, ramps.down, up, down)
            if turning
            else RampSettings(up, down, ramps.turn_up, ramps.turn_down)
        )

    def _move(self, command: Command, heading: float) -> None:
        """Take the set-point of a command of motion; motors must be on. `heading`: by odometry, rad."""
        value = command.value
        match command.number:
            case CommandNumber.VEL:
                self._translate(1e-3 * value)
            case CommandNumber.MOVE:
                self._v, self._way_left_m = 0.0, 1e-3 * value
            case CommandNumber.RVEL | CommandNumber.ROTATE:
                self._rotate(math.radians(value))
            case CommandNumber.VEL2:
                left, right = ((byte + 128) % 256 - 128 for byte in command.two_bytes)
                unit = self._firmware.vel2_mm_s
                self._translate(0.5e-3 * unit * (left + right))
                self._rotate(0.5 * unit * (right - left) * self._firmware.rad_s_per_mm_s)
            case CommandNumber.HEAD:
                self.heading_goal = math.radians(value)
            case CommandNumber.DHEAD:
                self.heading_goal = heading + math.radians(value)
            case _:  # DCHEAD
                goal = heading if self.heading_goal is None else self.heading_goal
                self.heading_goal = goal + math.radians(value)

    def _translate(self, v: float) -> None:
        top = 1e-3 * self.speed_mm_s
        self._v, self._way_left_m = min(top, max(-top, v)), None

    def _rotate(self, w: float) -> None:
        top = math.radians(self.turn_deg_s)
        self._w, self.heading_goal = min(top, max(-top, w)), None
