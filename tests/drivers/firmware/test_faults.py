"""The firmware in the real MicroPython, on a fake board, in virtual time: conversation, base, and their faults."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.denning.codec import encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import (
    Ack,
    Drive,
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
from tests.drivers.firmware.conftest import Boards
from tests.drivers.firmware.talk import (
    DEADMAN_S,
    EIGHT,
    PAIRS,
    STEP_S,
    UNIT_UM,
    WINDOW,
    host,
    run,
)

# Conversation.


@pytest.mark.parametrize(("board", "count"), [pytest.param("pico", 12, marks=pytest.mark.soak), ("esp32", 12)])
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
    ("v", "w", "x", "heading"),
    [
        (-300, 0, -0.6, 0.0),
        (0, 1000, 0.0, 2.0),
        *(pytest.param(*one, marks=pytest.mark.soak) for one in ((300, 0, 0.6, 0.0), (0, -1000, 0.0, -2.0))),
    ],
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
