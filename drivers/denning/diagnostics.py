"""What can be wrong with the robot on the line, in words: what happened, likely cause, next action."""

from __future__ import annotations

import math
from types import MappingProxyType

from config.robot import RobotConfig
from drivers.denning.frames import VERSION, Ident, NakCode

_RADIUS_TOLERANCE_MM = 1.0

_NOISE_MIN = 3
"""So many broken frames and no odometry are a line that is disturbed; one or two are how a line ends."""

_MEANINGS = MappingProxyType(
    {
        NakCode.UNKNOWN_TYPE: "it does not know this command",
        NakCode.WRONG_LENGTH: "the command has a length it does not expect",
        NakCode.VALUE_OUT_OF_RANGE: "a value is out of its range",
        NakCode.LATCHED: "it is latched",
    }
)


def wrong_robot(ident: Ident, config: RobotConfig) -> str | None:
    """Return why the robot that answered is not the one the robot file describes; None where it is."""
    if ident.version != VERSION:
        return (
            f"the robot '{ident.name}' speaks version {ident.version} of the protocol and this program version "
            f"{VERSION}; bring the older one up to date"
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
    return None


def no_answer(command: str, tries: int, *, frames: int, bad: int, baud: int) -> str:
    """Return what to make of `tries` unanswered commands, given the frames heard on the line so far."""
    what = f"the robot left {tries} {command} unanswered"
    if frames:
        return (
            f"{what} although it can be heard; the line to it is broken or something else reads its port: "
            f"check the cable, and that no other program uses the port"
        )
    if bad:
        return (
            f"{what} and what comes from it makes no sense; likely the baud rate: check that the robot is set to "
            f"{baud} baud, or set link.baud"
        )
    return (
        f"{what} and nothing comes from it; it is off, or on another port: check its power and cable, and link.port; "
        f"it is taken up as soon as it answers"
    )


def silence(silent_s: float, *, others: bool, bad: int) -> str:
    """Return what to make of missing odometry.

    Parameters
    ----------
    silent_s
        For how long it has been missing.
    others
        Frames of other kinds still come.
    bad
        Broken frames that came meanwhile.
    """
    if (drowned := noise(bad, "it")) is not None:
        return f"no odometry for {silent_s:.2f} s, {drowned}; it is taken up as soon as it can be understood"
    if others:
        return (
            f"no odometry for {silent_s:.2f} s although the robot sends other things; its base has stopped working: "
            f"restart the robot"
        )
    return (
        f"nothing heard for {silent_s:.2f} s; the robot is off or restarting, or its cable is loose: check its power "
        f"and cable; it is taken up as soon as it answers"
    )


def noise(bad: int, what: str) -> str | None:
    """Return what to make of so many broken frames in place of something; None where that is nothing to speak of."""
    if bad < _NOISE_MIN:
        return None
    return (
        f"{bad} broken frames came in place of {what}: noise on the line drowns what the robot says, check its cable "
        f"and shield, and that nothing else sends on it"
    )


def deafness(untaken_s: float) -> str:
    """Return what to make of DRIVEs that the odometry does not name."""
    return (
        f"the robot can be heard and has not taken a DRIVE for {untaken_s:.2f} s; the line to it is broken or its "
        f"receiver hangs: check the cable, then restart the robot"
    )


def refusal(command: str, code: int) -> str:
    """Return what to make of a NAK."""
    meaning = _MEANINGS.get(NakCode(code), "") if code in list(NakCode) else "for a reason this program does not know"
    action = "check that the robot and this program speak the same version of the protocol"
    if code == NakCode.LATCHED:
        action = "remove what holds it: free the bumper, or restart the motors after a fault"
    elif code == NakCode.VALUE_OUT_OF_RANGE and command == "PATTERN":
        action = "make ring.firing.step_period_s longer or ring.firing.window_m shorter"
    elif code == NakCode.VALUE_OUT_OF_RANGE and command == "DRIVE":
        action = "lower body.speed_max_m_s and body.turn_max_rad_s to what the robot can do"
    return f"the robot refuses {command} (NAK {code}): {meaning}; {action}"


def odometry_jump(off_m: float, turned_rad: float, ring_rad: float) -> str:
    """Return what to make of odometry that leapt by so much, the heading and the ring's direction by so much."""
    return (
        f"the odometry leapt by {off_m:.2f} m and {math.degrees(turned_rad):+.0f} degrees, the ring's direction by "
        f"{math.degrees(ring_rad):+.0f}: farther than the wheels could have turned; a wheel slipped, or an "
        f"encoder or its counter failed: the leap is taken out and the map goes on; if it comes again, check wheels "
        f"and encoders"
    )
