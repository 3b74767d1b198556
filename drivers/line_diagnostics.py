"""Messages about faults that a robot of any family may have: what happened, likely cause, next action."""

from __future__ import annotations

from config.robot import LinkConfig
from drivers.heard_bytes import HeardBytes

_NOISE_MIN = 3
"""Fewest corrupt frames that count as noise; one or two are normal where a line starts or ends."""
RECENT_S = 1.0
"""Frames are said to come if the last one is not older than this, s: several of their usual periods."""
_UNFRAMED_MIN = 64
"""Bytes without odometry that count as more than the last echo and a broken frame."""


def deadman_refused(name: str, deadman_s: float, link: LinkConfig) -> str | None:
    """Return the message for a base whose deadman the robot file does not allow; None if it does.

    `deadman_s` is how long the base drives on without a command.
    """
    if link.deadman_min_s <= deadman_s <= link.deadman_max_s:
        return None
    return (
        f"the base of the robot '{name}' stops by itself {deadman_s:g} s after the last command, and the "
        f"robot file allows {link.deadman_min_s:g} to {link.deadman_max_s:g} s; correct the deadman in the "
        f"base's configuration, or link.deadman_min_s and link.deadman_max_s"
    )


def finer_than_line(resolution_m: float, unit_m: float) -> str | None:
    """Return the message for a robot file that promises finer ranges than the line can carry; None if it does not.

    `resolution_m` is that of the robot file, 0 promises nothing; `unit_m` is the step of ranges on the line.
    """
    if resolution_m == 0.0 or resolution_m >= unit_m * (1.0 - 1e-3):
        return None
    return (
        f"ring.resolution_m = {resolution_m:g} is finer than the {unit_m:.4g} m in which this robot's protocol "
        f"counts ranges: objects would seem better known than they are; set ring.resolution_m = {unit_m:.4g}"
    )


def silence(silent_s: float, *, others: bool, bad: int, heard: HeardBytes | None = None) -> str:
    """Return the message for missing odometry.

    It has been missing for `silent_s`, in which `bad` corrupt frames came and, where `others`, valid ones of other
    kinds. `heard` is all bytes since, where the driver keeps them.
    """
    if heard is not None and heard.stranger is not None:
        return f"no odometry for {silent_s:.2f} s, and {heard.stranger}"
    if (noisy := noise(bad, "it")) is not None:
        return f"no odometry for {silent_s:.2f} s, {noisy}; the connection is restored as soon as frames are valid"
    if others:
        return (
            f"no odometry for {silent_s:.2f} s although the robot sends other frames; its base has stopped working: "
            f"restart the robot"
        )
    if heard is not None and heard.total > _UNFRAMED_MIN:
        return (
            f"no odometry for {silent_s:.2f} s, and the {heard.total} bytes received since are no frame; the robot "
            f"restarts, or the line is disturbed: check its power and cable; the connection is restored as soon as "
            f"frames are valid"
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
        f"{bad} corrupt frames came in place of {what}; noise on the line: check its cable and shield, and that "
        f"nothing else sends on it"
    )


def no_answer(what: str, frames: int, heard: HeardBytes) -> str:
    """Return the message for a robot that does not answer a call.

    `what` is the call and how it was made, as "no answer to 3 HELLO commands". `frames` valid ones came lately;
    `heard` knows whether any came before.
    """
    if (stranger := heard.stranger) is not None:
        return f"{what}, and {stranger}"
    if frames:
        return (
            f"{what} although the robot sends other frames; the line to it is broken, or another program reads its "
            f"port: check the cable, and that no other program uses the port; then restart the robot"
        )
    if heard.has_frames:
        return (
            f"{what}, although valid frames of a robot came before; it was switched off since, or loses packets, or "
            f"another program reads its port: check its power and cable, then restart it, or its simulator"
        )
    if heard.total:
        return (
            f"{what}, and what is received is no frame of this protocol; another device is on this port, or the "
            f"line has another speed: check the port and link.baud"
        )
    return (
        f"{what} and nothing is received; the robot is off, or on another port: check its power and cable, and "
        f"link.port; the connection is restored as soon as it answers"
    )
