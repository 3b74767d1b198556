"""The kernel that weighs how a sensor on a servo is mounted: as the robot file says, or turned by quarters.

A servo's arm is put on turned more easily than a ring is. From one round to the next its bearings turn with the
robot, which turns a lot among furniture, so that no bearing looks twice in one direction. Hence each reading is
compared with the last echo from about its own direction, at whichever bearing that was heard. As for a whole ring
(`perception.ring_faults.mounting`), a range changes by what each mounting lets expect: one that grows as the robot
drives in its direction is of a sensor that looks elsewhere.

That holds for a ring's only sensor, on a servo that sweeps half a turn or more. In less, a corridor's walls look like
a turned arm; and echoes of two sensors from one direction would be compared as if one had moved.
"""

from __future__ import annotations

import math
from typing import Final

from perception.angles import wrapped
from perception.bounds import Count
from perception.kernel import Floats, kernel
from perception.records import Record, Records
from perception.ring_faults.memory import (
    EVIDENCE_NAT,
    NO_ECHO_M,
    QUARTERS,
    EchoTrace,
    Look,
    Reception,
    RingTrace,
    SensorPlace,
    mark,
)
from perception.ring_faults.mounting import (
    ECHO_KEPT_M,
    EXCLUDED_NAT,
    LEAN_RAD,
    change_density,
    may_graze_wall,
    surfaces_heard,
)

LOOK_DIRECTIONS: Final = 60
"""Directions of the room that are distinguished: a fifth of a beam of 30° each, as far apart as a servo's steps."""
MOVED_MIN_M: Final = 0.03
"""Way of the sensor after which two echoes are compared, m. Twelve honest drives had excluded all turned mountings
after .47 m in the median; with .06, and the whole change of the axis as an error of the range, after .62 m."""
SILENCES_MAX: Final = 2
"""An echo is dropped after so many silences from its direction."""


class DirectionTrace(Record):
    """What was heard last from one direction of the room."""

    heard: SensorPlace
    """The echo; without one its range is `NO_ECHO_M`."""
    silences: Count
    """Looks without an echo since."""


@kernel
def forget_directions(directions: Records[DirectionTrace]) -> None:
    """Drop all echoes."""
    for k in range(len(directions)):
        directions[k].heard.range_m = NO_ECHO_M


@kernel
def weigh_direction(
    i: int,
    look: Look,
    yaw: float,
    mounts: Floats,
    reception: Reception,
    echoes: Records[EchoTrace],
    directions: Records[DirectionTrace],
    all_of: RingTrace,
) -> None:
    """Test whether the change of range in a direction follows the motion, or that of a servo whose arm is turned.

    Neighbouring bearings hear the same surface: those within a beam count together as one. What a wall along the path
    may explain says nothing: without that, robots in corridors were held for a fifth to a half of their time.

    Parameters
    ----------
    i : int
        The bearing.
    look, reception, all_of
        As for `motion_tests.weigh_look`.
    yaw, mounts, echoes
        As for `motion_tests.check_motion`.
    directions
        What was heard last. Updated.
    """
    r, x, y, axis = look
    half_angle, tolerance, _ = reception
    c = directions[int(LOOK_DIRECTIONS * (axis % math.tau) / math.tau) % LOOK_DIRECTIONS]
    if r < 0.0:
        c.silences += 1
        if c.silences >= SILENCES_MAX:
            c.heard.range_m = NO_ECHO_M
        return
    c.silences = 0
    before = c.heard.range_m
    dx, dy = x - c.heard.x, y - c.heard.y
    moved = math.hypot(dx, dy)
    if before >= 0.0 and all_of.path_m - c.heard.path_m <= ECHO_KEPT_M:
        if moved < MOVED_MIN_M:
            return
        turn, change, path_m = abs(wrapped(axis - c.heard.axis)), r - before, all_of.path_m
        error, lean = tolerance + 0.03 * r + 0.5 * r * turn, LEAN_RAD + turn
        is_frozen = r == before  # which says nothing of the sensor's place
        if not is_frozen and not may_graze_wall(
            i, r, (axis, yaw), (dx, dy, change), (error, lean), mounts, reception, echoes, path_m
        ):
            own, norm = axis - math.atan2(dy, dx), surfaces_heard(len(mounts), half_angle)
            filed = change_density(own, change, moved, error, half_angle)
            for k in range(QUARTERS):
                turned = change_density(own + 0.5 * math.pi * (k + 1), change, moved, error, half_angle)
                nats = math.log(turned / filed) / norm
                all_of.turned_nat[k] = max(-EVIDENCE_NAT, all_of.turned_nat[k] + nats)
                if all_of.excluded_nat[k] < EXCLUDED_NAT:
                    all_of.excluded_nat[k] = max(-EXCLUDED_NAT, all_of.excluded_nat[k] - nats)
    mark(c.heard, r, x, y, axis, all_of.path_m)
