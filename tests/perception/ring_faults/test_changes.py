"""What a change that all sensors have in common explains better than an honest ring does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.records import Records, records, zeros
from perception.ring_faults.changes import (
    EXCHANGED,
    LENGTHENED,
    NO_CHANGE,
    ROUND_M,
    Expected,
    density,
    density_if_turned,
    expect,
    source,
    weigh_changes,
)  # fmt: skip
from perception.ring_faults.memory import NO_ECHO_M, EchoTrace, mark

COUNT = 16
AXES = np.arange(COUNT) * math.tau / COUNT
MOUNTS = np.stack([0.2 * np.cos(AXES), 0.2 * np.sin(AXES), AXES], axis=1)
HALF, TOLERANCE, REACH, MISSED = math.radians(12.0), 0.005, 5.0, 0.1
ROOM: Floats = np.random.default_rng(3).permutation(np.linspace(1.0, 4.0, COUNT))
"""Ranges that no two sensors share, m."""
ENOUGH_NAT = 18.0


def looks(before: Floats, latest: Floats, moved_m: float = 0.1, turned_rad: float = 0.0) -> Records[EchoTrace]:
    """Return the memory of a ring that moved ahead and turned between two looks; infinite ranges are silences."""
    echoes = records(EchoTrace, zeros(EchoTrace, COUNT))
    for k in range(COUNT):
        then, now = (r[k] if math.isfinite(r[k]) else NO_ECHO_M for r in (before, latest))
        echoes[k].is_compared = 1
        mark(echoes[k].before, then, 0.0, 0.0, AXES[k], 0.0)
        mark(echoes[k].latest, now, moved_m, 0.0, AXES[k] + turned_rad, moved_m)
    return echoes


def weighed(echoes: Records[EchoTrace], missed: float = MISSED, turning: float = MISSED) -> tuple[int, float]:
    expected = records(Expected, zeros(Expected, COUNT))
    return weigh_changes(MOUNTS, HALF, TOLERANCE, REACH, (missed, turning), echoes, expected)


def moved(ranges: Floats, moved_m: float = 0.1) -> Floats:
    """Return what a ring hears of surfaces square to its sensors once it has moved ahead."""
    return ranges - moved_m * np.cos(AXES)


def test_what_changes_as_the_motion_says_is_no_change() -> None:
    assert weighed(looks(ROOM, moved(ROOM))) == (NO_CHANGE, 0.0)
    assert weighed(looks(ROOM, ROOM)) == (NO_CHANGE, 0.0), "rough walls along the path come no nearer"


def test_a_length_that_all_ranges_have_in_common_is_found() -> None:
    for length in (-0.6, -0.3, 0.3, 0.4572, 1.2192):
        change, nats = weighed(looks(ROOM, moved(ROOM) + length))
        assert change == LENGTHENED
        assert nats > ENOUGH_NAT


def test_ranges_that_a_length_puts_beyond_reach_are_silent_and_those_at_zero_stay() -> None:
    longer = moved(ROOM) + 1.2192
    assert weighed(looks(ROOM, np.where(longer > REACH, math.inf, longer)))[0] == LENGTHENED
    shorter = np.maximum(moved(ROOM) - 1.5, 0.0)
    assert weighed(looks(ROOM, shorter))[0] == LENGTHENED


@pytest.mark.parametrize("part", [2, 4, 6, 8, 12, 14])
def test_what_another_sensor_heard_before_is_found(part: int) -> None:
    change, nats = weighed(looks(ROOM, np.roll(ROOM, -part)))
    assert change == EXCHANGED
    assert nats > ENOUGH_NAT


def exchanged_but(kept: Floats) -> Records[EchoTrace]:
    """Return looks in which most sensors hear what the opposite ones heard; 5 to 7, opposite to none, hear `kept`."""
    latest = np.roll(ROOM, -8)
    latest[5:8] = kept
    echoes = looks(ROOM, latest)
    for k in range(13, 16):
        echoes[k].is_compared = 0
    return echoes


def test_sensors_that_hear_as_before_speak_against_a_turn_also_where_none_looked_before() -> None:
    """A hobby8 has none opposite to some, and an honest one in an office was stopped: its others did not count."""
    says_nothing = weighed(exchanged_but(np.array([4.9, 4.9, 4.9])))
    assert says_nothing[0] == EXCHANGED
    as_before = weighed(exchanged_but(moved(ROOM)[5:8]))
    assert as_before[1] < says_nothing[1] - 6.0


def test_an_honest_sensor_that_misses_hears_what_is_near_or_stood_beside() -> None:
    """A wall that the beam grazes comes nearer faster; a stray before leads to expect nothing true."""
    spacing = math.tau / COUNT

    def likely(r: float, half: float) -> float:
        latest = ROOM.copy()
        latest[4] = r
        echoes = looks(ROOM, latest, 0.0)
        return density_if_turned(4, 0.0, MISSED, half, TOLERANCE, REACH, MOUNTS, echoes)

    low, high = expect(4, 4, 0.0, HALF, TOLERANCE, MOUNTS, looks(ROOM, ROOM, 0.0))
    chance = 0.25 * MISSED / REACH
    assert likely(4.9, HALF) == pytest.approx(chance)
    assert likely(high + 0.5 * (high - low), HALF) > 2.0 * chance
    assert likely(ROOM[5], 0.4 * spacing) == pytest.approx(chance)
    assert likely(ROOM[5], 0.6 * spacing) > 2.0 * chance, "beams overlap"
    assert likely(0.5 * (low + high), HALF) == density(0.5 * (low + high), low, high, REACH, MISSED)
    assert likely(math.inf, HALF) == density(NO_ECHO_M, low, high, REACH, MISSED)


def test_a_robot_that_turns_hears_in_a_sensor_what_another_one_heard() -> None:
    spacing = math.tau / COUNT
    turned = looks(ROOM, np.roll(ROOM, -1), 0.0, spacing)
    assert [source(k, 0.0, HALF, turned) for k in range(COUNT)] == [*range(1, COUNT), 0]
    assert weighed(turned) == (NO_CHANGE, 0.0)
    longer = looks(ROOM, np.roll(ROOM, -1) + 0.4572, 0.0, spacing)
    assert weighed(longer)[0] == LENGTHENED


def test_the_sensor_itself_comes_before_one_that_looks_the_same_way() -> None:
    echoes = looks(ROOM, ROOM)
    mark(echoes[1].before, 2.0, 0.0, 0.0, AXES[5], 0.0)
    assert source(5, 0.0, HALF, echoes) == 5
    echoes[5].is_compared = 0
    assert source(5, 0.0, HALF, echoes) == 1


def test_what_changes_for_a_few_sensors_or_falls_silent_is_no_common_change() -> None:
    few = moved(ROOM)
    few[:5] -= 0.5
    assert weighed(looks(ROOM, few)) == (NO_CHANGE, 0.0)
    rng = np.random.default_rng(1)
    for _ in range(20):
        silent = np.where(rng.random(COUNT) < 0.7, math.inf, moved(ROOM))
        assert weighed(looks(ROOM, silent))[1] < 0.5 * ENOUGH_NAT


def test_a_ring_that_often_misses_what_it_heard_gives_less_evidence() -> None:
    longer = looks(ROOM, moved(ROOM) + 0.4572)
    nats = [weighed(longer, missed)[1] for missed in (0.05, 0.2, 0.5)]
    assert nats == sorted(nats, reverse=True)


def test_a_robot_that_turns_fast_among_mirrors_hears_other_surfaces_at_once() -> None:
    """Turned by most of its beam, an AmigoBot heard as much elsewhere as the shares of misses of a turn expect."""
    turned = looks(ROOM, np.roll(ROOM, -4), 0.0, 0.8 * HALF)
    assert weighed(turned, turning=0.4)[1] < 0.7 * weighed(turned)[1]
    steady = looks(ROOM, np.roll(ROOM, -4), 0.0)
    assert weighed(steady, turning=0.4) == weighed(steady)
    nats = [weighed(looks(ROOM, np.roll(ROOM, -4), 0.0, share * HALF), turning=0.4)[1] for share in (0.05, 0.2)]
    assert weighed(steady)[1] > nats[0] > nats[1], "mirrors leave a beam in proportion to its turn"


def test_what_was_heard_too_long_ago_or_not_twice_says_nothing() -> None:
    far = looks(ROOM, ROOM + 1.0, ROUND_M + 0.01)
    assert weighed(far) == (NO_CHANGE, 0.0)
    once = looks(ROOM, ROOM + 1.0)
    for k in range(COUNT):
        once[k].is_compared = 0
    assert weighed(once) == (NO_CHANGE, 0.0)


def test_ranges_count_from_each_sensors_own_place() -> None:
    mounts = MOUNTS.copy()
    mounts[4] = 0.0, 0.5, AXES[4]
    echoes = looks(np.full(COUNT, 2.0), np.full(COUNT, 2.0), 0.0)
    low, high = expect(0, 4, -AXES[4], HALF, TOLERANCE, mounts, echoes)
    assert 0.5 * (low + high) == pytest.approx(2.0 + 0.2 - 0.5)
    assert expect(-1, 4, 0.0, HALF, TOLERANCE, mounts, echoes) == (-1.0, -1.0)


def test_a_density_sums_to_one() -> None:
    for low, high in ((1.0, 1.4), (-1.0, -1.0), (6.0, 6.2)):
        ranges = np.linspace(0.0, REACH, 100_001)
        echoes = sum(density(r, low, high, REACH, MISSED) for r in ranges.tolist()) * (ranges[1] - ranges[0])
        assert density(-1.0, low, high, REACH, MISSED) + echoes == pytest.approx(1.0, abs=1e-3)
