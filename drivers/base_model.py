"""A base that obeys within the limits of its robot file: what a real one is compared with."""

from __future__ import annotations

from config.robot import BodyConfig
from drivers.messages import Twist


def obeyed(before: Twist, asked: Twist, body: BodyConfig, lasted_s: float) -> Twist:
    """Return the velocity of a base, `before` at first, after a command `asked` has lasted for a time.

    `body` has its greatest velocities and accelerations.
    """
    return Twist(
        _approach(before.v, asked.v, body.speed_max_m_s, body.acceleration_max_m_s2 * lasted_s),
        _approach(before.w, asked.w, body.turn_max_rad_s, body.turn_acceleration_max_rad_s2 * lasted_s),
    )


def stop_s(twist: Twist, body: BodyConfig) -> float:
    """Return how long a base that brakes as its file says takes from a velocity to standstill, s."""
    return max(abs(twist.v) / body.acceleration_max_m_s2, abs(twist.w) / body.turn_acceleration_max_rad_s2)


def _approach(before: float, asked: float, limit: float, change: float) -> float:
    target = max(-limit, min(limit, asked))
    return max(before - change, min(before + change, target))
