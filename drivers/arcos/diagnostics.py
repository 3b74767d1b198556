"""Messages about faults of a Pioneer and its line: what happened, likely cause, next action."""

from __future__ import annotations

from typing import Final

from config.files import one_line
from config.robot import RobotConfig
from drivers.arcos.frames import ConfigPacket, RobotName
from drivers.line_diagnostics import deadman_refused

WATCHDOG_DEFAULT_S: Final = 2.0
"""The watchdog of the firmware as delivered, s; assumed of a robot that does not report its own."""

RESET: Final = (
    "the robot's controller was reset, by its button or by a fault, and the session begins again; if the button was "
    "not pressed, check its battery"
)

MOTORS_STAY_OFF: Final = (
    "the motors stay off although they were enabled; likely the STOP button is pressed or the battery is too low: "
    "release it and check its voltage, then arm again"
)

NO_CONFIG: Final = (
    "the robot does not report its configuration, so its limits and watchdog are unknown; likely its firmware is "
    "old: the limits of the robot file apply, and a watchdog of 2 s is assumed"
)

BAUD_KEPT: Final = (
    "the robot did not follow to {} baud, and the line stays at {}; likely a radio modem or a server is between: set "
    "link.baud to the speed that works"
)

ODOMETRY_AT_ZERO: Final = (
    "the odometry began at zero again with the new session; poses continue where the robot was last: if it was moved "
    "meanwhile, restart this program"
)

EXCESS_FIRINGS: Final = (
    "the robot sends many more ranges than its sonar can measure, and the excess is dropped; its firmware is faulty, "
    "or another device sends on the line: restart the robot, and check what else is connected"
)

SONAR_OFF: Final = (
    "the robot reports its sonar as off, and it is switched on again; another client or a switch on the robot may "
    "turn it off: find it if this message returns"
)


STOP_PRESSED: Final = (
    "the STOP button of the robot is pressed, which switches its motors off: release it, then arm again"
)


def watchdog_note(deadman_s: float) -> str:
    """Return the message about a base that drives on for long if this program is killed."""
    return (
        f"the base stops by itself only {deadman_s:g} s after the last command: so long does it drive on if this "
        f"program is killed or the line to it breaks; on every fault that the program survives it stops the base at "
        f"once; a shorter watchdog can be set in the robot's flash"
    )


def wrong_robot(name: RobotName, config: RobotConfig) -> str | None:
    """Return the message for a robot of another model than the robot file describes; None if it is one of those."""
    subclass, known = name.subclass, config.arcos.subclasses
    if not known or subclass is None or subclass.lower() in {one.lower() for one in known}:
        return None
    return (
        f"the robot '{one_line(name.name or '')}' is a {one_line(subclass)}, and the robot file is for "
        f"{', '.join(known)}, whose odometry has other factors; choose the robot's own file, or add its subclass to "
        f"arcos.subclasses"
    )


def wrong_watchdog(name: str, packet: ConfigPacket | None, config: RobotConfig) -> str | None:
    """Return the message for a base that does not stop by itself in the time that the robot file allows."""
    watchdog_s = deadman_s(packet)
    if watchdog_s == 0.0:
        return (
            f"the watchdog of the robot '{name}' is off, so that its base never stops by itself; switch it on in the "
            f"robot's flash configuration: {1e3 * WATCHDOG_DEFAULT_S:g} ms is usual"
        )
    return deadman_refused(name, watchdog_s, config.link)


def deadman_s(packet: ConfigPacket | None) -> float:
    """Return the time after which the base stops by itself, s; 0 if it never does."""
    if packet is None or packet.watchdog_ms is None:
        return WATCHDOG_DEFAULT_S
    return 1e-3 * packet.watchdog_ms


def no_answer(*, bauds: tuple[int, ...], heard: int) -> str:
    """Return the message for a robot that does not answer SYNC0.

    Parameters
    ----------
    bauds
        Speeds at which it was called; none on a line without a speed.
    heard
        Bytes received that were no frame.
    """
    tried = f" at {', '.join(map(str, bauds))} baud" if bauds else ""
    if heard:
        return (
            f"no answer to SYNC0{tried}, and what is received is no frame of this protocol; another device is on "
            f"this port, or the line is disturbed: check the port and the cable"
        )
    return (
        f"no answer to SYNC0{tried} and nothing is received; the robot is off, or on another port: check its power "
        f"and cable, and link.port; the connection is restored as soon as it answers"
    )


def not_receiving(unanswered_s: float) -> str:
    """Return the message for a robot that sends but answers no request."""
    return (
        f"the robot sends but has not answered a request for {unanswered_s:.2f} s; the line to it is broken: check "
        f"the cable; its watchdog stops it"
    )


def not_stopping(halting_s: float) -> str:
    """Return the message for a base that moves although it is halted."""
    return (
        f"the base still moves {halting_s:.1f} s after it was halted, and is halted again; it rolls, is pushed or "
        f"does not obey: stop it by its STOP button, then check its motors"
    )
