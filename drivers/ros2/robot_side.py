"""The robot's side of the line, made of ROS messages in plain data; without ROS, I/O or a clock.

Ranges and odometry become the frames of the ring-and-base protocol, version 2, and its commands become velocities.
What the base of such a robot lacks is done here: a halt latches, and a velocity ends with its deadman.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from config.robot import RobotConfig
from drivers.denning import frames
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import TENTH_FT_M, Drive, Halt, Hello, Listen, NakCode, Pattern, Release
from drivers.denning.wire_units import wire_pattern
from drivers.messages import Flags, Pose, Twist, wrap_angle
from drivers.ros2.range_meaning import Limits, range_meaning

UNIT_MIN_UM: Final = 200
"""Least unit of a range, µm: with it a count of 16 bits reaches 13 m."""
JUMP_S: Final = 2.0
"""Stamps of the odometry that gain more on this machine's clock have jumped."""
EARLIER_S: Final = 1.0
"""Readings may be this much older than the first odometry."""
STILL_M_S, STILL_RAD_S = 0.01, 0.02
STILL: Final = Twist(0.0, 0.0)
NOTES_MAX: Final = 100
I16: Final = 0x7FFF
NAME: Final = "ROS 2"
UNKNOWN_LIMITS: Final = Limits(math.nan, math.nan)


class RobotSide:
    """A robot of the ring-and-base protocol.

    `boot_id` is a number that no other start has.
    """

    def __init__(self, config: RobotConfig, boot_id: int) -> None:
        self._config, self._boot_id = config, boot_id
        self._sensors = {name: k for k, name in enumerate(config.ros2.frames)}
        self._unit_um = max(UNIT_MIN_UM, round(1e6 * config.ring.resolution_m))
        window_m = TENTH_FT_M * wire_pattern(config.ring).window
        self._limits = Limits(config.ring.range_min_m, min(config.ring.range_max_m, window_m))
        """Of the ring: what lies beyond the window of the protocol, in whole tenths of a foot, is silence."""
        self._radius_mm = round(1e3 * max(math.hypot(mount.x_m, mount.y_m) for mount in config.ring.mounts))
        self._decoder, self._seq = Decoder("host"), 0
        self._out = bytearray()
        """Frames for the host."""
        self._velocities: deque[Twist] = deque(maxlen=1)
        """The newest velocity for the base, until it is taken."""
        self._flags, self._drive_seq, self._drive_s = Flags.NONE, 0, -math.inf
        self._fires = False
        """Whether the host asked for echoes."""
        self._first_s: float | None = None
        """Stamp of the first odometry, the zero of the host's clock; None before it."""
        self._last_s = self._last_host_s = 0.0
        self._heading: float | None = None
        self._group: dict[int, int] = {}
        """Counts of the ranges that make up the next echo, by sensor."""
        self._group_s = 0.0
        """The stamp of the first of them."""
        self._noted: set[str] = set()
        self._notes: list[str] = []

    @property
    def has_odometry(self) -> bool:
        """Whether any odometry has come."""
        return self._first_s is not None

    def take_notes(self) -> list[str]:
        """Return messages for the operator, each once, and remove them."""
        notes, self._notes = self._notes, []
        return notes

    def take_output(self) -> bytes:
        """Return the bytes for the host, and remove them."""
        output = bytes(self._out)
        self._out.clear()
        return output

    def take_velocity(self) -> Twist | None:
        """Return the velocity to send to the base now, None if there is none, and remove it."""
        return self._velocities.pop() if self._velocities else None

    # From the host.

    def receive(self, data: bytes, host_s: float) -> None:
        """Take bytes of the host at a time of this machine's clock, s."""
        for frame in self._decoder.feed(data):
            self._obey(frame, host_s)
        for seq, code in self._decoder.take_rejected():
            self._send(frames.Nak(0, seq, code))

    def tick(self, host_s: float) -> None:
        """Let time pass: end a velocity whose deadman has expired."""
        if host_s - self._drive_s > self._config.ros2.deadman_s and not self._flags & Flags.DEADMAN:
            self._flags |= Flags.DEADMAN
            self._velocities.append(STILL)

    def _obey(self, frame: frames.Frame, host_s: float) -> None:
        """Carry out a frame of the host and answer it; a DRIVE is answered only if it is refused."""
        match frame:
            case Hello() if frame.version != frames.VERSION:
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Hello():
                times = round(1e3 * self._config.ros2.deadman_s), round(1e3 * self._config.ros2.odometry_period_s)
                self._send(
                    frames.Ident(
                        0,
                        frames.VERSION,
                        len(self._config.ring.mounts),
                        self._radius_mm,
                        *times,
                        self._boot_id,
                        NAME,
                        self._unit_um,
                    )
                )
            case Pattern():  # which sensors fire is the robot's own affair
                self._fires = bool(frame.masks)
                self._send(frames.Ack(0, frame.seq))
            case Listen():
                self._send(frames.Nak(0, frame.seq, NakCode.VALUE_OUT_OF_RANGE))
            case Drive() if self._flags & Flags.LATCHED:
                self._send(frames.Nak(0, frame.seq, NakCode.LATCHED))
            case Drive():
                self._drive_seq, self._drive_s = frame.seq, host_s
                self._flags &= ~Flags.DEADMAN
                self._velocities.append(Twist(1e-3 * frame.v_mm_s, 1e-3 * frame.w_mrad_s))
            case Halt():
                self._flags |= Flags.LATCHED
                self._velocities.append(STILL)
                self._send(frames.Ack(0, frame.seq))
            case Release():
                self._flags &= ~Flags.LATCHED
                self._send(frames.Ack(0, frame.seq))

    # From the robot.

    def reading(self, frame: str, range_m: float, stamp_s: float, limits: Limits = UNKNOWN_LIMITS) -> None:
        """Take a range of the sensor with this frame (m), measured at a time of the robot's stamps, s."""
        sensor = self._sensors.get(frame.lstrip("/"))
        if sensor is None:
            self._note(
                f"bad frame: a range is in {frame!a}, which ros2.frames does not list; it is ignored: add it, or run "
                f"`echolocate ros2-robot` again"
            )
            return
        if self._first_s is None or not math.isfinite(stamp_s):
            return
        if self._group and (sensor in self._group or abs(stamp_s - self._group_s) > self._config.ros2.group_s):
            self._send_group()
        if not self._group:
            self._group_s = stamp_s
        self._group[sensor] = self._count(frame, range_m, limits)

    def odometry(self, frame: str, stamp_s: float, pose: Pose, twist: Twist, host_s: float) -> None:
        """Take a sample of the odometry of a frame: pose (m, rad) and velocity at a time of the robot's stamps, s.

        Ignored, with a note, if it is of another frame or not finite. A base that moves although it should stand is
        sent another standstill.
        """
        base = self._config.ros2.base_frame
        if frame.lstrip("/") not in {"", base}:
            self._note(
                f"bad frame: the odometry moves {frame!a}, not ros2.base_frame {base!a}; it is ignored: correct it"
            )
            return
        if not all(map(math.isfinite, (stamp_s, *_numbers(pose), twist.v, twist.w))):
            self._note("the odometry holds a number that is not finite and is ignored; the robot's base is faulty")
            return
        self._check_clock(stamp_s, host_s)
        if self._group and stamp_s - self._group_s > self._config.ros2.group_s:
            self._send_group()
        heading = pose.theta if self._heading is None else self._heading + wrap_angle(pose.theta - self._heading)
        self._heading = heading
        x, y, yaw = round(1e4 * pose.x), round(1e4 * pose.y), round(1e4 * heading)
        v, w = (max(-I16, min(I16, round(1e3 * value))) for value in (twist.v, twist.w))
        self._send(frames.Odom(0, self._time_us(stamp_s), x, y, yaw, yaw, v, w, int(self._flags), self._drive_seq))
        is_moving = abs(twist.v) > STILL_M_S or abs(twist.w) > STILL_RAD_S
        if is_moving and self._flags & (Flags.LATCHED | Flags.DEADMAN):
            self._velocities.append(STILL)  # a single one may have been lost

    def _check_clock(self, stamp_s: float, host_s: float) -> None:
        """Begin anew, as after a restart, if the robot's stamps jumped."""
        if self._first_s is not None:
            gained_s = (stamp_s - self._last_s) - (host_s - self._last_host_s)
            if stamp_s < self._last_s or gained_s > JUMP_S:
                self._notes.append(
                    f"clock jump: the stamps of the odometry went from {self._last_s:.3f} to {stamp_s:.3f} s; the "
                    f"robot or its simulation restarted, or its clock was set: measurements begin anew"
                )
                self._boot_id = self._boot_id % 0xFFFF_FFFF + 1
                self._first_s, self._heading = None, None
                self._group.clear()
        if self._first_s is None:
            self._first_s = stamp_s - EARLIER_S
        self._last_s, self._last_host_s = stamp_s, host_s

    def _count(self, frame: str, value: float, limits: Limits) -> int:
        """Return a range as a count."""
        is_silence = self._config.ros2.zero_is_silence
        meaning = range_meaning(value, self._limits, limits, 1e-6 * self._unit_um, zero_is_silence=is_silence)
        if meaning.oddity is not None:
            self._note(meaning.oddity.value.format(frame=frame, least_m=meaning.least_m), meaning.oddity.name)
        if math.isnan(meaning.range_m):
            return frames.FAULT
        if math.isinf(meaning.range_m):
            return frames.NO_ECHO_COUNT
        return max(1, round(1e6 * meaning.range_m / self._unit_um))

    def _send_group(self) -> None:
        """Send the ranges of a group as an echo; dropped before the host asks for any, or the first odometry."""
        group, self._group = self._group, {}
        if not self._fires or self._first_s is None or self._group_s <= self._first_s:
            return
        mask = sum(1 << sensor for sensor in group)
        counts = tuple(group[sensor] for sensor in sorted(group))
        self._send(frames.Echo2(0, self._time_us(self._group_s), 0, mask, 0, counts))

    def _time_us(self, stamp_s: float) -> int:
        """Return what the host sees as the robot's counter at a time of its stamps."""
        return round(1e6 * (stamp_s - (self._first_s or 0.0))) % 2**32

    def _send(self, frame: frames.RobotFrame) -> None:
        """Queue a frame for the host; one with impossible numbers is noted and dropped."""
        try:
            self._out += encode(frame, self._seq)
        except ValueError as error:
            self._note(f"the robot reports what cannot be: {error}; it is ignored")
            return
        self._seq = (self._seq + 1) % 256

    def _note(self, text: str, kind: str = "") -> None:
        """Keep a message unless the same one, or one of its kind, has been kept before."""
        if (kind or text) not in self._noted and len(self._noted) < NOTES_MAX:
            self._noted.add(kind or text)
            self._notes.append(text)


def _numbers(pose: Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta
