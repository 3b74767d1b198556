"""The firmware in the real MicroPython, on a fake board, in virtual time: its echoes, steps, clock and heap."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from drivers.denning.frames import (
    Echo,
    Echo2,
    Hello,
    Nak,
    Odom,
    Pattern,
)
from drivers.firmware.bundle import Board
from drivers.messages import Flags
from tests.drivers.firmware.conftest import Boards
from tests.drivers.firmware.talk import (
    DEAD,
    EIGHT,
    HANGS,
    MATRIX,
    OK,
    PAIRS,
    UNIT_UM,
    WINDOW,
    host,
    run,
)


def flight_us(sensor: int, firing: int) -> int:
    """Return the flight of the fake sensor's echoes; see `fake/board.py`."""
    return 200 + (7919 * sensor + 10_473 * firing) % 20_000


def sensors(mask: int) -> list[int]:
    return [i for i in range(24) if mask >> i & 1]


def errors_us(echoes: list[Echo2], triggers: list[int]) -> list[float]:
    """Return the error of each time of flight, µs; sensors with the same trigger pin fire together."""
    fired, errors = [0] * len(triggers), []
    for echo in echoes:
        for sensor, count in zip(sensors(echo.fired), echo.counts, strict=True):
            errors.append(count * UNIT_UM * 2 / 343 - flight_us(sensor, fired[sensor]))
        pulsed = {triggers[sensor] for sensor in sensors(echo.fired)}
        fired = [number + (trigger in pulsed) for number, trigger in zip(fired, triggers, strict=True)]
    return errors


# Echoes.


@pytest.mark.parametrize(
    ("board", "steps"),
    [
        ("pico", 12),
        ("esp32", 3),
        *(pytest.param(*one, marks=pytest.mark.soak) for one in (("esp32", 12), ("pico", 3))),
    ],
)
def test_echo_times_are_those_of_the_sensors_within_20_us(boards: Boards, board: Board, steps: int) -> None:
    """One sensor a step, or four of them that share a trigger pin."""
    robot = boards(board)
    masks = tuple(sum(1 << i for i in range(step, 12, steps)) for step in range(steps))
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 50, WINDOW, masks)
    run(h, 5.0)
    echoes = h.of(Echo2)
    assert len(echoes) >= 97
    assert [(echo.step, echo.fired) for echo in echoes] == [(k % steps, masks[k % steps]) for k in range(len(echoes))]
    errors = errors_us(echoes, robot.triggers)
    assert len(errors) == len(echoes) * 12 // steps
    assert max(map(abs, errors)) <= 20.0
    # Time: each step when it is due, by the robot's own clock.
    periods_us = [b.t_us - a.t_us for a, b in pairwise(echoes)]
    assert all(abs(period - 50_000) <= 2500 for period in periods_us)
    assert echoes[-1].t_us - echoes[0].t_us == pytest.approx(50_000 * (len(echoes) - 1), abs=2500)
    assert (h.decoder.bad, h.decoder.lost) == (0, 0)


def test_no_echo_a_dead_sensor_and_one_that_hangs(boards: Boards) -> None:
    robot = boards("pico", EIGHT)
    robot.ask("W", 0, 38_000)
    robot.ask("W", 4, 23_400)
    robot.ask("S", 1, DEAD)
    robot.ask("S", 5, HANGS)
    robot.ask("W", 2, 23_000)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 50, WINDOW, PAIRS)
    run(h, 1.0)
    by_step = {echo.step: echo.counts for echo in h.of(Echo2)}
    assert by_step[0] == (65535, 65535), "38 ms is nothing found; 23.4 ms is beyond the window of 23.28 ms"
    assert by_step[1] == (0, 0), "no pulse at all, and a pin that stays high"
    assert by_step[2][0] == pytest.approx(23_000 * 343 / 2 / UNIT_UM, abs=1)
    assert 0 < by_step[3][0] < 65535
    robot.ask("S", 1, OK)
    run(h, 0.5)
    assert all(0 < echo.counts[0] < 65535 for echo in h.of(Echo2)[-8:] if echo.step == 1), "and it is well again"


def test_version_1_reports_tenths_of_a_foot(boards: Boards) -> None:
    robot = boards("pico", EIGHT)
    for sensor, width in ((0, 10_000), (4, 300), (1, 38_000)):
        robot.ask("W", sensor, width)
    robot.ask("S", 5, DEAD)
    h = host(robot)
    h.send(Hello, 1)
    h.send(Pattern, 50, WINDOW, PAIRS)
    run(h, 0.5)
    assert h.of(Echo2) == []
    by_step = {echo.step: echo.tenths_ft for echo in h.of(Echo)}
    assert by_step[0] == (round(1.715 / 0.03048), 5)
    assert by_step[1] == (255, 0)


def test_a_new_pattern_starts_at_its_first_step_and_none_stops_the_ring(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    h.send(Hello, 2)
    h.send(Pattern, 50, WINDOW, PAIRS)
    run(h, 0.32)
    h.send(Pattern, 40, 100, (0b1,))
    run(h, 0.3)
    fired = [echo.fired for echo in h.of(Echo2)]
    assert fired[:7] == list((*PAIRS, *PAIRS)[:7])
    assert set(fired[7:]) == {1}
    assert len(fired) >= 12
    h.send(Pattern, 40, 100, ())
    run(h, 0.1)
    before = len(h.of(Echo2))
    run(h, 0.3)
    assert len(h.of(Echo2)) == before


def test_24_sensors_on_eleven_pins_fire_by_octets(boards: Boards) -> None:
    robot = boards("pico", MATRIX)
    h = host(robot)
    h.send(Hello, 2)
    octets = tuple(0x249249 << k for k in range(3))
    h.send(Pattern, 50, WINDOW, (0b11,))  # share an echo pin
    h.send(Pattern, 50, WINDOW, octets)
    run(h, 1.0)
    assert [nak.of for nak in h.of(Nak)] == [1]
    echoes = h.of(Echo2)
    assert len(echoes) >= 18
    assert max(map(abs, errors_us(echoes, robot.triggers))) <= 20.0
    assert h.decoder.lost == 0


def test_srf08_on_i2c(boards: Boards) -> None:
    ring = ", ".join(f'("srf08", {0x70 + k})' for k in range(4))
    robot = boards("pico", f"SENSORS = ({ring})\nI2C = (0, 4, 5)\nSTEP_PERIOD_S = 0.07")
    robot.ask("S", 3, DEAD)
    robot.ask("W", 1, 60_000)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 70, WINDOW, (0b0101, 0b1010))
    run(h, 1.0)
    by_step = [[echo.counts for echo in h.of(Echo2) if echo.step == step] for step in (0, 1)]
    assert len(by_step[0]) >= 6
    for number, counts in enumerate(by_step[0]):
        for sensor, reported in zip((0, 2), counts, strict=True):
            assert abs(reported * UNIT_UM * 2 / 343 - flight_us(sensor, number)) <= 1.0
    assert set(by_step[1]) == {(65535, 0)}, "nothing found, and one that does not answer"
    robot.ask("S", 3, OK)
    run(h, 0.5)
    assert h.of(Echo2)[-1].counts[-1] > 0


def test_maxbotix_sensors_by_their_own_scale_and_rest(boards: Boards) -> None:
    robot = boards("pico", 'SENSORS = (("mb10xx", 0, 4), ("mb12xx", 1, 5))\nFIRING = "single"')
    robot.ask("W", 0, 147 * 60)
    robot.ask("W", 1, 58 * 200)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 49, WINDOW, (0b01, 0b10))  # an XL needs 99 ms
    h.send(Pattern, 50, WINDOW, (0b01, 0b10))
    run(h, 0.5)
    assert [nak.of for nak in h.of(Nak)] == [1]
    by_step = {echo.step: echo.counts[0] * UNIT_UM * 1e-6 for echo in h.of(Echo2)}
    assert by_step == {0: pytest.approx(60 * 0.0254, abs=1e-3), 1: pytest.approx(2.0, abs=1e-3)}


# Endurance.


def test_the_clock_and_the_steps_pass_the_wrap_of_the_boards_counter(boards: Boards) -> None:
    h = host(boards("pico", f"{EIGHT}\nSTART_US = {2**30 - 2_000_000}"))
    h.send(Hello, 2)
    h.send(Pattern, 50, WINDOW, PAIRS)
    run(h, 4.0, drive=(100, 0))
    times = [odom.t_us for odom in h.of(Odom)]
    assert all(19_000 <= b - a <= 21_000 for a, b in pairwise(times))
    assert len(h.of(Echo2)) >= 78
    assert h.flags() == Flags.NONE


@pytest.mark.parametrize("seconds", [8, pytest.param(600, marks=pytest.mark.soak)])
def test_no_frame_is_lost_and_the_heap_stays_flat(boards: Boards, seconds: int) -> None:
    robot = boards("pico", EIGHT)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 50, WINDOW, PAIRS)
    run(h, 2.0, drive=(200, 500))
    free = int(robot.ask("H"))
    for _ in range(seconds // 4):
        run(h, 4.0, drive=(200, 500))
        assert int(robot.ask("H")) >= free - 256
        h.raw.clear()
    assert (h.decoder.bad, h.decoder.lost) == (0, 0)
    assert len(h.of(Echo2)) >= 20 * (seconds + 2) - 2
    assert len(h.of(Odom)) >= 50 * (seconds + 2) - 2
    assert not math.isnan(h.now)
