"""Records of what is remembered of each sensor and of the ring, for the tests of `perception.sensor_tests`."""

from __future__ import annotations

from typing import Annotated, Final

from perception.kernel import Floats, Ints
from perception.records import Record, Records

SETS_MAX: Final = 32
"""Sets of sensors that fire together that are distinguished; a firing pattern has at most 24."""


class NeighbourCounts(Record):
    """A sensor's running counts, against which its neighbours are compared."""

    changes: int
    """Changes of the steady reading."""
    leaps: int
    """Those by more than `LEAP_M`."""
    near_echoes: int
    """Echoes nearer than the near limit."""


class SensorMemory(Record):
    """What is remembered of one sensor."""

    readings: int
    """Readings since the start or the last reset."""
    last_m: float
    """The last reading, m."""
    before_last_m: float
    steady_m: float
    """What it reads but for strays, m."""
    last_set: int
    """The set it fired in at the last reading."""
    before_last_set: int
    last_x: float
    """Place of the ring at the last reading, m."""
    last_y: float
    counts: NeighbourCounts
    missed: int
    """Firings of the ring since the last reading."""
    run_m: float
    """The run of equal readings: its value, m."""
    run_firing: int
    """The firing of the ring in which it began."""
    run_length: int
    """Its readings."""
    run_x: float
    """Pose of the ring when it began, m and rad."""
    run_y: float
    run_yaw: float
    run_neighbours: Annotated[Records[NeighbourCounts], 2]
    """The neighbours' counts when it began."""
    stuck_m: float
    """The value it is stuck at, m."""
    off_stuck: int
    """Consecutive readings away from that value."""
    faults: int
    """Fault bits of `perception.sensor_report`."""
    short_readings: Annotated[Floats, SETS_MAX]
    """For each set, short readings less those that were not."""
    is_crossed: Annotated[Ints, SETS_MAX]
    """For each set, 1 where the sensor is masked for crosstalk."""


class RingMemory(Record):
    """What is remembered of the ring as a whole."""

    firings: int
    sets_seen: int
    """Different sets met so far; a set that was replaced and recurs counts again."""
    x: float
    """Place of the last firing, m."""
    y: float
    regularity: float
    """Recent share of firings whose set was known."""
