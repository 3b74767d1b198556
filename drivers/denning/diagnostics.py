"""Messages about faults of the robot and its line: what happened, likely cause, next action."""

from __future__ import annotations

from types import MappingProxyType

from config.robot import RobotConfig
from drivers import line_diagnostics
from drivers.denning.frames import CAN_LISTEN, HAS_SERVOS, TENTH_FT_M, VERSION, Ident, NakCode, Sweep
from drivers.heard_bytes import HeardBytes
from drivers.line_diagnostics import deadman_refused

_RADIUS_TOLERANCE_MM = 1.0
"""The robot reports whole millimetres."""

_COARSENESS, _FINE_M = 1.01, 1e-3
"""Steps of the ranges that are coarser than the robot file's by no more than this matter as little as those up to a
millimetre."""
_MEANINGS = MappingProxyType(
    {
        NakCode.UNKNOWN_TYPE: "it does not know this command",
        NakCode.WRONG_LENGTH: "the command has a length it does not expect",
        NakCode.VALUE_OUT_OF_RANGE: "a value is out of its range",
        NakCode.LATCHED: "it is latched",
    }
)


def wrong_robot(ident: Ident, config: RobotConfig) -> str | None:
    """Return the message for a robot that is not the one the robot file describes; None if it is."""
    if not 1 <= ident.version <= VERSION:
        return (
            f"the robot '{ident.name}' speaks version {ident.version} of the protocol and this program versions 1 to "
            f"{VERSION}; update the older one"
        )
    count = config.ring.sensor_count
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
    return deadman_refused(ident.name, ident.deadman_ms * 1e-3, config.link)


def two_robots(ident: Ident) -> str:
    """Return the message for two robots that answer the same HELLO."""
    return (
        f"two robots answer on this line, one of them as '{ident.name}': both would obey each command; disconnect "
        f"one of them"
    )


def cannot_listen(ident: Ident, listeners: tuple[int, ...]) -> str | None:
    """Return the message for a robot whose sensors cannot listen as the firing pattern asks; None if they can."""
    if not any(listeners) or (ident.version > 1 and ident.capabilities & CAN_LISTEN):
        return None
    why = "cannot listen" if ident.version > 1 else "speaks version 1 of the protocol, which has no listeners"
    return (
        f"the firing pattern asks sensors to listen while others fire, and the robot '{ident.name}' {why}; remove "
        f"ring.firing.listen_preset or listen, or choose the robot's own file"
    )


def cannot_turn(ident: Ident, sweeps: tuple[Sweep, ...]) -> str | None:
    """Return the message for a robot without the servos that the robot file has; None if it has servos."""
    if not sweeps or (ident.version > 1 and ident.capabilities & HAS_SERVOS):
        return None
    return (
        f"the robot file has {len(sweeps)} sensors on servos, and the robot '{ident.name}' knows no servos; flash "
        f"the firmware of `echolocate firmware` with SERVOS, or remove servo = true from ring.sensors"
    )


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


def no_answer(command: str, tries: int, frames: int, heard: HeardBytes) -> str:
    """Return the message for a command that stayed unanswered.

    So far `frames` valid ones came on the line, and the bytes of `heard`.
    """
    return line_diagnostics.no_answer(f"no answer to {tries} {command} commands", frames, heard)


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
        action = (
            "make ring.firing.step_period_s longer or ring.firing.window_m shorter, or fire only sensors together "
            "that the robot's wiring can"
        )
    elif command == "LISTEN":
        action = "remove ring.firing.listen_preset or listen, or let only sensors listen that the robot's wiring can"
    elif command == "SCAN":
        action = (
            "make the sweeps of ring.sensors such that the robot's servos reach them, or correct SERVOS on the board"
        )
    elif code == NakCode.VALUE_OUT_OF_RANGE and command == "DRIVE":
        action = "lower body.speed_max_m_s and body.turn_max_rad_s to what the robot can do"
    return f"the robot refuses {command} (NAK {code}): {meaning}; {action}"


def wrong_clock_rate(error: float) -> str:
    """Return the message for a robot's clock that is too fast, or where `error` is negative too slow."""
    return (
        f"the robot's clock runs {abs(error):.1%} too {'fast' if error > 0.0 else 'slow'}, and its ranges and speeds "
        f"are measured by it, so objects are located wrongly; its oscillator or its configuration is faulty: restart "
        f"the robot, and repair it if this message returns"
    )
