"""A robot that lies: floods, false acknowledgements, a wrong clock, resets of its odometry, and a hostile name.

The driver's memory and its work in a cycle stay bounded, nothing moves because of a lie, and what can be decided ends
in a stop or a message for the operator instead of a wrong place.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace

import pytest

from drivers.denning.frames import Ack, Drive, Echo, Halt, Hello, Nak, Odom, Pattern, RobotFrame
from drivers.driver import LineState
from drivers.messages import Twist
from drivers.robot_clock import Jump, RobotClock
from tests.drivers.driver_harness import IDENT, ODOM, PERIOD_US, DriverHarness, only

pytestmark = pytest.mark.promise("P22")

SECONDS = 5
FLOOD = 40
"""Echoes for each period of the odometry, of which the pattern has 0.4."""
DRIVEN = Twist(0.1, 0.0)


def test_a_flood_of_echoes_reaches_the_cycle_at_a_bounded_rate(
    harness: DriverHarness, measured: Callable[[str], None]
) -> None:
    """Valid ones, each with a time of its own: no more than a burst and four times the pattern's own rate."""
    t_us, sent, most, passed, notes = 0, 0, 0, 0, list[str]()
    for k in range(50 * SECONDS):
        t_us += PERIOD_US
        harness.pass_time(0.02)
        harness.odom(t_us)
        for i in range(FLOOD):
            harness.send(Echo(0, t_us - PERIOD_US + (i + 1) * PERIOD_US // FLOOD, 0, 0xFFFFFF, (50,) * 24))
        sent += FLOOD
        if k % 5 == 4:  # two cycles
            heard = harness.robot.take_received()
            most, passed = max(most, len(heard.firings)), passed + len(heard.firings)
            notes += heard.notes
    assert harness.state() is LineState.READY
    assert most <= 64 + 8
    assert passed <= 64 + 4 * 20 * SECONDS
    assert passed >= 20 * SECONDS, "the ring's own rate passes"
    assert len(notes) == 1
    assert "more firings than its pattern has" in notes[0]
    measured(f"{sent:,} echoes in {SECONDS} s: {passed:,} firings pass, at most {most} between two cycles")


def test_a_flood_of_odometry_keeps_a_bounded_history(harness: DriverHarness) -> None:
    t_us = 0
    for _ in range(5000):
        t_us += 10
        harness.odom(t_us)
    assert harness.state() is LineState.READY
    assert len(harness.robot.stamper._history) <= 4096
    assert harness.robot.take_received().odometry is not None


@pytest.mark.parametrize("period_ms", [0, 1, 20, 65_535])
def test_any_claimed_odometry_period_keeps_a_bounded_history(period_ms: int) -> None:
    harness = DriverHarness()
    harness.ident = replace(IDENT, odometry_period_ms=period_ms)
    harness.open()
    harness.handshake()
    for k in range(4200 if period_ms == 0 else 100):
        harness.odom(1000 * k)
    assert 64 <= len(harness.robot.stamper._history) <= 4096


def drive_with_clock(harness: DriverHarness, speed: float, seconds: float) -> tuple[float | None, list[str]]:
    """Drive on a robot whose clock runs at `speed`; return when the line went down, and the notes."""
    t_us, notes, began_s = 0.0, list[str](), harness.now
    while harness.now < began_s + seconds:
        t_us += speed * PERIOD_US
        harness.now += 0.02
        harness.odom(round(t_us))
        harness.robot.drive(DRIVEN)
        harness.robot.tick(harness.now)
        harness.answer()
        notes += harness.robot.take_received().notes
        if harness.state() is LineState.DOWN:
            return harness.now - began_s, notes
    return None, notes


@pytest.mark.parametrize("speed", [1.05, 1.5, 45.0])
def test_a_fast_clock_ends_the_drive(harness: DriverHarness, speed: float, measured: Callable[[str], None]) -> None:
    """Its ranges and speeds are measured by it: it would see and go wrong by as much."""
    down_s, notes = drive_with_clock(harness, speed, 60.0)
    assert down_s is not None
    assert down_s <= 36.0
    assert notes == []
    assert f"clock runs {speed - 1.0:.1%} too fast" in (harness.robot.problem or "")
    harness.robot.drive(DRIVEN)
    assert only(harness.received(), Drive) == []
    measured(f"a clock {100.0 * (speed - 1.0):g} % fast: line down after {down_s:.1f} s, cause named")


def test_a_slow_clock_is_reported(harness: DriverHarness) -> None:
    down_s, notes = drive_with_clock(harness, 0.95, 140.0)
    assert down_s is None
    assert len(notes) == 1, "after two periods"
    assert "clock runs 5.0% too slow" in notes[0]


@pytest.mark.parametrize("speed", [0.999, 1.0, 1.001])
@pytest.mark.parametrize("delay_s", [0.0, 0.35])
def test_a_clock_like_any_other_is_not_complained_about(speed: float, delay_s: float) -> None:
    """For ten minutes, the readings at times delayed on the way."""
    rng, clock, run_s, late_until_s = random.Random(1), RobotClock(), 0.0, 0.0
    while run_s < 600.0:
        run_s += 0.02
        if rng.random() < 1 / 300:
            late_until_s = run_s + delay_s
        assert not isinstance(clock.read(round(1e6 * speed * run_s), max(run_s, late_until_s)), Jump)
        assert clock.rate_error is None


@pytest.mark.parametrize("stop_s", [1.5, 3.0, 30.0, 200.0])
@pytest.mark.parametrize("at_s", [0.0, 5.0, 30.0, 100.0])
def test_readings_that_waited_for_a_stopped_process_are_late_and_not_fast(at_s: float, stop_s: float) -> None:
    """All are read at once afterwards, the oldest first; of those before the very first one, 3 s are kept."""
    clock, t_s = RobotClock(), 0.0
    while t_s < at_s + stop_s + 300.0:
        t_s += 0.02
        waits = at_s < t_s <= at_s + stop_s
        if waits and at_s == 0.0 and t_s < stop_s - 3.0:
            continue
        clock.read(round(1e6 * t_s), at_s + stop_s if waits else t_s)
        assert clock.rate_error is None, t_s


def test_a_robot_that_stood_still_for_a_moment_is_not_called_slow() -> None:
    clock, lost_s = RobotClock(), 0.0
    for k in range(20_000):
        lost_s += 5.0 * (k in {3000, 12_000})
        clock.read(round(1e6 * (0.02 * k)), 0.02 * k + lost_s)
        assert clock.rate_error is None, k


@pytest.mark.parametrize("step_us", [-PERIOD_US, -1, -3_000_000_000])
def test_a_clock_that_runs_backwards_is_a_restart_each_time(harness: DriverHarness, step_us: int) -> None:
    """Each restart is reported to the cycle, which stops; nothing piles up, and no firing has a time of before."""
    t_us, rebooted, passed = 3_600_000_000, 0, 0
    for _ in range(100):
        t_us += step_us
        harness.pass_time(0.02)
        harness.odom(t_us)
        harness.send(Echo(0, t_us % 2**32, 0, 1, (10,)))
        harness.robot.drive(DRIVEN)
        frames = harness.answer() + harness.answer()
        assert len(frames) <= 3
        heard = harness.robot.take_received()
        rebooted, passed = rebooted + heard.rebooted, passed + len(heard.firings)
    assert rebooted >= 30
    assert harness.robot.stamper.late_echoes.count + passed <= 100


def pose_leaps(harness: DriverHarness, every: int) -> tuple[float, list[str]]:
    """Leap by kilometres with every so manieth sample; return the farthest pose passed on, and the notes."""
    rng, t_us, far_m, notes = random.Random(2), 0, 0.0, list[str]()
    x = y = 0
    for k in range(420):
        t_us += PERIOD_US
        harness.pass_time(0.02)
        if k > 20 and k % every == 0:
            x, y = rng.randint(-(2**31), 2**31 - 1), rng.randint(-(2**31), 2**31 - 1)
        harness.odom(t_us, x_0p1mm=x, y_0p1mm=y)
        harness.answer()
        harness.answer()
        heard = harness.robot.take_received()
        notes += heard.notes
        if heard.odometry is not None:
            far_m = max(far_m, math.hypot(heard.odometry.pose.x, heard.odometry.pose.y))
    return far_m, notes


@pytest.mark.parametrize("every", [1, 2, 3, 7, 200])
def test_odometry_that_leaps_by_kilometres_moves_no_pose(harness: DriverHarness, every: int) -> None:
    """However often: the base stands by its own speeds, and no base moves so far at once."""
    far_m, notes = pose_leaps(harness, every)
    assert far_m < 0.001
    assert notes
    assert all("the odometry jumped" in note for note in notes)


NEVER_SENT = 200


def sent_seq(frames: list[object]) -> int:
    """Return the sequence number of the last frame sent."""
    seq: int = frames[-1].seq  # type: ignore[attr-defined]
    return seq


def test_only_an_acknowledgement_of_a_try_that_was_sent_counts(harness: DriverHarness) -> None:
    """One of a number that was never sent, of another command or of a DRIVE leaves a HALT to be sent again."""
    harness.robot.drive(DRIVEN)
    drive = sent_seq(list(harness.received()))
    harness.robot.release()
    release = sent_seq(list(harness.received()))
    harness.send(Ack(0, release), Ack(0, release))
    harness.robot.halt()
    (halt,) = harness.received()
    for seq in range(256):
        if seq != halt.seq:
            harness.send(Ack(0, seq), Nak(0, seq, 4))
    assert {drive, release, NEVER_SENT} <= set(range(256)) - {halt.seq}
    harness.robot.drive(DRIVEN)
    assert only(harness.received(), Drive) == [], "no acknowledgement of it: nothing drives past a HALT"
    harness.pass_time(0.2)
    assert len(only(harness.received(), Halt)) == 1
    harness.send(Ack(0, halt.seq), Ack(0, halt.seq))
    harness.robot.drive(DRIVEN)
    assert len(only(harness.received(), Drive)) == 1


def test_a_hello_is_answered_by_ident_alone() -> None:
    """An acknowledgement of it neither ends the handshake nor the attempts: the robot is greeted until it answers."""
    harness = DriverHarness()
    harness.open()
    hellos = 0
    for _ in range(500):
        for frame in harness.received():
            hellos += isinstance(frame, Hello)
            harness.send(Ack(0, frame.seq))
        harness.odom(1_000_000)
        harness.pass_time(0.01)
        harness.robot.drive(DRIVEN)
    assert hellos >= 8
    assert harness.state() is LineState.DOWN
    assert harness.robot.take_received().odometry is None
    harness.pass_time(0.5)
    harness.handshake()


def test_a_pattern_that_is_acknowledged_before_it_is_sent_is_not_in_force() -> None:
    harness = DriverHarness()
    harness.open()
    harness.send(*(Ack(0, seq) for seq in range(256)))
    harness.answer()
    harness.send(*(Ack(0, seq) for seq in range(256)))
    assert harness.state() is LineState.HANDSHAKE
    (pattern,) = harness.received()
    assert isinstance(pattern, Pattern)
    harness.send(Ack(0, pattern.seq))
    assert harness.state() is LineState.READY


def test_ident_again_and_again_with_another_ring_each_time(harness: DriverHarness) -> None:
    """The line goes down with the cause, and each one after that is another wrong robot."""
    for sensors in (8, 0, 255, 23, 25) * 10:
        harness.send(replace(IDENT, sensors=sensors))
        assert harness.state() is LineState.DOWN
        assert f"has {sensors} sensors and the robot file 24" in (harness.robot.problem or "")
        harness.robot.drive(DRIVEN)
        assert only(harness.received(), Drive) == []
    assert len(harness.robot._commands) == 1


def test_ident_again_and_again_with_another_boot_id_each_time(harness: DriverHarness) -> None:
    sent = 0
    for boot_id in range(200):
        harness.send(replace(IDENT, boot_id=boot_id))
        assert harness.state() is LineState.HANDSHAKE
        harness.robot.drive(DRIVEN)
        frames = harness.received()
        assert only(frames, Drive) == []
        sent += len(frames)
    assert sent == 200, "one PATTERN each"
    assert harness.robot.take_received().rebooted


NAMES = ["\x1b[2J\x1b[31mok", "a\nSTATUS=fine", "\x07\x08\r", "\u202egnp.exe", "\x9b1A", "<img src=x>", "\x7f"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sensors", [24, 16])
def test_no_name_is_passed_on_with_control_characters(name: str, sensors: int) -> None:
    harness = DriverHarness()
    harness.ident = replace(IDENT, name=name, sensors=sensors)
    harness.open()
    harness.answer()
    identity = harness.robot.identity
    for text in (harness.robot.problem, None if identity is None else identity.name):
        assert text is None or text.isprintable()
    assert (identity is None) == (sensors != 24)


def test_random_frames_never_drive_it_nor_grow_the_driver(measured: Callable[[str], None]) -> None:
    """Any frames with any values in any order: no exception, bounded memory, no DRIVE before a whole handshake."""
    rng = random.Random(6)
    harness = DriverHarness()
    harness.open()
    frames = 0
    for _ in range(3000):
        harness.send(any_frame(rng))
        frames += 1
        harness.pass_time(rng.choice((0.0, 0.001, 0.02, 0.3)))
        harness.robot.drive(DRIVEN)
        state = harness.state()
        sent = harness.received(writable=rng.random() < 0.9)
        assert state is LineState.READY or only(sent, Drive) == []
        assert len(sent) <= 5
        robot = harness.robot
        assert len(robot._commands) <= 4
        assert robot.firings_waiting <= 1024
        assert len(robot.stamper._held) <= 64
        assert len(robot.stamper._history) <= 4096
        if rng.random() < 0.1:
            heard = robot.take_received()
            assert len(heard.notes) <= 16
            assert all(note.isprintable() for note in heard.notes)
        assert (robot.problem or "").isprintable()
    measured(f"{frames:,} random frames: no exception, at most 4 commands and 1,024 firings kept")


def any_frame(rng: random.Random) -> RobotFrame:
    """Return a valid frame with any content."""
    extreme = rng.choice((0, 1, -1, 2**31 - 1, -(2**31)))
    match rng.randrange(6):
        case 0:
            return replace(
                IDENT, sensors=rng.choice((24, 24, 24, 0, 255)), boot_id=rng.choice((1, 2)), name=rng.choice(NAMES),
                deadman_ms=rng.choice((0, 500, 65_535)), odometry_period_ms=rng.choice((0, 20, 65_535)),
            )  # fmt: skip
        case 1 | 2:
            return (
                Ack(0, rng.randrange(256)) if rng.random() < 0.7 else Nak(0, rng.randrange(256), rng.randrange(256))
            )
        case 3:
            mask = rng.getrandbits(24)
            return Echo(
                0, rng.getrandbits(32), 0, mask, tuple(rng.choice((0, 5, 254, 255)) for _ in range(mask.bit_count()))
            )
        case _:
            t_us, half, byte = rng.getrandbits(32), 2**15, 256
            any_odometry = Odom(
                0, t_us, extreme, min(-extreme, 2**31 - 1), extreme, extreme, rng.randrange(-half, half),
                rng.randrange(-half, half), rng.randrange(byte), rng.randrange(byte),
            )  # fmt: skip
            return any_odometry if rng.random() < 0.5 else replace(ODOM, t_us=rng.getrandbits(32))
