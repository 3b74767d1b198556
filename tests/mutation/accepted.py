"""Mutants that may survive, each with the reason why no test needs to detect it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

ACCEPTED: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "drivers/denning/codec.py": {
            "encode: True → False": "a layout has as many fields as codes, which are written side by side",
            "encode: low <= value <= high → low < value <= high": "a value on the bound is checked a second time",
            "encode: low <= value <= high → low <= value < high": "a value on the bound is checked a second time",
            "Decoder._parse #2: 0 → 1": "of a frame without payload no version is read",
        },
        "drivers/firing_pattern.py": {
            "_listeners: i + turn → i - turn": "the listeners lie on both sides alike",
            "_listeners: True → False": "both have one mask a step, which was checked just before",
            "_nearest_firing: 0.0 → 1.0": "without a sensor that fires there is none to compare with it",
            "_nearest_firing: angle <= least + _SAME_ANGLE_RAD → angle < least + _SAME_ANGLE_RAD": (
                "they differ only for angles that differ by exactly a millionth: either answer is right"
            ),
            "pattern_pairs: True → False": "a pattern has one mask of listeners for each of those that fire, or none",
            "_check_step: step_period_s >= needed_s - _TOLERANCE_S → step_period_s > needed_s - _TOLERANCE_S": (
                "they differ only if a step is short by exactly the tolerance of a nanosecond: either answer is right"
            ),
        },
        "behaviors/arbiter.py": {
            "arbitrate: magnitude < NEGLIGIBLE → magnitude <= NEGLIGIBLE": (
                "at exactly this magnitude, stopping and creeping are both right"
            ),
            "arbitrate: 0.0 <= v <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s → "
            "0.0 <= v <= body.speed_max_m_s or abs(w) <= body.turn_max_rad_s": (
                "a second safety check: earlier checks refuse every value that could reach it"
            ),
            "arbitrate: return _outside(v, w) → return None": "the same safety check: no value reaches it",
            "limit_velocity: requested.v > 0.0 → requested.v >= 0.0": "zero speed stays zero, ahead or back",
            "limit_velocity: percept.pose.theta + math.pi → percept.pose.theta - math.pi": "the same direction",
            "limit_velocity: abs(v) <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s → "
            "abs(v) <= body.speed_max_m_s or abs(w) <= body.turn_max_rad_s": "the second safety check, as above",
            "limit_velocity: return _outside(v, w) → return None": "no value reaches it",
            "_outside: return Stop(f\"the arbiter computed a velocity outside the base's limits "
            "(v {v:g} m/s, w {w:g} rad/s… → return None": "no value reaches it",
            "_is_finite: return False → return None": "both values are falsy",
            "_course_speed_m_s: angle_rad < CAUTIOUS_ANGLE_RAD → angle_rad <= CAUTIOUS_ANGLE_RAD": (
                "at that angle both branches give the cautious velocity"
            ),
        },
    }
)
