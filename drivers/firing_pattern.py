"""The firing pattern: a schedule of the sets of sensors that fire together, for any robot.

Sensors that fire together must not hear each other's echoes, and a firing must not start before the window of the
last one has closed. The user ensures the first by the choice of sets; this module checks the second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from config.errors import WRONG_CALL, UserError
from config.robot import SOUND_SPEED_M_S, Preset, RingConfig

_AT_A_TIME: Mapping[Preset, tuple[int, ...]] = MappingProxyType(
    {
        "single": (1,),
        "opposite_pairs": (2,),
        "thirds": (3,),
        "quadrants": (4,),
        "octets": (8,),
        # In a ring of 24 the partners are 3n and 8n places apart: no two sensors fire together in both.
        "alternating": (8, 3),
    }
)
_TOLERANCE_S = 1e-9
"""Slack for the rounding of decimal fractions."""


class FiringError(UserError):
    """The ring cannot carry out the firing pattern; the text says why and what would work."""

    exit_code = WRONG_CALL


@dataclass(frozen=True, slots=True)
class FiringPattern:
    """A cyclic schedule: every `step_period_s` the sensors of the next mask fire; bit i of a mask is sensor i."""

    masks: tuple[int, ...]
    step_period_s: float
    window_m: float


def time_of_flight_s(window_m: float) -> float:
    """Return how long sound takes to the end of the window and back, s."""
    return 2.0 * window_m / SOUND_SPEED_M_S


def sensors(mask: int) -> tuple[int, ...]:
    """Return the numbers of the sensors in `mask`, lowest first."""
    return tuple(i for i in range(mask.bit_length()) if mask >> i & 1)


def firing_pattern(ring: RingConfig) -> FiringPattern:
    """Return the schedule that `ring` configures.

    Raises
    ------
    FiringError
        The preset does not divide the ring, a set names a missing sensor, or a step is shorter than the
        time sound needs to the end of its window and back.
    """
    count = len(ring.mounts)
    firing = ring.firing
    if firing.preset is not None:
        masks = _preset_masks(firing.preset, count)
    else:
        masks = _rotated_masks(firing.sets or (), firing.rotations, count)
    _check_step(firing.step_period_s, ring.window_m)
    return FiringPattern(masks, firing.step_period_s, ring.window_m)


def _mask(numbers: Iterable[int]) -> int:
    return sum(1 << i for i in set(numbers))


def _preset_masks(preset: Preset, count: int) -> tuple[int, ...]:
    sizes = _AT_A_TIME[preset]
    if any(count % together for together in sizes):
        possible = ", ".join(name for name, ways in _AT_A_TIME.items() if not any(count % size for size in ways))
        raise FiringError(
            f'ring.firing: preset "{preset}" fires {" or ".join(map(str, sizes))} sensors at a time, equally spaced, '
            f"and {count} sensors do not divide by {' or '.join(str(size) for size in sizes if count % size)}; "
            f"possible for this ring: {possible}, or sets of your own"
        )
    return tuple(
        _mask(range(step, count, count // together)) for together in sizes for step in range(count // together)
    )


def _rotated_masks(sets: tuple[tuple[int, ...], ...], rotations: int, count: int) -> tuple[int, ...]:
    missing = sorted({i for numbers in sets for i in numbers if i >= count})
    if missing:
        raise FiringError(
            f"ring.firing.sets names sensor {', '.join(map(str, missing))}, and this ring has sensors 0 to "
            f"{count - 1}: numbers start at 0; correct the sets or the ring"
        )
    return tuple(_mask((i + turn) % count for i in numbers) for turn in range(rotations) for numbers in sets)


def _check_step(step_period_s: float, window_m: float) -> None:
    needed_s = time_of_flight_s(window_m)
    if step_period_s >= needed_s - _TOLERANCE_S:
        return
    # Rounded to the safe side, so that the values in the message are accepted.
    shortest_s = math.ceil(needed_s * 1e4) / 1e4
    longest_m = math.floor(step_period_s * SOUND_SPEED_M_S / 2.0 * 1e3) / 1e3
    raise FiringError(
        f"ring.firing: step_period_s {step_period_s:g} is shorter than sound takes to window_m {window_m:g} and "
        f"back, so that echoes of one firing would be taken for those of the next; "
        f"make step_period_s at least {shortest_s:.4f} or window_m at most {longest_m:.3f}"
    )
