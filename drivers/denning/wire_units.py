"""Conversion between the protocol's units and SI: tenths of a foot, millimetres, microseconds."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from config.robot import RingConfig, RobotConfig
from drivers.denning.frames import (
    BEARING_RAD,
    FAULT,
    MASKS_MAX,
    NO_ECHO,
    NO_ECHO_COUNT,
    SENSORS_MAX,
    SWEEPS_MAX,
    TENTH_FT_M,
    TENTHS_MIN,
    VERSION,
    WINDOW_MAX,
    WINDOW_MIN,
    Echo,
    Echo2,
    Echo3,
    Ident,
    Odom,
    Sweep,
)
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError, cross_pairs, firing_pattern, sensor_masks, sensors
from drivers.messages import CrossPaths, Flags, Floats, Identity, Odometry, Pose, Twist
from drivers.servo_views import ServoViews

_ROUNDING = 1e-6
"""Slack before rounding up or down, in units of the protocol, for decimal fractions that float64 cannot hold."""
_STEP_MAX_MS = 0xFFFF
_I16_MAX = 0x7FFF
_FLAGS = tuple(map(Flags, range(0x20)))
"""The base's status by its bits on the wire."""


class WirePattern(NamedTuple):
    """The payload of a PATTERN."""

    step_period_ms: int
    window: int
    masks: tuple[int, ...]


def wire_pattern(ring: RingConfig) -> WirePattern:
    """Return the ring's firing pattern in the protocol's units.

    The step is rounded up to whole milliseconds and the window down to whole tenths of a foot, so that a step stays
    long enough for its window.

    Raises
    ------
    FiringError
        The ring cannot carry out the pattern, or the protocol cannot express it.
    """
    pattern, masks = firing_pattern(ring), sensor_masks(ring)
    if ring.sensor_count > SENSORS_MAX:
        raise FiringError(
            f"ring: {ring.sensor_count} sensors, and this robot's protocol supports at most {SENSORS_MAX}; "
            f"describe the ring that the robot has"
        )
    if len(masks) > MASKS_MAX:
        raise FiringError(
            f"ring.firing: {len(masks)} firings before the pattern repeats, and this robot holds "
            f"{MASKS_MAX}; use fewer sets or rotations"
        )
    window = math.floor(pattern.window_m / TENTH_FT_M + _ROUNDING)
    if not WINDOW_MIN <= window <= WINDOW_MAX:
        raise FiringError(
            f"ring.firing: a window of {pattern.window_m:g} m, and this robot listens for "
            f"{WINDOW_MIN * TENTH_FT_M:.4f} to {WINDOW_MAX * TENTH_FT_M:.4f} m; "
            f"set window_m (or ring.range_max_m) accordingly"
        )
    step_ms = math.ceil(pattern.step_period_s * 1e3 - _ROUNDING)
    if step_ms > _STEP_MAX_MS:  # pragma: no cover - the schema's own limit is below
        raise FiringError(f"ring.firing: step_period_s {pattern.step_period_s:g}, and this robot's longest is 65.535")
    return WirePattern(step_ms, window, masks)


def wire_scan(ring: RingConfig) -> tuple[Sweep, ...]:
    """Return the scans of the ring's servos, in the protocol's units; none without servos.

    Raises
    ------
    FiringError
        They are more than the protocol has room for.
    """
    sweeps = []
    for number, sensor in enumerate(ring.sensors or ()):
        if sensor.servo:
            first, second = (mount.angle_rad / BEARING_RAD for mount in sensor.views[:2])
            start = round(math.remainder(first, math.tau / BEARING_RAD))
            sweeps.append(Sweep(number, start, round(second - first), sensor.bearings, int(sensor.is_endless)))
    if len(sweeps) > SWEEPS_MAX:
        raise FiringError(f"ring.sensors: {len(sweeps)} servos, and this robot turns at most {SWEEPS_MAX}; use fewer")
    return tuple(sweeps)


def sweep_bearing(sweep: Sweep, number: int) -> int:
    """Return the bearing of a servo after so many firings of its sensor, in the protocol's units."""
    count = sweep.bearings
    k = number % count if sweep.endless else number % (2 * count - 2)
    turned = (sweep.first + sweep.step * min(k, 2 * count - 2 - k if not sweep.endless else k)) * BEARING_RAD
    return round(math.remainder(turned, math.tau) / BEARING_RAD)


def newest_version(config: RobotConfig) -> int:
    """Return the newest version of the protocol to speak with the robot.

    Raises
    ------
    DriverError
        The robot file names one that does not exist.
    """
    version = config.robot.protocol or VERSION
    if version > VERSION:
        raise DriverError(
            f"robot.protocol = {version}: this driver speaks versions 1 to {VERSION}; correct the number"
        )
    return version


def emulated_version(config: RobotConfig) -> int:
    """Return the newest version of the protocol that the emulated robot speaks.

    It is the one that the robot file names, or else 1 if that can express the ring and its firing pattern.

    Raises
    ------
    DriverError
        The robot file names one that does not exist.
    """
    version, ring = newest_version(config), config.ring
    in_tenths = ring.resolution_m >= TENTH_FT_M - _ROUNDING
    is_plain = in_tenths and ring.sensor_count == SENSORS_MAX and not (ring.firing.has_listeners or ring.has_servo)
    return 1 if config.robot.protocol is None and is_plain else version


def range_unit_um(ring: RingConfig) -> int:
    """Return the range unit of an emulated ring, µm: its resolution, or the finest whose counts reach its range."""
    return min(0xFFFF, max(_finest_um(ring), round(1e6 * ring.resolution_m)))


def finest_range_m(ring: RingConfig, version: int) -> float:
    """Return the finest step in which a version of the protocol counts this ring's ranges, m."""
    return TENTH_FT_M if version == 1 else 1e-6 * _finest_um(ring)


def _finest_um(ring: RingConfig) -> int:
    return math.ceil(1e6 * ring.range_max_m / (NO_ECHO_COUNT - 1))


def to_wire(value: float, limit: float) -> int:
    """Return a velocity, m/s or rad/s, as signed 16-bit thousandths, within ±`limit` even after rounding."""
    most = min(_I16_MAX, math.floor(limit * 1e3 + _ROUNDING))
    clamped = max(-limit, min(limit, value))  # before scaling: a huge number times a thousand is infinite
    return max(-most, min(most, round(clamped * 1e3)))


def identity_of(ident: Ident) -> Identity:
    """Return the robot's description of itself in SI."""
    unit_m = 1e-6 * ident.range_unit_um if ident.range_unit_um else TENTH_FT_M
    return Identity(
        name=ident.name,
        sensors=ident.sensors,
        ring_radius_m=ident.ring_radius_mm * 1e-3,
        deadman_s=ident.deadman_ms * 1e-3,
        odometry_period_s=ident.odometry_period_ms * 1e-3,
        boot_id=ident.boot_id,
        traits=(
            ("deadman", f"{ident.deadman_ms} ms"),
            ("period of odometry", f"{ident.odometry_period_ms} ms"),
            ("version of the protocol", str(ident.version)),
            ("steps of the ranges", f"{unit_m:.4g} m"),
            ("capabilities", str(ident.capabilities)),
        ),
    )


def odometry_of(odom: Odom, t_us: int) -> Odometry:
    """Return an odometry sample in SI, given its unwrapped time in µs."""
    return Odometry(
        robot_s=t_us * 1e-6,
        pose=Pose(odom.x_0p1mm * 1e-4, odom.y_0p1mm * 1e-4, odom.heading_1em4rad * 1e-4),
        ring_yaw=odom.ring_yaw_1em4rad * 1e-4,
        twist=Twist(odom.v_mm_s * 1e-3, odom.w_mrad_s * 1e-3),
        flags=_FLAGS[odom.flags & 0x1F],
        last_drive_seq=odom.last_drive_seq,
    )


def ranges_of(echo: Echo | Echo2 | Echo3, views: ServoViews, unit_m: float = TENTH_FT_M) -> Floats:
    """Return the ranges of a firing, one for each of the ring's mounts, m: NaN not fired or faulty, +inf no echo.

    Bits of the mask beyond the ring's sensors are ignored, and so are the readings of sensors that only listened:
    see `cross_paths_of`; and those of a sensor on a servo without its bearing, or at one that is not of its scan.

    `unit_m` is what a count of an ECHO2 or ECHO3 stands for; an ECHO has tenths of a foot.
    """
    bearings: dict[int, int] = {}
    if isinstance(echo, Echo3):
        bearings = dict(zip(sensors(echo.turned), echo.bearings, strict=True))
    if isinstance(echo, Echo):
        mask, values, no_echo, unit_m = echo.mask, echo.tenths_ft, NO_ECHO, TENTH_FT_M
    else:
        mask, no_echo = echo.fired, NO_ECHO_COUNT
        values = echo.counts[: mask.bit_count()]
    ranges, count = [math.nan] * views.count, len(views.on_servo)
    for sensor, value in zip(sensors(mask), values, strict=True):
        if sensor < count and value != FAULT:
            mount = views.mount(sensor, bearings.get(sensor, math.nan) * BEARING_RAD)
            if mount is not None:
                ranges[mount] = math.inf if value == no_echo else value * unit_m
    return np.array(ranges)


def cross_paths_of(echo: Echo | Echo2 | Echo3, axes: tuple[float, ...], unit_m: float) -> CrossPaths | None:
    """Return what the listeners of a firing heard: half paths, m, inf where no echo came.

    None if no listener that works is left, and for an ECHO or ECHO3, which have none.

    Axes are the directions of the ring's sensors, rad; `unit_m` is what a count of an ECHO2 stands for.
    """
    if not isinstance(echo, Echo2) or not echo.heard:
        return None
    counts = dict(zip(sensors(echo.heard), echo.counts[echo.fired.bit_count() :], strict=True))
    heard = [
        (transmitter, listener, math.inf if counts[listener] == NO_ECHO_COUNT else counts[listener] * unit_m)
        for transmitter, listener in cross_pairs(axes, echo.fired, echo.heard)
        if counts[listener] != FAULT
    ]
    if not heard:
        return None
    transmitters, listeners, half_paths_m = zip(*heard, strict=True)
    return CrossPaths(np.array(transmitters), np.array(listeners), np.array(half_paths_m))


def echo_byte(range_m: float | None) -> int:
    """Return the echo byte of a sensor that fired: its range in m, +inf for no echo, None for a fault."""
    if range_m is None:
        return FAULT
    if not math.isfinite(range_m):
        return NO_ECHO
    return min(NO_ECHO, max(TENTHS_MIN, round(range_m / TENTH_FT_M)))


def echo_count(range_m: float | None, unit_um: int) -> int:
    """Return the count of a sensor that fired or listened: its range in m, +inf for no echo, None for a fault."""
    if range_m is None:
        return FAULT
    if not math.isfinite(range_m):
        return NO_ECHO_COUNT
    return min(NO_ECHO_COUNT, max(1, round(1e6 * range_m / unit_um)))
