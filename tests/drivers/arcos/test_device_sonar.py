"""The sonar of an emulated Pioneer: arrays in parallel, partial lists, polling, cycles, and what is out of range."""

from __future__ import annotations

from itertools import pairwise

import pytest

from config.world import WallConfig, WorldConfig
from drivers.arcos.commands import CommandNumber
from drivers.arcos.device_sonar import SonarArrays
from drivers.arcos.frames import NO_ECHO_MM, Sip
from tests.drivers.arcos.device_host import Client

POLLING, SONAR = CommandNumber.POLLING, CommandNumber.SONAR


def numbers(client: Client, since: int = 0) -> list[list[int]]:
    return [[reading.number for reading in sip.sonar] for sip in client.of(Sip)[since:]]


def test_a_sip_holds_the_two_or_three_cycles_since_the_last_one() -> None:
    client = Client().opened()
    client.run(1.05)
    lists = numbers(client)
    assert {len(found) for found in lists[1:]} == {4, 6}
    heard = [number for found in lists for number in found]
    assert heard == [number for k in range(len(heard) // 2) for number in (k % 8, 8 + k % 8)]


def test_ranges_are_millimetres_and_beyond_five_metres_is_nothing() -> None:
    walls = (
        WallConfig(x1_m=-5.5, y1_m=-9.0, x2_m=-5.5, y2_m=9.0),
        WallConfig(x1_m=2.0, y1_m=-9.0, x2_m=2.0, y2_m=9.0),
    )
    client = Client(WorldConfig(wall=walls)).opened()
    client.run(0.6)
    ranges = {reading.number: reading.range_raw for sip in client.of(Sip) for reading in sip.sonar}
    assert ranges[3] == pytest.approx(2000 - 166, abs=1), "the wall lies within its beam"
    assert ranges[11] == NO_ECHO_MM


def test_a_polling_sequence_is_fired_by_each_array_in_its_own_order() -> None:
    client = Client().opened()
    client.send(POLLING, bytes((3, 1, 1, 16, 99)))
    client.run(0.5)
    client.heard.clear()
    client.run(1.0)
    heard = [number for found in numbers(client) for number in found]
    front, rear = [n for n in heard if n < 8], {n for n in heard if n >= 8}
    assert rear == {15}
    assert set(zip(front, front[1:], front[2:], strict=False)) == {(2, 0, 0), (0, 0, 2), (0, 2, 0)}
    client.send(POLLING, b"")
    client.run(0.3)
    client.heard.clear()
    client.run(0.5)
    assert numbers(client) == [[]] * 5
    client.send(CommandNumber.CLOSE)
    client.opened()
    client.run(0.5)
    assert set(numbers(client)[-1]) & set(range(1, 8)), "OPEN restores the flash's sequence"


def test_polling_by_an_integer_switches_the_sonar_off_as_one_client_wants() -> None:
    client = Client().opened()
    client.send(POLLING, 0)
    client.run(0.3)
    client.heard.clear()
    client.run(0.5)
    assert numbers(client) == [[]] * 5


@pytest.mark.parametrize(
    ("values", "flags", "arrays"),
    [
        ((0,), 0x00, set()),
        ((0, 1), 0x1E, {0, 1}),
        ((2,), 0x1C, {1}),
        ((4,), 0x1A, {0}),
        ((0, 5), 0x04, {1}),
        ((99,), 0x1E, {0, 1}),
    ],
)
def test_arrays_are_switched_one_by_one(values: tuple[int, ...], flags: int, arrays: set[int]) -> None:
    client = Client().opened()
    for value in values:
        client.send(SONAR, value)
    client.run(0.3)
    client.heard.clear()
    client.run(0.5)
    assert client.sip().flags & 0x1E == flags
    assert {number // 8 for found in numbers(client) for number in found} == arrays


@pytest.mark.parametrize(("cycle_ms", "per_second"), [(20, 100), (120, 16), (1, 1000), (250, 16)])
def test_the_cycle_can_be_changed_within_its_bounds(cycle_ms: int, per_second: int) -> None:
    client = Client().opened()
    client.send(CommandNumber.SONARCYCLE, cycle_ms)
    client.run(0.5)
    client.heard.clear()
    client.run(1.0)
    count = sum(len(found) for found in numbers(client))
    most = 720  # as fit into ten SIPs
    assert count == pytest.approx(min(most, per_second), abs=4)


def test_a_short_cycle_hears_no_farther_than_sound_goes_in_it() -> None:
    wall = WallConfig(x1_m=4.0, y1_m=-9.0, x2_m=4.0, y2_m=9.0)
    client = Client(WorldConfig(wall=(wall,))).opened()
    client.send(CommandNumber.SONARCYCLE, 20)
    client.run(1.0)
    client.heard.clear()
    client.run(0.5)
    assert {r.range_raw for sip in client.of(Sip) for r in sip.sonar if r.number == 3} == {NO_ECHO_MM}


def test_firings_are_a_cycle_apart_and_end_with_the_session() -> None:
    arrays = SonarArrays(range(24), 40)
    assert (arrays.next_us, arrays.fire(0)) == (None, [])
    arrays.start(1000)
    times = list[int]()
    for k in range(10):
        times.append(arrays.next_us or 0)
        assert arrays.fire(times[-1]) == [k % 8, 8 + k % 8, 16 + k % 8]
    assert times[0] == 1000
    assert {b - a for a, b in pairwise(times)} == {40_000}
