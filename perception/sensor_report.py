"""Sensor faults as text for the user: what happened, the likely cause, the next action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

SensorFault: TypeAlias = Literal["failing", "stuck", "too_near", "silent", "crosstalk"]

STUCK: Final = 1
SILENT: Final = 2
FAILING: Final = 4
CROSSTALK: Final = 8
TOO_NEAR: Final = 16
"""Bits of a sensor's fault word. A sensor may have several faults; the most severe one is reported."""


@dataclass(frozen=True, slots=True)
class SensorReport:
    """A sensor's most severe fault."""

    sensor: int
    fault: SensorFault
    reason: str
    """What happened, the likely cause, the next action."""


def describe_fault(sensor: int, faults: int, stuck_m: float, partners: Sequence[int]) -> SensorReport:
    """Return the report on a sensor with at least one fault.

    Parameters
    ----------
    sensor : int
        Index of the sensor in the ring.
    faults : int
        The sensor's fault bits, not zero.
    stuck_m : float
        The range it repeats if it is stuck, m.
    partners : sequence of int
        The sensors that fire in the sets in which it is masked for crosstalk.
    """
    if faults & FAILING:
        return SensorReport(
            sensor,
            "failing",
            f"sensor {sensor} never answers when it should fire, or reports a fault each time: masked; check its "
            f"cable and its board",
        )
    if faults & STUCK:
        return SensorReport(
            sensor,
            "stuck",
            f"sensor {sensor} always answers {stuck_m:.2f} m although the base has moved on: masked; look for "
            f"something that hangs in front of it, then replace it",
        )
    if faults & TOO_NEAR:
        return SensorReport(
            sensor,
            "too_near",
            f"sensor {sensor} answers ranges far below ring.range_min_m, which it cannot measure: masked; check its "
            f"trigger and supply, and that nothing covers it, or correct range_min_m",
        )
    if faults & SILENT:
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
