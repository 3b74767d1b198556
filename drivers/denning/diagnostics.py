"""Messages about faults of the robot and its line: what happened, likely cause, next action."""

from __future__ import annotations

import math
from types import MappingProxyType

from config.robot import RobotConfig
from drivers.denning.frames import TENTH_FT_M, VERSION, Ident, NakCode

_RADIUS_TOLERANCE_MM = 1.0
"""The robot reports whole millimetres."""

_COARSENESS, _FINE_M = 1.01, 1e-3
"""Steps of the ranges that are coarser than the robot file's by no more than this matter as little as those up to a
millimetre."""
_NOISE_MIN = 3
"""Fewest corrupt frames that count as noise; one or two are normal where a line starts or ends."""

_MEANINGS = MappingProxyType(
    {
        NakCode.UNKNOWN_TYPE: "it does not know this command",
        NakCode.WRONG_LENGTH: "the command has a length it does not expect",
        NakCode.VALUE_OUT_OF_RANGE: "a value is out of its range",
        NakCode.LATCHED: "it is latched",
    }
)

EXCESS_ECHOES = (
    "the ring sends many more firings than its pattern has, and the excess is dropped; its firmware is faulty, or "
    "another device sends on the line: restart the robot, and check what else is connected"
)


def wrong_robot(ident: Ident, config: RobotConfig) -> str | None:
    """Return the message for a robot that is not the one the robot file describes; None if it is."""
    if not 1 <= ident.version <= VERSION:
        return (
            f"the robot '{ident.name}' speaks version {ident.version} of the protocol and this program versions 1 to "
            f"{VERSION}; update the older one"
        )
    count = len(config.ring.mounts)
    if ident.sensors != count:
        return (
            f"the robot '{ident.name}' has {ident.sensors} sensors and the robot file {count}; "
            f"it is another robot, or [ring] is wrong: correct [ring], or choose the robot's own file"
        )
    radius_m = config.ring.radius_m
    if radius_m is not None and abs(ident.ring_radius_mm - 1e3 * radius_m) > _RADIUS_TOLERANCE_MM:
        return (
            f"the ring of the robot '{ident.name}' has a radius of {ident.ring_radius_mm * 1e-3:.3f} m and the robot "
            f"file says {radius_m:.3f} m; correct ring.radius_m, or choose the robot's own file"
        )
    deadman_s, link = ident.deadman_ms * 1e-3, config.link
    if not link.deadman_min_s <= deadman_s <= link.deadman_max_s:
        return (
            f"the base of the robot '{ident.name}' stops by itself {deadman_s:g} s after the last command, and the "
            f"robot file allows {link.deadman_min_s:g} to {link.deadman_max_s:g} s; correct the deadman in the "
            f"base's configuration, or link.deadman_min_s and link.deadman_max_s"
        )
    return None


def coarse_ranges(ident: Ident, resolution_m: float) -> str | None:
    """Return the message for a robot whose ranges are coarser than the robot file says; None if they are not."""
    unit_m = 1e-6 * ident.range_unit_um if ident.range_unit_um else TENTH_FT_M
    if unit_m <= max(_COARSENESS * resolution_m, _FINE_M):
        return None
    return (
        f"the robot '{ident.name}' speaks version {ident.version} of the protocol and reports ranges in steps of "
        f"{unit_m:.4g} m, and the robot file says ring.resolution_m = {resolution_m:g}: objects seem better known "
        f"than they are; set ring.resolution_m = {unit_m:.4g}, or update the robot to finer steps"
    )


def no_answer(command: str, tries: int, *, frames: int, bad: int, baud: int) -> str:
    """Return the message for a command that stayed unanswered.

    Parameters
    ----------
    command
        Its name in the protocol.
    tries
        How often it was sent.
    frames, bad
        Valid and corrupt frames received on the line so far.
    baud
        The line's speed.
    """
    what = f"no answer to {tries} {command} commands"
    if frames:
        return (
            f"{what} although the robot sends other frames; the line to it is broken or something else reads its "
            f"port: check the cable, and that no other program uses the port"
        )
    if bad:
        return (
            f"{what} and all that is received is corrupt; likely the baud rate: check that the robot is set to "
            f"{baud} baud, or set link.baud"
        )
    return (
        f"{what} and nothing is received; the robot is off, or on another port: check its power and cable, and "
        f"link.port; the connection is restored as soon as it answers"
    )


def silence(silent_s: float, *, others: bool, bad: int) -> str:
    """Return the message for missing odometry.

    Parameters
    ----------
    silent_s
        For how long it has been missing.
    others
        Whether frames of other kinds are still received.
    bad
        Corrupt frames received since the last odometry.
    """
    if (noisy := noise(bad, "it")) is not None:
        return f"no odometry for {silent_s:.2f} s, {noisy}; the connection is restored as soon as frames are valid"
    if others:
        return (
            f"no odometry for {silent_s:.2f} s although the robot sends other frames; its base has stopped working: "
            f"restart the robot"
        )
    return (
        f"nothing received for {silent_s:.2f} s; the robot is off or restarting, or its cable is loose: check its "
        f"power and cable; the connection is restored as soon as it answers"
    )


def noise(bad: int, what: str) -> str | None:
    """Return the message for corrupt frames received in place of `what`; None if they are too few to matter."""
    if bad < _NOISE_MIN:
        return None
    return (
        f"{bad} corrupt frames came in place of {what}: noise on the line, check its cable and shield, and that "
        f"nothing else sends on it"
    )


def not_receiving(unacknowledged_s: float) -> str:
    """Return the message for a robot that sends but does not acknowledge DRIVEs."""
    return (
        f"the robot sends but has not acknowledged a DRIVE for {unacknowledged_s:.2f} s; the line to it is broken or "
        f"its receiver hangs: check the cable, then restart the robot"
    )


def refusal(command: str, code: int) -> str:
    """Return the message for a command that the robot refused with a NAK."""
    meaning = _MEANINGS.get(NakCode(code), "") if code in list(NakCode) else "for a reason this program does not know"
    action = "check that the robot and this program speak the same version of the protocol"
    if code == NakCode.LATCHED:
        action = "remove the cause: free the bumper, or restart the motors after a fault"
    elif code == NakCode.VALUE_OUT_OF_RANGE and command == "PATTERN":
        action = "make ring.firing.step_period_s longer or ring.firing.window_m shorter"
    elif code == NakCode.VALUE_OUT_OF_RANGE and command == "DRIVE":
        action = "lower body.speed_max_m_s and body.turn_max_rad_s to what the robot can do"
    return f"the robot refuses {command} (NAK {code}): {meaning}; {action}"


def odometry_jump(off_m: float, turned_rad: float, ring_rad: float) -> str:
    """Return the message for a jump of the odometry.

    Parameters
    ----------
    off_m
        Distance between the odometry and where the wheels' speeds would have brought the base.
    turned_rad, ring_rad
        The same of the heading and of the ring's direction.
    """
    return (
        f"the odometry jumped by {off_m:.2f} m and {math.degrees(turned_rad):+.0f} degrees, the ring's direction by "
        f"{math.degrees(ring_rad):+.0f}: more than the wheels can have turned; a wheel slipped, or an "
        f"encoder or its counter failed: the jump is removed and the map stays valid; if it happens again, check "
        f"wheels and encoders"
    )


def wrong_clock_rate(error: float) -> str:
    """Return the message for a robot's clock that is too fast, or where `error` is negative too slow."""
    return (
        f"the robot's clock runs {abs(error):.1%} too {'fast' if error > 0.0 else 'slow'}, and its ranges and speeds "
        f"are measured by it, so objects are located wrongly; its oscillator or its configuration is faulty: restart "
        f"the robot, and repair it if this message returns"
    )
