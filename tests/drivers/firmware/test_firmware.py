"""The firmware in the real MicroPython, on a fake board, in virtual time: conversation, echoes, base, heap."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import cast

import pytest

from drivers.denning.codec import encode
from drivers.denning.device import DenningDevice
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import (
    Ack,
    Drive,
    Echo,
    Echo2,
    Halt,
    Hello,
    Ident,
    Listen,
    Nak,
    NakCode,
    Odom,
    Pattern,
    Release,
)
from drivers.driver import LineState
from drivers.firmware.bundle import Board
from drivers.messages import Firing, Flags, LinkCounts, Twist
from tests.drivers.device_host import Host
from tests.drivers.firmware.board import BoardRobot
from tests.drivers.firmware.conftest import Boards

UNIT_UM = 172
WINDOW = 131
PAIRS = (0b10001, 0b100010, 0b1000100, 0b10001000)
EIGHT = "SENSORS = (" + "".join(f'("hc-sr04", {i % 4}, {4 + i}), ' for i in range(8)) + ')\nFIRING = "opposite_pairs"'
"""Opposite ones of 8 sensors share a trigger pin; each has its own echo pin."""
MATRIX = "SENSORS = (" + "".join(f'("hc-sr04", {i % 3}, {4 + i // 3}), ' for i in range(24)) + ')\nFIRING = "octets"'
"""24 sensors: 3 trigger pins, 8 echo pins."""
OK, DEAD, HANGS = 0, 1, 2
STEP_S = 0.01
DEADMAN_S = 0.4


def host(robot: BoardRobot) -> Host:
    return Host(cast("DenningDevice", robot))  # of which it uses what both have


def run(h: Host, seconds: float, drive: tuple[int, int] | None = None) -> None:
    h.run(seconds, STEP_S, drive)


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


# Conversation.


@pytest.mark.parametrize(("board", "count"), [("pico", 12), ("esp32", 12)])
def test_the_driver_connects_drives_and_gets_twenty_firings_a_second(
    boards: Boards, board: Board, count: int
) -> None:
    robot = boards(board)
    driver, firings, run_s = DenningDriver(robot.config), list[Firing](), 0.0
    driver.line_opened(run_s)
    for step in range(400):
        run_s = (step + 1) * STEP_S
        driver.receive(robot.advance(run_s), run_s)
        driver.tick(run_s)
        if step % 5 == 0:
            driver.drive(Twist(0.2, 0.4))
        robot.receive(driver.outgoing(writable=True))
        received = driver.take_received()
        firings += received.firings
        assert received.notes == ()
    assert (driver.state, driver.problem) == (LineState.READY, None)
    assert driver.identity is not None
    assert (driver.identity.name, driver.identity.sensors) == ("ring", count)
    assert driver.counts == LinkCounts(frames=driver.counts.frames)
    assert 78 <= len(firings) <= 80, "20 a second, from the handshake on"
    last = firings[-1].pose
    assert last.theta == pytest.approx(0.4 * firings[-1].robot_s, abs=0.1)
    ways = [float(way) * 1e-3 for way in robot.ask("M").strip("()").split(",")]
    assert (ways[1] - ways[0]) / 0.15 == pytest.approx(last.theta, abs=0.05), "odometry is what the wheels did"


def test_both_versions_of_hello_and_no_other(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    for version in (1, 2, 3, 0):
        h.send(Hello, version)
    run(h, 0.05)
    one, two = h.of(Ident)
    assert (one.version, one.sensors, one.ring_radius_mm, one.deadman_ms, one.name) == (1, 8, 90, 400, "ring")
    assert (two.version, two.range_unit_um, two.capabilities) == (2, UNIT_UM, 0)
    assert one.boot_id == two.boot_id != 0
    assert [(nak.of, nak.code) for nak in h.of(Nak)] == [(2, 3), (3, 3)]


def test_what_cannot_be_done_is_refused_with_its_reason(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    h.send(Listen, ())  # before version 2 it would be unknown
    h.send(Hello, 1)
    h.send(Listen, ())
    h.send(Hello, 2)
    h.send(Listen, (0,))
    h.send(Pattern, 22, WINDOW, PAIRS)
    h.send(Pattern, 50, WINDOW, (1 << 8,))
    h.send(Pattern, 50, WINDOW, PAIRS)
    h.send(Pattern, 50, WINDOW, ())
    for raw in ("0310ff010101033b4e00", "02027f0101020300"):
        h.robot.receive(bytes.fromhex(raw))
    run(h, 0.05)
    assert [ack.of for ack in h.of(Ack)] == [0, 7, 8]
    assert [(nak.of, nak.code) for nak in h.of(Nak)] == [
        (2, NakCode.UNKNOWN_TYPE), (4, NakCode.VALUE_OUT_OF_RANGE), (5, NakCode.VALUE_OUT_OF_RANGE),
        (6, NakCode.VALUE_OUT_OF_RANGE),
    ]  # fmt: skip


def test_garbage_and_corrupt_frames_are_dropped_and_the_next_frame_is_obeyed(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    good = bytes.fromhex("051105e87d00")
    for bad in (b"\0\0\0", b"\xff\1\2\0", bytes(range(1, 256)), b"\0", good[:3] + b"\x11" + good[4:], b"\x01\0"):
        h.robot.receive(bad)
        run(h, 0.01)
    assert not h.of(Nak)
    assert not h.of(Ack)
    h.robot.receive(b"\0" + good)
    run(h, 0.01)
    assert [ack.of for ack in h.of(Ack)] == [5]
    assert h.decoder.bad == h.decoder.lost == 0


def test_every_split_of_a_frame_is_the_same(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    frame = encode(Pattern(9, 50, WINDOW, (1,)))
    for cut in range(1, len(frame), 3):
        h.robot.receive(frame[:cut])
        run(h, 0.01)
        h.robot.receive(frame[cut:])
        run(h, 0.01)
    assert {ack.of for ack in h.of(Ack)} == {9}
    assert len(h.of(Ack)) == len(range(1, len(frame), 3))


# Echoes.


@pytest.mark.parametrize("board", ["pico", "esp32"])
@pytest.mark.parametrize("steps", [12, 3])
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


# The base.


@pytest.mark.promise("P1")
def test_the_deadman_stops_the_base_within_half_a_second_and_ramps(
    boards: Boards, measured: Callable[[str], None]
) -> None:
    robot = boards("pico", EIGHT)
    h = host(robot)
    run(h, 2.0, drive=(400, 0))
    assert h.flags() == Flags.NONE
    assert h.last(Odom).v_mm_s == pytest.approx(400, abs=10)
    h.send(Drive, 400, 0)
    last_s = h.now
    while Flags.DEADMAN not in h.flags():
        run(h, STEP_S)
    flag_s, ways = h.now - last_s, ""
    assert flag_s <= 0.5
    while ways != (ways := robot.ask("M")):
        run(h, STEP_S)
    still_s = h.now - last_s
    assert still_s <= DEADMAN_S + 0.3
    run(h, 1.0)
    assert robot.ask("M") == ways
    h.send(Drive, 100, 0)
    run(h, 0.1)
    assert h.flags() == Flags.NONE
    measured(f"firmware of a ring, .4 m/s: deadman seen after {flag_s:.2f} s, wheels still after {still_s:.2f} s")


def test_halt_latches_until_release(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    run(h, 1.5, drive=(400, 0))
    halt = h.send(Halt)
    run(h, 0.25)
    assert halt in [ack.of for ack in h.of(Ack)]
    assert h.flags() == Flags.LATCHED
    assert abs(h.last(Odom).v_mm_s) <= 8, "at once: not by a ramp, which would take .8 s"
    refused = h.send(Drive, 300, 0)
    run(h, 0.3)
    assert [(nak.of, nak.code) for nak in h.of(Nak)] == [(refused, NakCode.LATCHED)]
    assert h.last(Odom).v_mm_s == 0
    h.send(Release)
    run(h, 0.6, drive=(200, 0))
    assert h.flags() == Flags.NONE
    assert h.last(Odom).v_mm_s > 100


@pytest.mark.parametrize(
    ("v", "w", "x", "heading"), [(300, 0, 0.6, 0.0), (-300, 0, -0.6, 0.0), (0, 1000, 0.0, 2.0), (0, -1000, 0.0, -2.0)]
)
def test_it_drives_as_it_is_asked_and_knows_where_it_is(
    boards: Boards, v: int, w: int, x: float, heading: float
) -> None:
    h = host(boards("pico", EIGHT))
    run(h, 2.0, drive=(v, w))
    run(h, 1.0, drive=(0, 0))
    odom = h.last(Odom)
    assert odom.x_0p1mm * 1e-4 == pytest.approx(x, abs=0.02)
    assert odom.heading_1em4rad * 1e-4 == pytest.approx(heading, abs=0.1)
    assert odom.ring_yaw_1em4rad == odom.heading_1em4rad
    assert (odom.v_mm_s, odom.w_mrad_s) == (0, 0)


def test_more_than_its_limits_is_driven_at_the_limits(boards: Boards) -> None:
    h = host(boards("pico", EIGHT))
    run(h, 2.0, drive=(3000, 0))
    assert h.last(Odom).v_mm_s == pytest.approx(400, abs=12)


def test_a_bumper_latches_and_cannot_be_released_while_pressed(boards: Boards) -> None:
    robot = boards("pico", "BUMPER = 22")
    h = host(robot)
    run(h, 1.0, drive=(300, 0))
    robot.ask("P", 22, 0)
    run(h, 0.1)
    assert h.flags() == Flags.LATCHED | Flags.BUMPER
    h.send(Release)
    run(h, 0.05)
    assert h.flags() == Flags.LATCHED | Flags.BUMPER
    robot.ask("P", 22, 1)
    h.send(Release)
    run(h, 0.05)
    assert h.flags() == Flags.NONE


def test_a_wheel_that_does_not_turn_latches_as_a_motor_fault(boards: Boards) -> None:
    robot = boards("pico", EIGHT)
    robot.ask("B", 1, 1)
    h = host(robot)
    run(h, 1.5, drive=(300, 0))
    assert h.flags() & (Flags.LATCHED | Flags.MOTOR_FAULT) == Flags.LATCHED | Flags.MOTOR_FAULT
    assert abs(h.last(Odom).x_0p1mm) < 2500


def test_an_encoder_wired_backward_stops_the_base_before_it_runs_away(boards: Boards) -> None:
    h = host(boards("pico", "ENCODERS = ((19, 18), (21, 20))\nFAKE_ENCODERS = ((18, 19), (20, 21))"))
    run(h, 1.5, drive=(200, 0))
    assert Flags.MOTOR_FAULT in h.flags()
    assert h.last(Odom).v_mm_s == 0
    assert abs(h.last(Odom).x_0p1mm) < 4000


def test_a_low_battery_is_reported_and_stops_nothing(boards: Boards) -> None:
    robot = boards("pico", "BATTERY = (26, 13.2, 6.6)")
    robot.ask("V", 32_000)
    h = host(robot)
    run(h, 0.5, drive=(200, 0))
    assert h.flags() == Flags.BATTERY_LOW
    robot.ask("V", 40_000)
    run(h, 0.1, drive=(200, 0))
    assert h.flags() == Flags.NONE


def test_an_error_in_the_control_stops_the_wheels_that_nothing_else_would_stop(boards: Boards) -> None:
    robot = boards("pico", "BATTERY = (26, 13.2, 6.6)")
    h = host(robot)
    run(h, 1.0, drive=(300, 0))
    robot.ask("V", -1)
    run(h, 0.4, drive=(300, 0))
    assert Flags.LATCHED | Flags.MOTOR_FAULT in h.flags()
    way = robot.ask("M")
    run(h, 0.5, drive=(300, 0))
    assert robot.ask("M") == way


def test_a_release_moves_nothing_before_the_next_drive(boards: Boards) -> None:
    robot = boards("pico", EIGHT)
    h = host(robot)
    h.send(Drive, 300, 0)
    h.send(Halt)
    h.send(Release)
    run(h, 0.3)
    assert h.flags() == Flags.NONE
    assert h.last(Odom).x_0p1mm == 0
    h.send(Halt)
    run(h, 0.05)
    refused = h.send(Drive, 300, 0)
    h.send(Release)
    run(h, 0.3)
    assert [nak.of for nak in h.of(Nak)] == [refused]
    assert h.last(Odom).x_0p1mm == 0


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


@pytest.mark.parametrize("seconds", [12, pytest.param(600, marks=pytest.mark.soak)])
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
