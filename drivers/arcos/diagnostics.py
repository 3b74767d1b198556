"""Messages about faults of a Pioneer and its line: what happened, likely cause, next action."""

from __future__ import annotations

from collections.abc import Collection
from types import MappingProxyType
from typing import Final

from config.files import one_line
from config.robot import RobotConfig
from drivers import line_diagnostics
from drivers.arcos.frames import ConfigPacket, RobotName
from drivers.arcos.handshake import Stage
from drivers.heard_bytes import HeardBytes
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

_CONSTANT: Final = (
    "four_motors", "turn_top", "speed_top", "turn_acceleration_top", "acceleration_top", "pwm_max", "sip_cycle_ms",
    "gripper", "front_sonar", "rear_sonar", "rev_count", "watchdog_ms", "front_bumpers", "rear_bumpers", "charger",
)  # fmt: skip
"""What a robot's configuration holds that stands in its flash, or is how it is built."""
NO_MODEL: Final = (
    "the robot does not say of which model it is, likely it is a simulator: it is taken for that of the robot file; "
    "compare a metre of its odometry with a real one"
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

SONAR_OFF: Final = (
    "the robot reports its sonar as off, and it is switched on again; another client or a switch on the robot may "
    "turn it off: find it if this message returns"
)

STOP_PRESSED: Final = (
    "the STOP button of the robot is pressed, which switches its motors off: release it, then arm again"
)


_UNANSWERED: Final = MappingProxyType(
    {
        Stage.CLOSING: (
            "the robot sends the packets of an open session and does not end it",
            "it receives nothing, or another client holds it open: end the other client, check the line, and press "
            "the robot's reset button",
        ),
        Stage.SYNC1: (
            "the robot answers SYNC0 and not {}",
            "it is in the middle of another client's start, loses packets, or is no Pioneer: end other clients, then "
            "restart it, or its simulator",
        ),
        Stage.CONFIG: (
            "the robot answers the SYNCs, but neither OPEN nor CONFIG",
            "it loses packets or is no Pioneer: check the line, then restart it, or its simulator",
        ),
        Stage.DONE: (
            "the robot answers the SYNCs and opens its session, but sends no odometry within a second",
            "its controller has stopped working, or is set to send it more rarely: restart it, or its simulator, and "
            "set its SIPs to one each 100 ms",
        ),
    }
)


def other_discs(discs: Collection[int]) -> str:
    """Return the message about a robot that measures none of the sonars that its file lists."""
    listed = ", ".join(map(str, sorted(discs)))
    return (
        f"the robot reports sonars, and none of those that the robot file lists, {listed}: name the robot's own "
        f"file, or its numbers of the sonars in arcos.discs"
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
    subclass, known = name.subclass and name.subclass.strip(), config.arcos.subclasses
    if not known or subclass is None or subclass.lower() in {one.lower() for one in known}:
        return None
    shown, models = one_line((name.name or "").strip()), ", ".join(known)
    if not subclass:
        return (
            f"the robot '{shown}' does not say of which model it is, and the robot file is for {models}: the factors "
            f"of its odometry may be others; choose the robot's own file, or, if it is one of these, set "
            f"arcos.subclasses to [], which accepts any"
        )
    return (
        f"the robot '{shown}' is a {one_line(subclass)}, and the robot file is for {models}, whose odometry has "
        f"other factors; choose the robot's own file, or add its subclass to arcos.subclasses"
    )


def traits(packet: ConfigPacket | None, name: RobotName | None) -> tuple[tuple[str, str], ...]:
    """Return what a robot says of itself besides its name that no command changes: names and values.

    They are in its configuration, and in its answer to SYNC2; None where it sent none.
    """
    said = {"class": name and name.class_name, "subclass": name and name.subclass}
    if packet is not None:
        said |= {"serial number": packet.serial}
        said |= {field: getattr(packet, field) for field in _CONSTANT}
    return tuple((key.replace("_", " "), one_line(str(value))) for key, value in said.items() if value is not None)


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


def no_answer(bauds: tuple[int, ...], frames: int, heard: HeardBytes) -> str:
    """Return the message for a robot that does not answer SYNC0.

    It was called at these speeds, none on a line without a speed. So far `frames` valid ones came, and the bytes of
    `heard`.
    """
    tried = f" at {', '.join(map(str, bauds))} baud" if bauds else ""
    return line_diagnostics.no_answer(f"no answer to SYNC0{tried}", frames, heard)


def unanswered(stage: Stage, heard: HeardBytes) -> str:
    """Return the message for a robot that answers, but leaves a later stage of the handshake unanswered."""
    what, remedy = _UNANSWERED.get(stage, _UNANSWERED[Stage.SYNC1])
    what = what.format(stage.value)
    return f"{what}; {remedy}" if heard.stranger is None else f"{what}, and {heard.stranger}"


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
