"""A sensor on a servo in `echolocate ring-test`: whether its servo turns, the right way, and whether it hears.

Its bearings count as sensors, and no others need to hear what one of them hears: so they are judged together.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from config.robot import RingConfig, SensorConfig
from runtime.cli.commands.robots.hand_trial import deaf_text, side_of

ONE_RANGE_STEPS: Final = 3.0
"""Medians of ranges within so many steps, of `FINE_M` at least, are one range."""
FINE_M: Final = 1e-3
BEAMS_MIN: Final = 3.0
"""What a wall or a hand gives is one range over a beam's width; over so many widths it is no surface."""
SIDE_RAD: Final = math.radians(90.0)
"""The second hand is held so far to the left of the first, or where the sweep ends."""
OFF_RAD: Final = math.radians(45.0)
"""A hand is held in its direction to within this, and heard there."""


class HeldHand(NamedTuple):
    """Before which sensor a hand is held, and in which direction from the robot, rad."""

    sensor: int
    angle_rad: float


def hands_before(ring: RingConfig) -> tuple[HeldHand, ...]:
    """Return where hands are held before a ring: ahead of each sensor, and left of one on a servo."""
    if not ring.has_servo:
        return tuple(HeldHand(i, mount.angle_rad) for i, mount in enumerate(ring.mounts))
    hands = []
    for i, sensor in enumerate(ring.sensors or ()):
        middle = math.radians(sensor.angle_deg)
        hands.append(HeldHand(i, middle))
        if sensor.servo:
            hands.append(HeldHand(i, middle + _side_rad(sensor)))
    return tuple(hands)


def stuck_servos(ring: RingConfig, medians: Sequence[float]) -> dict[int, str]:
    """Return the finding about each sensor that hears one range whichever way its servo looks, by sensor.

    Parameters
    ----------
    ring : RingConfig
        The ring.
    medians : sequence of float
        Median range of each bearing, m; +inf or NaN where it hears nothing.
    """
    found, step_m = {}, ONE_RANGE_STEPS * max(ring.resolution_m, FINE_M)
    for i, sensor in enumerate(ring.sensors or ()):
        bearings = _bearings(ring, i)
        heard = [medians[k] for k in bearings if math.isfinite(medians[k])]
        if sensor.servo and _is_wide(ring, bearings, len(heard)) and max(heard) - min(heard) <= step_m:
            found[i] = (
                f"ONE RANGE, {heard[0]:.3f} m, whichever way its servo looks: see whether the servo turns, and check "
                f"its supply and its signal wire; if it turns, check the sensor's wires, then replace it"
            )
    return found


def judge_servo_hands(ring: RingConfig, heard: Sequence[Collection[int]], before: Sequence[float]) -> list[str]:
    """Return what is wrong, a line each; none if each sensor hears each hand where it is.

    Parameters
    ----------
    ring : RingConfig
        The ring.
    heard : sequence of collection of int
        Which bearings heard each of `hands_before`.
    before : sequence of float
        What each bearing heard before, m; +inf for nothing.
    """
    hands, of = hands_before(ring), ring.sensor_of
    lines = []
    for i, sensor in enumerate(ring.sensors or ()):
        by_hand = [(hand.angle_rad, which) for hand, which in zip(hands, heard, strict=True) if hand.sensor == i]
        own = [(angle, [k for k in which if of[k] == i]) for angle, which in by_hand]
        missed = (hand for hand, (_, mine) in zip(by_hand, own, strict=True) if not mine)
        exchanged = ((angle, other) for angle, which in missed for other in _strangers(ring, which, angle))
        if (one := next(exchanged, None)) is not None:
            lines.append(
                f"EXCHANGED: a hand {side_of(one[0])} is heard by sensor {one[1]}, and sensor {i} belongs "
                f"there: exchange their wires, or correct the order of SENSORS or of ring.sensors"
            )
        elif not any(which for _, which in own):
            lines.append(deaf_text(i, own[0][0], min(before[k] for k in _bearings(ring, i))))
        elif sensor.servo and (wrong := _wrong_servo(ring, i, own)) is not None:
            lines.append(wrong)
    return lines


def not_shown_by_hands(ring: RingConfig) -> list[str]:
    """Return what two hands do not show of servos whose sweep is narrow, a line each."""
    lines = []
    for i, sensor in enumerate(ring.sensors or ()):
        bearings = _bearings(ring, i)
        turn = _side_rad(sensor)
        hidden = [
            *(["whether its servo turns"] if turn < OFF_RAD and not _is_wide(ring, bearings, len(bearings)) else []),
            *(["to which side it turns"] if 2.0 * turn < OFF_RAD else []),
        ]
        if sensor.servo and hidden:
            lines.append(
                f"sensor {i}: in its sweep of {sensor.sweep_deg:g} degrees, two hands do not show "
                f"{' or '.join(hidden)}: watch it turn"
            )
    return lines


def _strangers(ring: RingConfig, which: Collection[int], angle_rad: float) -> list[int]:
    """Return which sensors hear a hand although none of their bearings that hear it has it in its beam."""
    of, reach = ring.sensor_of, math.radians(ring.beam_half_angle_deg)
    near = {of[k] for k in which if abs(math.remainder(ring.mounts[k].angle_rad - angle_rad, math.tau)) <= reach}
    return sorted({of[k] for k in which} - near)


def _wrong_servo(ring: RingConfig, sensor: int, own: Sequence[tuple[float, Collection[int]]]) -> str | None:
    """Return what is wrong with the servo of a sensor that hears; None if it looks where it should."""
    mounts, bearings = ring.mounts, _bearings(ring, sensor)
    if any(_is_wide(ring, bearings, len(which)) for _, which in own):
        return (
            f"sensor {sensor} DOES NOT TURN: it hears a hand whichever way its servo should look: check the servo's "
            f"supply and its signal wire, and the pin in SERVOS"
        )
    offs = [_off_rad([mounts[k].angle_rad for k in which], angle) if which else None for angle, which in own]
    ahead, side = offs
    if ahead is None or side is None:
        missed = own[0 if ahead is None else 1][0]
        return (
            f"sensor {sensor} DOES NOT HEAR a hand {side_of(missed)}, and another one it does: its servo does not "
            f"get there: correct its two pulses and its degrees in SERVOS"
        )
    turn = own[1][0] - own[0][0]
    if max(abs(ahead), abs(side)) < OFF_RAD:
        return None
    if abs(ahead) < OFF_RAD and abs(math.remainder(side + 2.0 * turn, math.tau)) < OFF_RAD:
        return (
            f"MIRRORED: the servo of sensor {sensor} turns to the right for what is to the left: make its second "
            f"pulse in SERVOS as much shorter than the first as it is longer now"
        )
    degrees = abs(math.degrees(ahead))
    if abs(math.remainder(side - ahead, math.tau)) < OFF_RAD:
        return (
            f"TURNED: sensor {sensor} looks {degrees:.0f} degrees away from where it should: turn its arm on the "
            f"servo, or correct the pulses in SERVOS"
        )
    return (
        f"sensor {sensor}: a hand {side_of(own[0][0])} is heard {degrees:.0f} degrees and one {side_of(own[1][0])} "
        f"{abs(math.degrees(side)):.0f} degrees away from there: correct its two pulses in SERVOS"
    )


def _bearings(ring: RingConfig, sensor: int) -> list[int]:
    """Return the mounts of a sensor, one for each bearing of its servo."""
    return [k for k, of in enumerate(ring.sensor_of) if of == sensor]


def _side_rad(sensor: SensorConfig) -> float:
    """Return how far to the left of the middle of a sweep its second hand is held, rad."""
    return min(0.5 * math.radians(sensor.sweep_deg), SIDE_RAD)


def _is_wide(ring: RingConfig, bearings: Sequence[int], heard: int) -> bool:
    """Return whether so many bearings of a servo span more than one surface or one hand does."""
    angles = [ring.mounts[k].angle_rad for k in bearings]
    step = max((abs(math.remainder(b - a, math.tau)) for a, b in pairwise(angles)), default=0.0)
    return heard * step > BEAMS_MIN * 2.0 * math.radians(ring.beam_half_angle_deg)


def _off_rad(angles: Sequence[float], asked: float) -> float:
    """Return how far the mean of directions lies from the one asked for, rad."""
    mean = np.exp(1j * np.array(angles)).mean()
    return float(np.angle(mean * np.exp(-1j * asked)))
