"""The choice among the free valleys: candidate directions, and their costs (VFH+).

All directions are counted in sectors, as fractions of which they may be, so that a free target is met exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from behaviors.valley.polar_histogram import SECTORS
from config.behaviors import FollowValleyConfig

HALF_TURN: Final = SECTORS // 2


def apart(a: float, b: float) -> float:
    """Return the angle between two directions, in sectors."""
    return abs((a - b + HALF_TURN) % SECTORS - HALF_TURN)


def valleys(blocked: bytes) -> list[tuple[int, int]]:
    """Return the runs of free sectors: the first one, and their number.

    Parameters
    ----------
    blocked : bytes
        A byte for each sector, 0 where it is free.
    """
    begin = blocked.find(1)
    if begin < 0:
        return [(0, SECTORS)]
    turned = blocked[begin:] + blocked[:begin] + b"\1"
    found, at = [], turned.find(0)
    while at >= 0:
        end = turned.find(1, at)
        found.append(((at + begin) % SECTORS, end - at))
        at = turned.find(0, end)
    return found


def candidates(blocked: bytes, target: float, wide: float) -> list[float]:
    """Return the directions to choose from: of a narrow valley its middle, of a wide one its sides and the target.

    Parameters
    ----------
    blocked : bytes
        A byte for each sector, 0 where it is free.
    target : float
        The direction of the target, in sectors.
    wide : float
        A valley of so many sectors is wide; its sides are driven at half of that from the border.
    """
    found: list[float] = []
    for first, count in valleys(blocked):
        if count == SECTORS:
            return [target]
        if count < wide:
            found.append((first + 0.5 * (count - 1)) % SECTORS)
            continue
        found += [(first + 0.5 * wide - 0.5) % SECTORS, (first + count - 0.5 * wide - 0.5) % SECTORS]
        if (target - first) % SECTORS <= count - 1:
            found.append(target)
    return found


def gaps(closed: bytes, blocked: bytes) -> list[float]:
    """Return the middles of the valleys that the robot just passes, and nowhere with the room that it wants.

    Parameters
    ----------
    closed : bytes
        A byte for each sector, 0 where the robot just passes.
    blocked : bytes
        The same, 0 where it passes with the room that it wants.
    """
    just = [(first, count) for first, count in valleys(closed) if count < SECTORS]
    return [
        (first + 0.5 * (count - 1)) % SECTORS
        for first, count in just
        if all(blocked[(first + k) % SECTORS] for k in range(count))
    ]


def cheapest(
    found: Sequence[float], target: float, heading: float, last: float | None, near: bytes, config: FollowValleyConfig
) -> float | None:
    """Return the candidate of the least cost; None without one. All directions are in sectors.

    Parameters
    ----------
    found : sequence of float
        The candidates.
    target, heading : float
        Direction of the target, and in which the wheels drive.
    last : float or None
        What was chosen before.
    near : bytes
        The sectors that pass something nearer than is comfortable, a byte each.
    config : FollowValleyConfig
        The weights μ₁, μ₂, μ₃, and what a near pass costs.
    """
    best, least = None, float("inf")
    for c in found:
        cost = config.target_weight * apart(c, target) + config.heading_weight * apart(c, heading)
        cost += config.last_weight * apart(c, heading if last is None else last)
        if near[round(c) % SECTORS]:
            cost += config.near_cost
        if cost < least:
            best, least = c, cost
    return best
