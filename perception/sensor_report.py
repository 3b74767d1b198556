"""What is wrong with a sensor, in words: what happened, likely cause, next action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

SensorFault: TypeAlias = Literal["failing", "stuck", "silent", "crosstalk"]

STUCK: Final = 1
SILENT: Final = 2
FAILING: Final = 4
CROSSTALK: Final = 8
"""Bits of what is wrong; a sensor may have several, and the gravest is told."""


@dataclass(frozen=True, slots=True)
class SensorReport:
    """What is wrong with a sensor."""

    sensor: int
    fault: SensorFault
    reason: str
    """What happened, likely cause, next action."""


def report(sensor: int, bits: int, stuck_m: float, partners: Sequence[int]) -> SensorReport:
    """Return the report on a sensor.

    Parameters
    ----------
    sensor : int
        Its number.
    bits : int
        What is wrong, not zero.
    stuck_m : float
        What it answers, if it is stuck, m.
    partners : sequence of int
        Whom it fires with where it hears one of them.
    """
    if bits & FAILING:
        return SensorReport(
            sensor,
            "failing",
            f"sensor {sensor} never answers when it should fire, or reports a fault each time: masked; check its "
            f"cable and its board",
        )
    if bits & STUCK:
        return SensorReport(
            sensor,
            "stuck",
            f"sensor {sensor} always answers {stuck_m:.2f} m although the base has moved on: masked; look for "
            f"something that hangs in front of it, then replace it",
        )
    if bits & SILENT:
        return SensorReport(
            sensor,
            "silent",
            f"sensor {sensor} hears nothing where both its neighbours hear echoes: its silence is masked until its "
            f"first echo; check that nothing covers it, then replace it",
        )
    return SensorReport(
        sensor,
        "crosstalk",
        f"sensor {sensor} reads short when it fires together with {', '.join(map(str, partners))} and not otherwise: "
        f"it hears one of them, and is masked in that set; fire them apart (ring.firing)",
    )
