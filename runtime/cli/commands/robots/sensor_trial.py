"""One sensor in `echolocate ring-test`, fired by itself: what is wrong with its ranges, and whether it hears."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from itertools import groupby
from typing import Final, NamedTuple

from config.robot import RingConfig

UNSTEADY_M: Final = 0.1
"""Ranges of a robot that stands still do not spread farther than this, m, apart from a tenth of them at each end."""
ANSWERS_MIN: Final = 0.8
"""Share of the firings that a good sensor answers; no more than the rest may be ranges that it cannot measure."""
REPEATS_MIN: Final = 5
"""Fewest equal ranges that count as always the same."""
FINE_M: Final = 1e-3
STEPS_MIN: Final = 3.0
"""The others' spread must be so many steps of the ranges, of 1 mm at least, that rounding does not explain a sensor
that always says the same."""


class Finding(NamedTuple):
    """What was found out about a sensor, or a motion."""

    is_good: bool
    text: str
    is_shown: bool = True
    """Whether a sensor without a fault has also shown that it hears."""


def judge_sensor(ranges: list[float], rounds: int, ring: RingConfig, unsteadiness: float = 0.0) -> Finding:
    """Return the finding about a sensor.

    Parameters
    ----------
    ranges
        What it reported in so many firings: m, +inf no echo, no faults.
    rounds
        Number of firings.
    ring
        The ring, for what its sensors can measure.
    unsteadiness
        Spread of the ranges of the other sensors, as a share of the range.
    """
    heard = sorted(value for value in ranges if math.isfinite(value))
    if not ranges:
        return Finding(
            is_good=False,
            text="NO ANSWER within its window: check its supply, and its trigger and echo wires; an echo of 5 V "
            "needs a divider to a board's 3.3 V; a waterproof module needs a trigger of 20 µs or more: make "
            "TRIGGER_US in robot_config.py longer; if it answers when something flat is in front of it, it must "
            "report no echo where it hears nothing",
        )
    if len(ranges) < ANSWERS_MIN * rounds:
        return Finding(is_good=False, text=f"answers {len(ranges)} times of {rounds}: check for a loose wire")
    if (wrong := impossible(heard, len(ranges), ring)) is not None:
        return Finding(is_good=False, text=wrong)
    heard = [value for value in heard if value <= ring.range_max_m + _half_step_m(ring)]
    if not heard:
        return Finding(is_good=True, text=f"hears nothing within {ring.range_max_m:g} m", is_shown=False)
    median_m, tenth = statistics.median(heard), len(heard) // 10
    spread_m = heard[-1 - tenth] - heard[tenth]
    text = f"{median_m:.3f} m, {len(heard)} echoes of {len(ranges)}"
    if heard[0] == heard[-1] and len(heard) >= REPEATS_MIN:
        if unsteadiness * median_m > STEPS_MIN * max(ring.resolution_m, FINE_M):
            text = f"STUCK at {median_m:.4f} m, while the ranges of the others vary: check its wires, then replace it"
            return Finding(is_good=False, text=text)
        return Finding(is_good=True, text=f"{text}, always the same", is_shown=False)
    if spread_m > UNSTEADY_M:
        text += f", unsteady by {spread_m:.2f} m: does something move, or does it receive its neighbours?"
        return Finding(is_good=True, text=text)
    return Finding(is_good=True, text=f"{text}, within {spread_m * 1e3:.0f} mm")


def impossible(heard: list[float], count: int, ring: RingConfig) -> str | None:
    """Return the text about ranges that the sensors cannot measure; None if at most a fifth of the firings has any.

    Parameters
    ----------
    heard
        The finite ranges, m, sorted.
    count
        Number of firings.
    ring
        The ring.
    """
    few = (1.0 - ANSWERS_MIN) * count
    zeros = sum(value <= 0.0 for value in heard)
    below = sum(value < ring.range_min_m + _half_step_m(ring) for value in heard)
    if zeros > few:
        return (
            f"ZERO in {zeros} of {count} firings: check the wire of its echo pin; if the sensor reports 0 where it "
            f"hears nothing, its driver must report that as no echo"
        )
    if below > few:
        return (
            f"TOO SHORT, {heard[0]:.4f} m, in {below} of {count} firings, and ring.range_min_m is "
            f"{ring.range_min_m:g}: check that nothing touches it; if it hears something flat in front of it, this "
            f"range stands for nothing, and its driver must report that as no echo; a waterproof module needs a "
            f"trigger of 20 µs or more: make TRIGGER_US in robot_config.py longer; then check its echo wire"
        )
    far = Counter(value for value in heard if value > ring.range_max_m - _half_step_m(ring))
    maximum_m, beyond = max(far.items(), key=lambda item: item[1], default=(0.0, 0))
    # What stands for nothing is one value by itself; the echoes of a wall there are spread about it.
    if beyond > few and beyond == sum(abs(value - maximum_m) < UNSTEADY_M for value in heard):
        return (
            f"AT ITS MAXIMUM, {maximum_m:.3f} m, in {beyond} of {count} firings: it hears nothing and must report "
            f"that as no echo; hold something flat in front of it to see that it hears at all"
        )
    return None


def unsteadiness_of(ranges: list[list[float]], number: int) -> float:
    """Return the median spread of the ranges of all sensors but one, as a share of the range; 0 without any."""
    others = (sorted(filter(math.isfinite, each)) for other, each in enumerate(ranges) if other != number)
    shares = [(each[-1] - each[0]) / each[0] for each in others if len(each) >= REPEATS_MIN and each[0] > 0.0]
    return statistics.median(shares) if shares else 0.0


def not_shown(ring: RingConfig, findings: list[Finding]) -> list[int]:
    """Return the sensors that are not shown to hear, by number; a servo's is by what it hears at one bearing."""
    by_sensor = groupby(zip(ring.sensor_of, findings, strict=True), key=lambda pair: pair[0])
    return [sensor for sensor, of in by_sensor if all(one.is_good and not one.is_shown for _, one in of)]


def sensor_lines(ring: RingConfig, texts: list[str]) -> list[str]:
    """Return a line for each sensor, given the texts of all mounts; one for bearings of a servo that are alike."""
    lines, mounts = [], zip(ring.sensor_of, ring.mounts, texts, strict=True)
    for (sensor, text), of in groupby(mounts, key=lambda each: (each[0], each[2])):
        degrees = [f"{math.degrees(mount.angle_rad):4.0f}" for _, mount, _ in of]
        where = degrees[0] if len(degrees) == 1 else f"{degrees[0]} to {degrees[-1].strip()}"
        lines.append(f"sensor {sensor:2} at {where} degrees: {text}")
    return lines


def _half_step_m(ring: RingConfig) -> float:
    return max(0.5 * ring.resolution_m, 1e-6)
