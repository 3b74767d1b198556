"""Mutants that may live, each with the reason why no test should notice it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

ACCEPTED: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "drivers/denning/codec.py": {
            "encode: True → False": "a layout's fields and codes are written side by side and are equally many",
            "encode: low <= value <= high → low < value <= high": "what is on the bound is checked twice, and passes",
            "encode: low <= value <= high → low <= value < high": "what is on the bound is checked twice, and passes",
        },
        "drivers/firing_pattern.py": {
            "_check_step: step_period_s >= needed_s - _TOLERANCE_S → step_period_s > needed_s - _TOLERANCE_S": (
                "they differ where a step is short by exactly the tolerance, a nanosecond: either answer is right"
            ),
        },
        "behaviors/arbiter.py": {
            "arbitrate: magnitude < NEGLIGIBLE → magnitude <= NEGLIGIBLE": (
                "at exactly a hundredth of a drive_request, standing still and crawling are both right"
            ),
            "arbitrate: 0.0 <= v <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s → "
            "0.0 <= v <= body.speed_max_m_s or abs(w) <= body.turn_max_rad_s": (
                "the last line of defence: what is refused before it leaves nothing that could reach it"
            ),
            "arbitrate: return _outside(v, w) → return None": "the same line of defence: nothing comes to it",
            "limit: asked.v > 0.0 → asked.v >= 0.0": "who asks for no speed gets none, going ahead or back",
            "limit: percept.pose.theta + math.pi → percept.pose.theta - math.pi": "back is back by either",
            "limit: abs(v) <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s → "
            "abs(v) <= body.speed_max_m_s or abs(w) <= body.turn_max_rad_s": "the last line of defence, as above",
            "limit: return _outside(v, w) → return None": "nothing comes to it",
            "_outside: return Stop(f\"the arbiter worked out a velocity outside the base's limits "
            "(v {v:g} m/s, w {w:g} rad… → return None": "nothing comes to it",
            "_is_finite: return False → return None": "either is no",
            "_course_speed_m_s: angle_rad < CAUTIOUS_ANGLE_RAD → angle_rad <= CAUTIOUS_ANGLE_RAD": (
                "at that angle both branches give the cautious velocity"
            ),
        },
    }
)
