"""Records of what is remembered of each sensor and of the ring, for `perception.ring_faults.motion_tests`."""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias

from perception.bounds import FINITE, PLACE, POSITIVE, Count, Flag, Place
from perception.kernel import Floats, kernel
from perception.records import Record

NO_ECHO_M: Final = -1.0
"""In place of the range of a reading without an echo, m."""
HALVES: Final = 2
"""Parts of the ring that may fail by themselves: all of it, and what looks ahead."""
QUARTERS: Final = 3
"""Quarter turns, counter-clockwise, by which a ring may be mounted wrongly."""
LOOK_KINDS: Final = 4
"""Kinds of looks at a known echo, each with a rate of misses of its own."""
EVIDENCE_NAT: Final = math.log(1e7 / 0.002)
"""A sum of evidence that convicts the ring, nat: a day has some 10⁷ readings, and at most two days in a
thousand are to have a false alarm. In 40 hours of simulated honest drives the greatest sum was 19.5."""
MOVES: Final = 1.2
"""A reading changes by no more than this times the sensor's motion; rough walls that the beam grazes change more."""


Look: TypeAlias = tuple[float, float, float, float]
"""A reading (m; `NO_ECHO_M` without an echo), the sensor's place (x, y, m), and its axis (rad)."""
Reception: TypeAlias = tuple[float, float, float]
"""Half the beam's width (rad), the difference of equal readings (m), and how far the ring listens (m)."""


class SensorPlace(Record):
    """Where a sensor was at a reading, in the odometry's frame."""

    range_m: Annotated[float, PLACE]
    """The reading, m; `NO_ECHO_M` without an echo."""
    x: Place
    """Place of the sensor, m."""
    y: Place
    axis: Place
    """Direction of its axis, rad."""
    path_m: Place
    """The ring's way until then, m."""


class EchoTrace(Record):
    """What is remembered of one sensor."""

    is_known: Flag
    """Whether it has made a reading."""
    latest: SensorPlace
    """The last reading; its place is the ring's, not the sensor's."""
    before: SensorPlace
    """The one before, likewise."""
    is_compared: Flag
    """Whether there is one before."""
    standstill: Count
    """The standstill of the ring's readings to which `repeated` belongs."""
    repeated: SensorPlace
    """Where it repeated its reading first in that standstill."""
    repeated_nat: Annotated[float, POSITIVE]
    """Evidence that it repeats an old reading, nat, of changes that were due."""
    equal_nat: Annotated[float, POSITIVE]
    """The same of readings that need not have changed, but had no reason to be equal to the bit."""
    own: SensorPlace
    """Where it made the reading first that it repeats, whatever the others do."""
    stuck_nat: Annotated[float, POSITIVE]
    """Evidence that it alone is stuck, as far as changes were due, nat."""
    heard: SensorPlace
    """The last echo."""
    agreed: Count
    """Echoes in succession, each of which was where the one before had led to expect it."""
    agreed_m: Annotated[float, PLACE]
    """The last of these, m."""
    agreed_path_m: Place
    """The ring's way until that one, m."""
    silences: Count
    """Looks without an echo since the last echo."""
    anchor: SensorPlace
    """The echo with which later ones of the same surface are compared."""
    is_anchored: Flag
    """Whether there is such an echo."""


class RingTrace(Record):
    """What is remembered of the ring."""

    is_started: Flag
    x: Place
    """Place of the last firing, m."""
    y: Place
    travel_rad: Place
    """Direction of the last motion, rad."""
    path_m: Place
    """Its way so far, m."""
    standstill: Count
    """Number of the present standstill of the readings; a reading that changes ends it."""
    repeated_nat: Annotated[float, POSITIVE]
    """Evidence that the ring repeats old readings, nat, of all its sensors and changes that were due."""
    equal_nat: Annotated[float, POSITIVE]
    """The same of readings that need not have changed."""
    noise_nat: Annotated[float, POSITIVE]
    """Evidence that its ranges have noise, from readings at a standstill, nat."""
    missed_nat: Annotated[Floats, HALVES, POSITIVE]
    """Evidence that readings do not depend on what is there, nat."""
    silent: Count
    """Of the misses in that evidence, those without an echo."""
    elsewhere: Count
    """Of the misses in that evidence, those with an echo elsewhere."""
    turned_nat: Annotated[Floats, QUARTERS, FINITE]
    """Evidence that the ring is mounted turned by so many quarters, nat."""
    excluded_nat: Annotated[Floats, QUARTERS, FINITE]
    """Evidence that it is not, nat, since the start or the last reset of the odometry; kept where it suffices."""
    misses: Annotated[Floats, LOOK_KINDS, POSITIVE]
    """Looks of each kind that missed a known echo."""
    looks: Annotated[Floats, LOOK_KINDS, POSITIVE]
    """All looks of each kind."""


@kernel
def mark(place: SensorPlace, r: float, x: float, y: float, axis: float, path_m: float) -> None:
    """Enter a reading and where the sensor made it."""
    place.range_m, place.x, place.y, place.axis, place.path_m = r, x, y, axis, path_m
