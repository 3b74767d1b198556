"""The sequential tests of a ring against its motion: how evidence comes, goes, and becomes a result."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.records import records, zeros
from perception.ring_faults.changes import EXCHANGED, LENGTHENED, Expected
from perception.ring_faults.memory import EVIDENCE_NAT, EchoTrace, RingTrace
from perception.ring_faults.motion_tests import (
    CHANGED,
    NOTHING,
    REPEATED,
    SCATTERED,
    STUCK_SENSOR,
    TURNED,
    VANISHED,
    check_motion,
)
from perception.ring_faults.replays import PAST_FIELDS, PAST_LOOKS, PastLooks
from perception.ring_faults.servo_mounting import LOOK_DIRECTIONS, DirectionTrace, forget_directions

COUNT = 24
MOUNTS = np.array([[0.0, 0.0, math.tau * k / COUNT] for k in range(COUNT)])
HALF, TOLERANCE, REACH = math.radians(12.0), 0.005, 7.0
STEP_M = 0.02


class Ring:
    """A ring whose readings a test chooses."""

    def __init__(self, mounts: Floats = MOUNTS, *, on_servo: bool = False) -> None:
        self.mounts, count = mounts, len(mounts)
        self.directions = zeros(DirectionTrace, LOOK_DIRECTIONS if on_servo else 0)
        forget_directions(records(DirectionTrace, self.directions))
        self.echoes, self.memory = zeros(EchoTrace, count), zeros(RingTrace, 1)
        self.expected = zeros(Expected, count)
        self.past = np.zeros((count, PAST_LOOKS, PAST_FIELDS))
        self.looks, self.replayed_nat = np.zeros(count, np.int64), np.zeros(PAST_LOOKS)
        self.x = self.yaw = 0.0
        self.step_m = STEP_M

    def fire(self, ranges: Floats) -> int:
        found = check_motion(
            ranges,
            (self.x, 0.0, self.yaw),
            self.mounts,
            (HALF, TOLERANCE, REACH),
            records(EchoTrace, self.echoes),
            records(RingTrace, self.memory),
            records(Expected, self.expected),
            PastLooks(self.past, self.looks, self.replayed_nat),
            records(DirectionTrace, self.directions),
        )
        self.x += self.step_m
        return int(found)

    @property
    def missed_nat(self) -> float:
        return float(self.memory["missed_nat"][0].max())


def honest(x: float, quarter: int = 0) -> Floats:
    """Return what a ring, mounted turned by quarters, hears of a different surface square to each of its sensors."""
    axes = MOUNTS[:, 2] + 0.5 * math.pi * quarter
    return 3.0 + 0.02 * np.arange(COUNT) - x * np.cos(axes)


def after(way_m: float) -> Ring:
    ring = Ring()
    while ring.x < way_m:
        assert ring.fire(honest(ring.x)) == NOTHING
    return ring


@pytest.mark.covered
def test_an_honest_ring_has_no_evidence_against_it() -> None:
    ring = after(2.0)
    assert ring.memory["repeated_nat"][0] == ring.missed_nat == 0.0
    assert ring.memory["turned_nat"].max() < 0.0


def test_equal_readings_on_the_way_are_repeats() -> None:
    ring = after(0.5)
    last = honest(ring.x - STEP_M)
    found = [ring.fire(last) for _ in range(10)]
    assert REPEATED in found
    assert set(found) == {NOTHING, REPEATED}


@pytest.mark.covered
def test_silence_and_the_maximum_are_the_same_and_randomness_is_something_else() -> None:
    rng = np.random.default_rng(1)
    for ranges, reason in (
        (np.full(COUNT, math.inf), VANISHED),
        (np.full(COUNT, REACH), VANISHED),
        (rng.uniform(0.2, 1.5, COUNT), SCATTERED),
    ):
        assert after(0.5).fire(ranges) == reason


@pytest.mark.covered
def test_a_length_that_comes_to_all_ranges_is_named_in_that_round() -> None:
    for length in (0.4572, -0.4572, 1.2192):
        ring = after(0.5)
        ring.memory["misses"], ring.memory["looks"] = 250.0, 500.0
        assert ring.fire(honest(ring.x) + length) == CHANGED + LENGTHENED
        assert ring.fire(honest(ring.x) + length) == NOTHING, "from then on they agree with the motion"


def test_a_ring_that_is_turned_on_the_way_is_named_in_that_round() -> None:
    for part in (3, 6, 12, 18):
        ring = after(0.5)
        ring.memory["misses"], ring.memory["looks"] = 250.0, 500.0
        ranges: Floats = np.random.default_rng(3).permutation(np.linspace(1.0, 5.6, COUNT))
        assert ring.fire(ranges) != CHANGED + EXCHANGED
        assert ring.fire(ranges) == NOTHING
        assert ring.fire(np.roll(ranges, -part)) == CHANGED + EXCHANGED


def test_a_few_misses_are_honest_and_a_finding_begins_anew() -> None:
    ring = after(0.5)
    ranges = honest(ring.x)
    ranges[:4] = math.inf
    assert ring.fire(ranges) == NOTHING
    assert 0.0 < ring.memory["missed_nat"].max() + 1e-9 < EVIDENCE_NAT
    assert ring.fire(honest(ring.x)) == NOTHING
    assert ring.missed_nat == 0.0
    assert ring.fire(np.full(COUNT, math.inf)) == VANISHED
    assert ring.missed_nat == 0.0


def mirrored(ring: Ring) -> Floats:
    """Return what a ring hears in a square room of mirrors: those whose normal is in the beam."""
    axes = ring.mounts[:, 2] + ring.yaw
    off = np.abs(np.remainder(axes + 0.25 * math.pi, 0.5 * math.pi) - 0.25 * math.pi)
    return np.where(off < HALF, 2.0 + 0.5 * np.round(axes / (0.5 * math.pi)) % 2, math.inf)


@pytest.mark.covered
def test_mirrors_that_leave_all_beams_in_one_turn_are_one_event_and_not_many() -> None:
    """Four arrays of eight sensors, as on robots with arrays above each other, turn to and fro among mirrors."""
    ring = Ring(np.tile(MOUNTS[::3], (4, 1)))
    ring.step_m, most = 0.0, 0.0
    for k in range(120):
        ring.yaw = math.radians(0.5 * abs((k + 20) % 80 - 40))
        assert ring.fire(mirrored(ring)) == NOTHING
        most = max(most, ring.missed_nat)
    assert 0.0 < most < 0.6 * EVIDENCE_NAT


def test_a_ring_that_falls_silent_in_a_turn_is_named_nevertheless() -> None:
    """Mirrors do not leave the beams of all directions at once."""
    ring = after(0.5)
    for ring.yaw in np.radians(np.arange(0.0, 14.0, 2.0)):
        assert ring.fire(honest(ring.x)) == NOTHING
    assert VANISHED in [ring.fire(np.full(COUNT, math.inf)) for ring.yaw in np.radians([14.0, 16.0])]


def turned_to_and_fro(noise_m: float, frozen: bool) -> int:
    """Return what is found of three sensors ahead while the robot stands and then turns by 70° to either side."""
    ring, rng = (
        Ring(np.array([[0.0, 0.0, math.radians(angle)] for angle in (25.0, 0.0, -25.0)])),
        np.random.default_rng(4),
    )
    ring.step_m, found, ranges = 0.0, NOTHING, np.array([math.inf, math.inf, 1.44])
    for k in range(150):
        if k < 30 or not frozen:
            ranges = np.array([math.inf, math.inf, 1.44 + rng.normal(0.0, noise_m)])
        found = found or ring.fire(ranges)
        ring.yaw = math.radians(70.0 * math.sin(0.2 * max(0, k - 30)))
    return found


def test_a_frozen_echo_is_named_while_the_robot_turns_to_and_fro() -> None:
    """Of three sensors one has heard an echo. To and fro no other surface comes into view; noise comes anew."""
    assert turned_to_and_fro(0.014, frozen=True) == STUCK_SENSOR + 2
    assert turned_to_and_fro(0.014, frozen=False) == NOTHING
    assert turned_to_and_fro(0.0, frozen=True) == NOTHING, "a ring without noise may stand amid a round wall"


def test_the_only_sensor_that_hears_is_named_where_it_does_not_change() -> None:
    """A frozen ring that has heard one echo: what is silent on is not contradicted, and one sensor may be stuck."""
    ring, ranges = Ring(), np.full(COUNT, math.inf)
    ranges[1] = 2.0
    assert {ring.fire(ranges) for _ in range(30)} == {NOTHING, STUCK_SENSOR + 1}
    honest_ring = Ring()
    for k in range(30):
        ranges[1] = 2.0 - STEP_M * k
        assert honest_ring.fire(ranges) == NOTHING


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_a_ring_that_is_turned_is_named(quarter: int) -> None:
    """Without noise, what looks along the path beside it repeats its reading: such a sensor may be named before."""
    ring, found = Ring(), NOTHING
    while ring.x < 2.0 and found in (NOTHING, STUCK_SENSOR):
        found = ring.fire(honest(ring.x, quarter))
    assert found == TURNED + quarter - 1


def test_what_is_not_finite_and_what_did_not_fire_says_nothing() -> None:
    ring = after(0.5)
    before = ring.memory.tobytes()
    ring.x = math.nan
    assert ring.fire(honest(0.5)) == NOTHING
    assert ring.memory.tobytes() == before
    ring.x = 0.5
    assert ring.fire(np.full(COUNT, math.nan)) == NOTHING
    assert ring.missed_nat == 0.0


@pytest.mark.parametrize("is_wall", [False, True])
def test_a_sensor_that_repeats_alone_is_named_unless_one_beside_it_hears_a_wall_along_the_path(is_wall: bool) -> None:
    ring, found, wall = Ring(), set[int](), 2.0 * math.sin(MOUNTS[1, 2] + HALF)
    for _ in range(30):
        ranges = honest(ring.x)
        ranges[1] = 2.0
        for k in range(3, 10):
            nearest = min(max(0.5 * math.pi, MOUNTS[k, 2] - HALF), MOUNTS[k, 2] + HALF)
            ranges[k] = wall / math.sin(nearest) if is_wall else math.inf
        found.add(ring.fire(ranges))
    assert (STUCK_SENSOR + 1 in found) is not is_wall
    assert found <= {NOTHING, STUCK_SENSOR + 1}


def test_a_sensor_that_repeats_through_half_a_turn_on_the_spot_is_named() -> None:
    """There is no path that a wall may go along: one ahead of hobby8 that always read 1 m was named after 12 s."""
    ring, found = Ring(), set[int]()
    ring.step_m = 0.0
    for k in range(30):
        ring.yaw = 0.5 * HALF * k
        ranges = 3.0 + np.cos(ring.yaw + MOUNTS[:, 2])
        ranges[1] = 2.0
        found.add(ring.fire(ranges))
    assert found == {NOTHING, STUCK_SENSOR + 1}
