"""Records of what is remembered of each sensor and of the ring, for `perception.sensor_faults.reading_tests`."""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.bounds import FINITE, FLAG, PLACE, POSITIVE, Count, Flag, Place, Share, index_of, up_to
from perception.kernel import Floats, Ints
from perception.records import Record, Records
from perception.sensor_faults.report import AT_MAXIMUM, CROSSTALK, FAILING, SILENT, STUCK, TOO_NEAR

SETS_MAX: Final = 32
"""Sets of sensors that fire together that are distinguished; a firing pattern has at most 24."""


TOO_NEAR_READINGS: Final = 5
"""Readings below the least range, less the others, that are a fault; as many others clear it."""
RANGE_OR_NONE: Final = PLACE._replace(infinite=True)
"""Of a range; infinite where nothing was heard, or nothing is known yet."""


LOOKS_KEPT: Final = 16
"""Looks of each sensor that are kept, `silence.LOOKS_APART_M` or half a beam apart: a turn by 90°, or 1.6 m."""
FARTHEST_KEPT: Final = 16
"""Looks in the last step of the range that are kept: more than there are directions a beam apart."""


class NeighbourCounts(Record):
    """A sensor's running counts, against which its neighbours are compared."""

    changes: Count
    """Changes of the steady reading."""
    leaps: Count
    """Those by more than `SAME_ECHO_M`."""


class SensorLook(Record):
    """A reading and where the sensor made it, in the odometry's frame."""

    range_m: Annotated[float, PLACE]
    """The reading, m; below zero without an echo."""
    x: Place
    """Place of the sensor, m."""
    y: Place
    axis: Place
    """Direction of its axis, rad."""


class SensorMemory(Record):
    """What is remembered of one sensor."""

    readings: Count
    """Readings since the start or the last reset."""
    last_m: Annotated[float, RANGE_OR_NONE]
    """The last reading, m."""
    before_last_m: Annotated[float, RANGE_OR_NONE]
    steady_m: Annotated[float, RANGE_OR_NONE]
    """What it reads but for strays, m."""
    last_set: Annotated[int, index_of(SETS_MAX)]
    """The set it fired in at the last reading."""
    before_last_set: Annotated[int, index_of(SETS_MAX)]
    last_x: Place
    """Place of the ring at the last reading, m."""
    last_y: Place
    counts: NeighbourCounts
    missed: Count
    """Firings of the ring since the last reading."""
    run_m: Annotated[float, RANGE_OR_NONE]
    """The run of equal readings: its value, m."""
    run_firing: Count
    """The firing of the ring in which it began."""
    run_length: Count
    """Its readings."""
    run_x: Place
    """Pose of the ring when it began, m and rad."""
    run_y: Place
    run_yaw: Place
    run_neighbours: Annotated[Records[NeighbourCounts], 2]
    """The neighbours' counts when it began."""
    stuck_m: Annotated[float, RANGE_OR_NONE]
    """The value it is stuck at, m."""
    off_stuck: Count
    """Consecutive readings away from that value."""
    too_near: Annotated[int, up_to(TOO_NEAR_READINGS)]
    """Readings below the least range, less the others."""
    faults: Annotated[int, up_to(STUCK | SILENT | FAILING | CROSSTALK | TOO_NEAR | AT_MAXIMUM)]
    """Fault bits of `perception.sensor_faults.report`."""
    short_readings: Annotated[Floats, SETS_MAX, FINITE]
    """For each set, short readings less those that were not."""
    is_crossed: Annotated[Ints, SETS_MAX, FLAG]
    """For each set, 1 where the sensor is masked for crosstalk."""
    looks: Annotated[Records[SensorLook], LOOKS_KEPT]
    """The last looks, of the number n in place n % LOOKS_KEPT."""
    looks_made: Count
    """Number of the next look."""
    heard_looks: Count
    """Number of the next look when the sensor heard its last echo."""
    audible: Count
    """Looks at something that others heard from both sides."""
    misses: Count
    """Those of these looks that have no echo."""
    deaf_looks: Count
    """Of the latter, those since the last echo that are unlike the one before them."""
    deaf_x: Place
    """Where the last one of these was made, m and rad."""
    deaf_y: Place
    deaf_axis: Place


class RingMemory(Record):
    """What is remembered of the ring as a whole."""

    firings: Count
    sets_seen: Count
    """Different sets met so far; a set that was replaced and recurs counts again."""
    x: Place
    """Place of the last firing, m."""
    y: Place
    turn_x: Place
    """Place where it began to turn in place, m."""
    turn_y: Place
    turn_firing: Count
    """The firing with which that turn began."""
    turned: Place
    """How much it has turned since, counter-clockwise, rad."""
    turn_yaw: Place
    """Its direction at the last firing, rad."""
    regularity: Share
    """Recent share of firings whose set was known."""
    audible: Count
    """Looks of all sensors at something that others heard from both sides."""
    misses: Count
    """Those of these looks that have no echo."""
    too_near_nat: Annotated[float, POSITIVE]
    """Evidence that readings below the least range stand for nothing that is there, nat, of all sensors."""
    farthest: Annotated[Records[SensorLook], FARTHEST_KEPT]
    """Looks in the last step of the range, of the number n in place n % FARTHEST_KEPT."""
    farthest_looks: Count
    """Number of the next one."""
    maximum_nat: Annotated[float, POSITIVE]
    """Evidence that the greatest range stands for a silence, nat."""
    is_maximum_nothing: Flag
    """Whether it was enough; until it is gone."""


class RingSetup(NamedTuple):
    """What is known of the ring before it reads anything."""

    mounts: Floats
    """(n, 3): place x, y (m) and direction (rad) of each sensor in the ring."""
    turns: Floats
    """(n,): by how much each sensor's part has turned in the ring by now, rad."""
    neighbours: Ints
    """(n, 2): each sensor's neighbours, −1 for a sensor that has not two."""
    expected: NDArray[np.bool_]
    """(n,): whether each sensor fires at all."""
    half_angle: float
    """Half the beam's width, rad."""
    tolerance: float
    """Readings that differ by no more than this are equal, m."""
    least: float
    """Ranges below this cannot be measured, m."""
    near: float
    """What is farther away is not compared between sensors, m."""
    last_step: tuple[float, float]
    """The last step of the range: from and to, m."""
