"""A sensor is named as deaf only by what passes through its own beam; healthy ones never are, in any room."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_robot
from config.robot import RingConfig
from perception.records import Records, records, zeros
from perception.sensor_faults.memory import LOOKS_KEPT, RingMemory, SensorMemory
from perception.sensor_faults.monitor import SensorMonitor
from perception.sensor_faults.silence import DEAF_NAT, HEALTHY_MISS_MIN, miss_share, was_audible, weigh_silence
from tests.perception.wandering import Wandering, ring_of, ring_with_gaps

pytestmark = [pytest.mark.compiled]
promise = pytest.mark.promise("P8")
HALF, NEAR_M = math.radians(12.0), 3.0
LOOKS_NEEDED = math.ceil(DEAF_NAT / -math.log(HEALTHY_MISS_MIN))


def memory() -> tuple[Records[SensorMemory], Records[RingMemory]]:
    return records(SensorMemory, zeros(SensorMemory, 3)), records(RingMemory, zeros(RingMemory, 1))


def look(sensors: Records[SensorMemory], sensor: int, slot: int, bearing_deg: float, range_m: float = 1.0) -> None:
    """Enter that a sensor heard the origin, or something so far away, in this direction."""
    one, axis = sensors[sensor].looks[slot], math.radians(bearing_deg)
    one.x, one.y, one.axis, one.range_m = -math.cos(axis), -math.sin(axis), axis, range_m


@pytest.mark.parametrize(
    ("others", "audible"),
    [
        ([(1, 20.0, 1.0), (2, -20.0, 1.0)], True),
        ([(1, 20.0, 1.0), (1, -20.0, 1.0)], True),
        ([(1, 1.0, 1.0)], True),
        ([(1, 20.0, 1.0)], False),
        ([(1, 20.0, 1.0), (2, 40.0, 1.0)], False),
        ([(1, 70.0, 1.0), (2, -70.0, 1.0)], False),
        ([(1, 20.0, 1.4), (2, -20.0, 1.0)], False),
        ([(1, 20.0, -1.0), (2, -20.0, 1.0)], False),
        ([(0, 20.0, 1.0), (0, -20.0, 1.0)], False),
        ([], False),
    ],
)
def test_a_place_is_audible_if_others_heard_it_from_both_sides(
    others: list[tuple[int, float, float]], audible: bool
) -> None:
    sensors, _ = memory()
    look(sensors, 0, 0, 0.0, -1.0)
    for slot, (sensor, bearing_deg, range_m) in enumerate(others):
        look(sensors, sensor, slot + 1, bearing_deg, range_m)
    assert was_audible(0, sensors[0].looks[0], HALF, NEAR_M, sensors) == audible
    assert not was_audible(0, sensors[0].looks[0], HALF, 0.5, sensors), "beyond the near limit"


def turning(deaf: int | None, turns: int, echo_at: int | None = None) -> tuple[bool, Records[SensorMemory]]:
    """Turn three sensors, 15° apart, among objects all around, and return whether sensor 0 is deaf."""
    (sensors, ring), is_deaf = memory(), False
    for k in range(turns * 24):
        for i in range(3):
            r = math.inf if i == deaf and k != echo_at else 1.0
            axis = math.radians(15.0 * (k + i))
            found = weigh_silence(i, r, 0.0, 0.0, axis, HALF, NEAR_M, sensors, ring)
            is_deaf = is_deaf or (found and i == 0)
    return is_deaf, sensors


def test_what_others_heard_where_it_looks_names_a_deaf_sensor_and_an_echo_clears_it() -> None:
    assert turning(0, 2)[0]
    assert not turning(None, 2)[0]
    assert not turning(1, 2)[0]
    _, sensors = turning(0, 2, echo_at=47)
    assert sensors[0].deaf_looks == 0


def test_a_robot_that_stands_or_looks_out_between_two_objects_says_nothing() -> None:
    for swing_deg in (0.0, 5.0, 12.0):
        sensors, ring = memory()
        for k in range(2000):
            for i, bearing_deg in enumerate((0.0, 15.0, -15.0)):
                axis = math.radians(bearing_deg + swing_deg * math.sin(0.1 * k))
                r = 1.0 if abs(math.degrees(axis)) > 12.5 else math.inf
                assert not weigh_silence(i, r, 0.0, 0.0, axis, HALF, NEAR_M, sensors, ring), (swing_deg, k)


def test_where_the_others_miss_much_silence_says_little() -> None:
    sensors, ring = memory()
    ring[0].audible, ring[0].misses = 1000, 800
    assert miss_share(sensors[0], ring[0]) == pytest.approx(803.0 / 1010.0)
    sensors[0].audible = sensors[0].misses = 700
    assert miss_share(sensors[0], ring[0]) == pytest.approx(103.0 / 310.0), "its own do not count"
    ring[0].audible, ring[0].misses = 10_000, 700
    assert miss_share(sensors[0], ring[0]) == HEALTHY_MISS_MIN
    assert LOOKS_KEPT >= 2


def named(drive: Wandering) -> dict[tuple[int, str], float]:
    """Return when each fault was reported first, s."""
    monitor, found = SensorMonitor(drive.ring), dict[tuple[int, str], float]()
    for firing in drive.firings():
        before = monitor.changes
        monitor.filter(firing)
        if monitor.changes != before:
            for report in monitor.reports():
                found.setdefault((report.sensor, report.fault), firing.robot_s)
    return found


RINGS: tuple[tuple[str, Callable[[int], RingConfig]], ...] = (
    ("three front sensors", lambda _: ring_of(-15.0, 0.0, 15.0)),
    ("four sensors at ±30°", lambda _: ring_of(-30.0, -10.0, 10.0, 30.0)),
    ("a ring with gaps", ring_with_gaps),
    ("denning", lambda _: load_robot("denning").ring),
    ("p3dx", lambda _: load_robot("p3dx").ring),
)


@promise
@pytest.mark.parametrize(
    ("rooms", "stand_s"), [(range(0, 40, 8), 60.0), pytest.param(range(500, 600), 600.0, marks=pytest.mark.soak)]
)
def test_no_healthy_sensor_is_named_in_any_room(
    rooms: range, stand_s: float, measured: Callable[[str], None]
) -> None:
    for seed in rooms:
        name, ring = RINGS[seed % 7 % len(RINGS)]
        assert named(Wandering(ring(seed), seed, 120.0, stand_s)) == {}, (name, seed)
    measured(f"{len(rooms)} rooms, two minutes of driving and {stand_s:g} s of standing: 0 healthy sensors named")


@promise
@pytest.mark.parametrize("count", [3, pytest.param(6, marks=pytest.mark.soak)])
def test_a_deaf_sensor_is_named_on_a_robot_that_turns(count: int, measured: Callable[[str], None]) -> None:
    rng, times = np.random.default_rng(11), list[float]()
    drives = [(seed, *RINGS[seed % len(RINGS)]) for seed in range(count)]
    for seed, name, make in drives:
        ring = make(seed)
        deaf = int(rng.integers(len(ring.mounts)))
        found = named(Wandering(ring, seed, 240.0, deaf=deaf))
        assert set(found) <= {(deaf, "silent")}, (name, seed)
        times += found.values()
    assert len(times) >= count - 1
    measured(
        f"{len(drives)} wandering robots with a deaf sensor: {len(times)} named, "
        f"after {np.median(times):.0f} s (median)"
    )
