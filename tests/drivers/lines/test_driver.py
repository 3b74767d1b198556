"""The driver of robots that answer nothing keeps the latch, and names a robot that is silent; see the contract."""

from __future__ import annotations

from drivers.driver import LineState
from drivers.lines.driver import LineDriver
from drivers.lines.wire import Sample
from drivers.messages import Flags, Pose, Twist
from tests.drivers.lines.json_robot import ROBOT, wire

LINES = wire()
STILL = LINES.velocity(Twist(0.0, 0.0))
AHEAD = Twist(0.2, 0.0)


def said(t: float, v: float = 0.0, theta: float = 0.0) -> bytes:
    return LINES.say(Sample(Pose(0.0, 0.0, theta), Twist(v, 0.0), t))


def ready() -> LineDriver:
    driver = LineDriver(ROBOT, wire())
    driver.line_opened(0.0)
    driver.receive(said(0.0), 0.05)
    driver.outgoing(writable=True)
    driver.receive(said(0.1), 0.1)
    driver.take_received()
    return driver


def test_a_velocity_is_sent_after_a_release_only_and_within_the_limits() -> None:
    driver = ready()
    assert driver.state is LineState.READY
    driver.drive(AHEAD)
    assert driver.outgoing(writable=True) == b""
    driver.release()
    driver.drive(Twist(9.0, -9.0))
    limits = Twist(ROBOT.body.speed_max_m_s, -ROBOT.body.turn_max_rad_s)
    assert driver.outgoing(writable=True) == LINES.velocity(limits)


def test_a_halt_is_repeated_until_the_base_stands_and_on_the_next_line() -> None:
    driver = ready()
    driver.release()
    driver.halt()
    assert driver.outgoing(writable=False) == STILL
    assert driver.outgoing(writable=True) == b"", "not before it can have answered"
    driver.receive(said(0.2, v=0.1), 0.2)
    driver.tick(0.31)
    assert driver.outgoing(writable=True) == STILL
    driver.receive(said(0.4), 0.4)
    odometry = driver.take_received().odometry
    assert odometry is not None
    assert odometry.flags & Flags.LATCHED
    driver.tick(0.6)
    assert driver.outgoing(writable=True) == b""
    driver.line_closed()
    driver.line_opened(1.0)
    assert driver.outgoing(writable=True).startswith(STILL)


def test_a_robot_that_says_nothing_readable_is_down_with_a_reason() -> None:
    driver = LineDriver(ROBOT, wire())
    driver.line_opened(0.0)
    driver.receive(b"rest of a line\nnoise\nmore\n", 0.1)
    assert (driver.counts.frames, driver.counts.bad) == (0, 2)
    driver.tick(ROBOT.link.answer_max_s + 0.01)
    assert driver.state is LineState.DOWN
    assert driver.problem is not None
    assert "link.baud" in driver.problem
    driver.receive(said(0.0), 2.0)
    recovered: tuple[object, object] = (driver.state, driver.problem)
    assert recovered == (LineState.READY, None)


def test_noise_in_place_of_odometry_is_named() -> None:
    for bad in (0, 4):
        driver = ready()
        driver.receive(b"\xff\xfe\n" * 5, 0.15)
        driver.receive(said(0.2), 0.2)
        driver.receive(b"\xff\xfe\n" * bad, 0.3)
        driver.tick(0.21 + ROBOT.link.silence_max_s)
        assert driver.state is LineState.DOWN
        assert ("4 corrupt frames" in (driver.problem or "")) == (bad == 4)


def test_numbers_that_are_none_are_noise() -> None:
    driver = ready()
    driver.receive(b'{"t":NaN,"at":[0,0,0],"does":[0,0]}\n{"t":1,"at":[0,0,1e999],"does":[0,0]}\n', 0.2)
    driver.receive(b'{"t":1,"r":{"77":1.0}}\n{"t":1,"r":{"-1":1.0}}\n', 0.2)
    assert driver.counts.bad == 4
    assert driver.take_received().odometry is None
