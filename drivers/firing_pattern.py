"""The firing pattern: a schedule of the sets of sensors that fire together, for any robot.

Sensors that fire together must not hear each other's echoes, and a firing must not start before the window of the
last one has closed. The user ensures the first by the choice of sets; this module checks the second.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from config.errors import WRONG_CALL, UserError
from config.robot import SOUND_SPEED_M_S, ListenPreset, Preset, RingConfig, SensorConfig

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
_PLACES_AWAY: Mapping[ListenPreset, int] = MappingProxyType({"neighbours": 1, "second": 2})
LISTENING_LOBE = 2.0
"""How far off its axis a sensor hears another sensor's pulse, in beam half-angles. At the beam's edge the losses of
emission and reception together reach the detection limit. For a foreign pulse only reception is off axis, which costs
half the decibels, so the limit lies farther out: about √2 times for an ordinary echo, about twice for a strong one.
Strong echoes are those that cause crosstalk."""
_SAME_ANGLE_RAD = 1e-6
"""Angles that differ by less are equal but for rounding."""
_TOLERANCE_S = 1e-9
"""Slack for the rounding of decimal fractions."""
_STEPS_MAX = 4096
"""Most firings before a pattern repeats; bounds the memory for servos whose scans rarely come back together."""


class FiringError(UserError):
    """The ring cannot carry out the firing pattern; the text says why and what would work."""

    exit_code = WRONG_CALL


@dataclass(frozen=True, slots=True)
class FiringPattern:
    """A cyclic schedule: every `step_period_s` the sensors of the next mask fire; bit i of a mask is sensor i.

    `listeners` has a mask for each step, of the sensors that listen in it without firing; it is empty if none do.
    """

    masks: tuple[int, ...]
    step_period_s: float
    window_m: float
    listeners: tuple[int, ...] = ()

    @property
    def cycle_s(self) -> float:
        """Time after which the same sensors fire again, s."""
        return len(self.masks) * self.step_period_s

    @property
    def set_size(self) -> int:
        """The most sensors that fire at once."""
        return max(mask.bit_count() for mask in self.masks)


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
        The preset does not divide the ring, a set names a missing sensor, a step is shorter than the time sound needs
        to the end of its window and back, or a sensor listens where it fires or midway between two that fire.
    """
    masks, firing = sensor_masks(ring), ring.firing
    _check_step(firing.step_period_s, ring.window_m)
    if ring.has_servo:
        return FiringPattern(_scan_masks(ring, masks), firing.step_period_s, ring.window_m)
    return FiringPattern(masks, firing.step_period_s, ring.window_m, _listeners(ring, masks))


def sensor_masks(ring: RingConfig) -> tuple[int, ...]:
    """Return the masks of the sensors that fire in turn, one on a servo as one bit; errors of `firing_pattern`."""
    firing, count = ring.firing, ring.sensor_count
    if firing.preset is not None:
        return _preset_masks(firing.preset, count)
    return _rotated_masks("sets", firing.sets or (), firing.rotations, count)


def scan_order(sensor: SensorConfig) -> tuple[int, ...]:
    """Return the bearings of a sensor's servo in the order of its scan, by number; (0,) without a servo."""
    count = len(sensor.views)
    back = () if count == 1 or sensor.is_endless else range(count - 2, 0, -1)
    return (*range(count), *back)


def _scan_masks(ring: RingConfig, masks: tuple[int, ...]) -> tuple[int, ...]:
    """Return the masks of a ring with servos, whose bits are bearings, until all servos are where they began.

    Raises
    ------
    FiringError
        They meet again only after too many firings.
    """
    listed = ring.sensors or ()
    orders = [scan_order(sensor) for sensor in listed]
    begins = list(itertools.accumulate((len(sensor.views) for sensor in listed), initial=0))
    fired = [sum(mask >> i & 1 for mask in masks) for i in range(len(listed))]
    rounds = math.lcm(*(len(order) // math.gcd(len(order), n) for order, n in zip(orders, fired, strict=True) if n))
    if rounds * len(masks) > _STEPS_MAX:
        raise FiringError(
            f"ring.sensors: servos whose scans have {', '.join(str(len(o)) for o in orders if len(o) > 1)} steps "
            f"meet again only after {rounds * len(masks)} firings, at most {_STEPS_MAX}: give them equal bearings"
        )
    turned = [0] * len(listed)
    steps = []
    for mask in masks * rounds:
        views = 0
        for i in sensors(mask):
            views |= 1 << (begins[i] + orders[i][turned[i] % len(orders[i])])
            turned[i] += 1
        steps.append(views)
    return tuple(steps)


def _listeners(ring: RingConfig, masks: tuple[int, ...]) -> tuple[int, ...]:
    """Return the masks of those that listen, one a step; none if no sensor ever listens.

    Raises
    ------
    FiringError
        A sensor fires in that step, or could hear two; or there is no set for each step.
    """
    firing, count = ring.firing, len(ring.mounts)
    if not firing.has_listeners:
        return ()
    if firing.listen_preset is not None:
        away = _PLACES_AWAY[firing.listen_preset]
        heard = tuple(
            _mask((i + turn) % count for i in sensors(mask) for turn in (-away, away)) & ~mask for mask in masks
        )
    else:
        heard = _rotated_masks("listen", firing.listen or (), firing.rotations, count)
    if len(heard) != len(masks):
        raise FiringError(
            f"ring.firing.listen has {len(heard)} sets, and the pattern {len(masks)} steps before it repeats; give "
            f"one for each step"
        )
    axes = tuple(mount.angle_rad for mount in ring.mounts)
    for step, (fired, mask) in enumerate(zip(masks, heard, strict=True)):
        if fired & mask:
            raise FiringError(
                f"ring.firing.listen: sensor {sensors(fired & mask)[0]} would listen in step {step}, in which it "
                f"fires; leave it out of that step"
            )
        for sensor in sensors(mask):
            near = _nearest_firing(axes, sensor, fired)
            if len(near) > 1:
                raise FiringError(
                    f"ring.firing.listen: sensor {sensor} would listen midway between {near[0]} and {near[1]}, which "
                    f"both fire in step {step}, so that it could not be said whose pulse it hears; leave it out, or "
                    f"fire fewer sensors together"
                )
    return heard if any(heard) else ()


def _nearest_firing(axes: tuple[float, ...], sensor: int, fired: int) -> tuple[int, ...]:
    """Return those of the sensors that fire whose axes are nearest to that of `sensor`."""
    between = {j: abs(math.remainder(axes[j] - axes[sensor], 2.0 * math.pi)) for j in sensors(fired)}
    least = min(between.values(), default=0.0)
    return tuple(j for j, angle in between.items() if angle <= least + _SAME_ANGLE_RAD)


@lru_cache(maxsize=256)
def cross_pairs(axes: tuple[float, ...], fired: int, listeners: int) -> tuple[tuple[int, int], ...]:
    """Return each listener of a firing with the sensor whose pulse it hears: (transmitter, listener).

    A listener reports the first pulse to arrive, of any sensor. Beams are narrow, so that is the pulse of the
    sensor that looks most nearly the same way; of two that look equally near, the one of the lower index.

    Axes are the directions of the ring's sensors, rad; bits of the masks beyond them are ignored.
    """
    ours = (1 << len(axes)) - 1
    fired &= ours
    return tuple((_nearest_firing(axes, i, fired)[0], i) for i in sensors(listeners & ours)) if fired else ()


def pattern_pairs(ring: RingConfig) -> tuple[tuple[int, int], ...]:
    """Return the cross paths that the ring's pattern measures, (transmitter, listener), sorted.

    Raises
    ------
    FiringError
        As by `firing_pattern`.
    """
    pattern, axes = firing_pattern(ring), tuple(mount.angle_rad for mount in ring.mounts)
    steps = zip(pattern.masks, pattern.listeners, strict=True) if pattern.listeners else ()
    return tuple(sorted({pair for fired, heard in steps for pair in cross_pairs(axes, fired, heard)}))


def _mask(numbers: Iterable[int]) -> int:
    """Return the mask with these bits."""
    return sum(1 << i for i in set(numbers))


def _preset_masks(preset: Preset, count: int) -> tuple[int, ...]:
    """Return the masks of a preset's steps.

    Raises
    ------
    FiringError
        The sensors cannot be divided so.
    """
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


def _rotated_masks(field: str, sets: tuple[tuple[int, ...], ...], rotations: int, count: int) -> tuple[int, ...]:
    """Return the masks of sets that are fired in turn, and then so many times again, each a sensor further.

    Raises
    ------
    FiringError
        The ring has no such sensor.
    """
    missing = sorted({i for numbers in sets for i in numbers if i >= count})
    if missing:
        raise FiringError(
            f"ring.firing.{field} names sensor {', '.join(map(str, missing))}, and this ring has sensors 0 to "
            f"{count - 1}: numbers start at 0; correct {field} or the ring"
        )
    return tuple(_mask((i + turn) % count for i in numbers) for turn in range(rotations) for numbers in sets)


def _check_step(step_period_s: float, window_m: float) -> None:
    """Check that echoes of a firing arrive before the next one.

    Raises
    ------
    FiringError
        They may not.
    """
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
