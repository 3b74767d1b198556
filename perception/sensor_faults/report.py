"""Sensor faults as text for the user: what happened, the likely cause, the next action."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

SensorFault: TypeAlias = Literal["failing", "stuck", "too_near", "silent", "at_maximum", "crosstalk"]

STUCK, SILENT, FAILING, CROSSTALK, TOO_NEAR, AT_MAXIMUM = (1 << bit for bit in range(6))
"""Bits of a sensor's fault word. A sensor may have several faults; the most severe one is reported."""
ODDS_DIGITS_MAX: Final = 12
"""Greater odds say no more: the looks are not independent."""


@dataclass(frozen=True, slots=True)
class SensorReport:
    """A sensor's most severe fault."""

    sensor: int
    fault: SensorFault
    reason: str
    """What happened, the likely cause, the next action."""


def odds(deaf_looks: int, miss_share: float) -> str:
    """Return the odds against a healthy sensor that misses so many looks by chance, as text."""
    digits = math.floor(-deaf_looks * math.log10(max(1e-3, min(0.999, miss_share))))
    return f"10^{digits} to 1" if digits <= ODDS_DIGITS_MAX else f"more than 10^{ODDS_DIGITS_MAX} to 1"


def describe_fault(
    sensor: int, faults: int, stuck_m: float, partners: Sequence[int], deaf_looks: int = 0, miss_share: float = 0.0
) -> SensorReport:
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
    deaf_looks : int
        If it is silent: at how much it has looked since its last echo that others heard from both sides.
    miss_share : float
        The share of such looks that the other sensors miss.
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
            f"something that hangs in front of it, and whether the wheels slip, then replace it",
        )
    if faults & TOO_NEAR:
        return SensorReport(
            sensor,
            "too_near",
            f"sensor {sensor} answers ranges below ring.range_min_m, which it cannot measure: masked; check its "
            f"trigger and supply, and that nothing covers it, or correct range_min_m",
        )
    if faults & SILENT:
        return SensorReport(
            sensor,
            "silent",
            f"sensor {sensor} has heard nothing in {deaf_looks} looks at what other sensors heard there; they miss "
            f"{miss_share:.0%} of such looks, so the odds are {odds(deaf_looks, miss_share)} that it is deaf or "
            f"covered: its silence is masked until its first echo; check that nothing covers it, then replace it",
        )
    if faults & AT_MAXIMUM:
        return SensorReport(
            sensor,
            "at_maximum",
            f"sensor {sensor} answers the greatest range where it hears nothing, as this ring does in all "
            f"directions: taken for silence; let its driver report that as no echo, or check that it hears",
        )
    return SensorReport(
        sensor,
        "crosstalk",
        f"sensor {sensor} reads short when it fires together with {', '.join(map(str, partners))} and not otherwise: "
        f"it hears one of them, and is masked in that set; fire them apart (ring.firing)",
    )
