"""Messages about faults of a robot with an rFLEX controller: what happened, likely cause, next action."""

from __future__ import annotations

from typing import Final

from drivers import line_diagnostics
from drivers.heard_bytes import HeardBytes

BRAKE_STAYS_ON: Final = (
    "the brake stays on although it was released; likely the emergency stop is pressed or the battery is too low: "
    "release it and check its voltage, then arm again"
)

SEVEN_BITS: Final = (
    "no byte of the robot has its eighth bit, so that its ranges and its odometry are wrong; a serial server or a "
    "radio between passes on seven bits: set it to 8 data bits, no parity"
)

NO_SONAR: Final = (
    "no range comes from the sonars, and they are started again; another client may have stopped them, or their "
    "controller has no power: check it if this message returns"
)

NOT_DRIVEN: Final = (
    "no velocity was commanded for a while and the base is stopped; this program was held up: see its log for what "
    "took so long"
)

RESTARTED: Final = (
    "the controller has restarted: its clock or its odometry began at zero again; if it was not switched off, check "
    "its battery"
)

SYNCHRO: Final = (
    "the ring keeps its direction while the wheels turn, and the controller does not report the angle between them: "
    "it is taken as zero, so start and restart this robot with its wheels at their home mark"
)


def fail_safe(seconds: float) -> str:
    """Return the message about the base's own fail-safe, of which the robot file says how long it takes."""
    return (
        f"the controller stops the base by itself when no motion command comes; the robot file gives {seconds:g} s, "
        f"and the controller does not report it: measure it once on blocks, and set rflex.fail_safe_s"
    )


def no_answer(frames: int, heard: HeardBytes) -> str:
    """Return the message for a robot that does not answer, given valid frames and all bytes received so far."""
    if frames and heard.stranger is None:
        return (
            f"no report of both axes and of the brake, though {frames} other frames are received; another device is "
            f"on this port, or the line is disturbed: check the port, link.baud (115200) and the cable"
        )
    return line_diagnostics.no_answer("no answer to the request for reports", frames, heard)


def not_receiving(unanswered_s: float) -> str:
    """Return the message for a robot that sends but answers no request."""
    return (
        f"the robot sends but has not answered a request for its status for {unanswered_s:.2f} s; the line to it is "
        f"broken: check the cable; its fail-safe stops it"
    )


def not_stopping(halting_s: float) -> str:
    """Return the message for a base whose brake does not come on."""
    return (
        f"the base does not report standing with its brake on {halting_s:.1f} s after it was halted, and is halted "
        f"again: stop it by its emergency stop, then check its brake"
    )


def wrong_clock_rate(error: float) -> str:
    """Return the message for timestamps that are too fast, or where `error` is negative too slow."""
    return (
        f"the controller's timestamps run {abs(error):.1%} too {'fast' if error > 0.0 else 'slow'} for microseconds, "
        f"so that ranges are placed wrongly; its firmware counts otherwise or its oscillator is faulty: restart it, "
        f"and report the firmware's version if this message returns"
    )
