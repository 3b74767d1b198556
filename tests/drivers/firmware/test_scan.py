"""Servos and triggers of the firmware: bearings in its echoes, pulses on the servo's pin, modules that need 20 µs."""

from __future__ import annotations

import pytest

from drivers.denning.frames import Ack, Echo2, Echo3, Hello, Ident, Nak, Pattern, Scan, Sweep
from drivers.denning.wire_units import sweep_bearing, wire_scan
from drivers.firmware.bundle import Board
from tests.drivers.firmware.conftest import Boards
from tests.drivers.firmware.talk import host, run

SERVO_PIN = 26
SERVO = f"""SENSORS = (("hc-sr04", 0, 4), ("hc-sr04", 1, 5))
MOUNTS = ((0, 0, 0), (-80, 0, 180))
SERVOS = ((0, {SERVO_PIN}, 1500, 2400, 31, 180),)
FIRING = "single"
"""
SWEEP = Sweep(sensor=0, first=-15708, step=1047, bearings=31, endless=0)


def pulse_us(bearing: int) -> float:
    """Return the pulse of the servo above, 900 µs longer a quarter turn to the left."""
    return 1500.0 + 900.0 * bearing / 15708.0


@pytest.mark.parametrize("board", ["pico", "esp32"])
def test_a_servo_scans_and_each_of_its_echoes_says_where_it_looked(boards: Boards, board: Board) -> None:
    robot = boards(board, SERVO)
    assert wire_scan(robot.config.ring) == (SWEEP,)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 50, 131, (0b01, 0b10))
    run(h, 0.3)
    assert (h.last(Ident).sensors, h.last(Ident).capabilities) == (2, 2)
    assert h.of(Echo2), "no bearings before they are asked for"
    asked = h.send(Scan, (SWEEP,))
    for _ in range(30):
        run(h, 0.1)
        duty = int(robot.ask("D", SERVO_PIN))
        bearings = [echo.bearings[0] for echo in h.of(Echo3) if echo.turned]
        following = sweep_bearing(SWEEP, len(bearings))
        assert duty * 20_000 / 65_535 == pytest.approx(pulse_us(following), abs=2.0)
        if h.of(Echo3) and not h.of(Echo3)[-1].turned:
            assert h.last(Echo3).bearings == (), "a sensor without a servo"
    assert h.last(Ack).of == asked
    assert bearings == [sweep_bearing(SWEEP, k) for k in range(len(bearings))]
    assert len(bearings) >= 28
    h.send(Pattern, 50, 131, (0b01, 0b10))
    run(h, 0.2)
    before = len(h.of(Echo3))
    run(h, 0.3)
    assert len(h.of(Echo3)) == before, "a new pattern ends the scan"
    assert int(robot.ask("H")) > 4000


def test_a_scan_beyond_the_servo_is_refused_and_a_ring_without_servos_does_not_know_it(boards: Boards) -> None:
    h = host(boards("pico", SERVO))
    h.send(Hello, 2)
    for wrong in (SWEEP._replace(first=-31416), SWEEP._replace(sensor=1), SWEEP._replace(bearings=1)):
        h.send(Scan, (wrong,))
        run(h, 0.1)
        assert h.last(Nak).code == 3
    plain = host(boards("pico"))
    plain.send(Hello, 2)
    plain.send(Scan, (SWEEP,))
    run(plain, 0.1)
    assert plain.last(Nak).code == 1


@pytest.mark.parametrize(("trigger_us", "counts"), [(10, {10}), (None, {10_000})])
def test_a_module_that_needs_a_longer_trigger_answers_its_echo_with_the_shipped_one(
    boards: Boards, trigger_us: int | None, counts: set[int]
) -> None:
    """Without it, it answers 1.7 mm."""
    short = "" if trigger_us is None else f"TRIGGER_US = {trigger_us}\n"
    robot = boards("pico", f"FAKE_TRIGGER_MIN_US = 18\n{short}")
    robot.ask("W", 0, 10_000)
    h = host(robot)
    h.send(Hello, 2)
    h.send(Pattern, 50, 131, (1,))
    run(h, 0.4)
    assert {round(echo.counts[0] / counts.copy().pop(), 1) for echo in h.of(Echo2)} == {1.0}
