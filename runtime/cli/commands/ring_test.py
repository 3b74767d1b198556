"""`echolocate ring-test`: each sensor by itself, and the motors."""

from __future__ import annotations

import asyncio
import math
import statistics
import sys
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from serial.tools.list_ports import comports

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_settings
from config.robot import FiringConfig, RobotConfig
from drivers.driver import LineState
from drivers.link import Link
from drivers.messages import Flags, Floats, Odometry, Twist
from drivers.registry import make_driver
from runtime.cycle.connection import POLL_S, Connection

SLACK_S: Final = 2.0
"""How much longer than its firings need the test of the sensors may take, s."""
WARNING_S: Final = 3.0
MOVE_S: Final = 1.0
SETTLE_S: Final = 0.5
"""Time from the warning to the first motion, of each motion, and after it, s."""
UNSTEADY_M: Final = 0.1
"""Ranges of a robot that stands still do not spread farther than this, m, apart from a tenth of them at each end."""
ANSWERS_MIN: Final = 0.8
MOTIONS: Final = (
    ("forward", Twist(0.1, 0.0)),
    ("backward", Twist(-0.1, 0.0)),
    ("left (counter-clockwise from above)", Twist(0.0, 0.6)),
    ("right", Twist(0.0, -0.6)),
)
WAY_MIN, WAY_MAX = 0.4, 1.6
"""Least and greatest way by the odometry, of what was asked for; a base also has to speed up and to stop."""


def check_ring(port: str | None, *, robot: str | None, rounds: int, move: bool) -> int:
    """Test the ring, and the motors if asked to; print what was found, and return the exit code.

    Raises
    ------
    UserError
        There is no robot, or it does not answer.
    """
    if rounds < 1:
        raise UserError("--rounds: must be at least 1", WRONG_CALL)
    config = load_settings(None, (), robot=robot)
    ring = config.ring
    firing = FiringConfig(preset="single", step_period_s=ring.firing.step_period_s, window_m=ring.firing.window_m)
    link = config.link.model_copy(update={"port": port or config.link.port or only_port()})
    single = config.model_copy(update={"ring": ring.model_copy(update={"firing": firing}), "link": link})
    return asyncio.run(RingTest(single, sys.stdout.write).run(rounds, move=move))


def only_port() -> str:
    """Return the serial port of this computer.

    Raises
    ------
    UserError
        There is none, or more than one.
    """
    ports = sorted(found.device for found in comports())
    if len(ports) != 1:
        found = f"found {', '.join(ports)}" if ports else "found none: is the robot plugged in?"
        raise UserError(f"name the robot's port, as in `echolocate ring-test /dev/ttyACM0`; {found}", WRONG_CALL)
    return str(ports[0])


class Finding(NamedTuple):
    """What was found out about a sensor, or a motion."""

    is_good: bool
    text: str


def judge_sensor(ranges: list[float], rounds: int) -> Finding:
    """Return the finding about a sensor, given what it reported in so many firings: m, +inf no echo, no faults."""
    heard = sorted(value for value in ranges if math.isfinite(value))
    if not ranges:
        return Finding(is_good=False, text="NO ANSWER: check its supply, and its trigger and echo wires")
    if len(ranges) < ANSWERS_MIN * rounds:
        return Finding(is_good=False, text=f"answers {len(ranges)} times of {rounds}: check for a loose wire")
    if not heard:
        return Finding(is_good=True, text="hears nothing: hold something flat in front of it to see that it does")
    tenth = len(heard) // 10
    spread_m = heard[-1 - tenth] - heard[tenth]
    text = f"{statistics.median(heard):.3f} m, {len(heard)} echoes of {len(ranges)}"
    if spread_m > UNSTEADY_M:
        text += f", unsteady by {spread_m:.2f} m: does something move, or does it receive its neighbours?"
        return Finding(is_good=True, text=text)
    return Finding(is_good=True, text=f"{text}, within {spread_m * 1e3:.0f} mm")


def judge_motion(asked: Twist, before: Odometry, after: Odometry, flags: Flags, seconds: float) -> Finding:
    """Return the finding about a motion, given the odometry before and after it and all flags in between."""
    if Flags.MOTOR_FAULT in flags:
        return Finding(
            is_good=False,
            text="MOTOR FAULT: a wheel does not turn, or against its encoder: check the motor's supply and the "
            "encoder's; if the wheel turned the wrong way swap IN1 and IN2 of its motor, else A and B of its encoder",
        )
    if Flags.LATCHED in flags:
        return Finding(is_good=False, text="the base is latched and does not move: is a bumper pressed?")
    heading = before.pose.theta
    dx, dy = after.pose.x - before.pose.x, after.pose.y - before.pose.y
    way = dx * math.cos(heading) + dy * math.sin(heading)
    turn = after.pose.theta - before.pose.theta
    moved, expected = (way, asked.v * seconds) if asked.v else (turn, asked.w * seconds)
    text = f"odometry says {way:+.3f} m, {math.degrees(turn):+.0f} degrees"
    if not WAY_MIN <= moved / expected <= WAY_MAX:
        text += ", not what was asked: check ENCODER_COUNTS_PER_M and WHEEL_BASE_MM"
        return Finding(is_good=False, text=text)
    return Finding(is_good=True, text=text)


class RingTest:
    """One test, on one line.

    Parameters
    ----------
    config
        The robot, whose firing pattern fires each sensor by itself.
    write
        Prints text.
    """

    def __init__(self, config: RobotConfig, write: Callable[[str], object]) -> None:
        self._config = config
        self._write = write
        self._driver = make_driver(config)
        self._link = Link(config.link, self._opened, self._received, lambda _reason: self._driver.line_closed())
        self._connection = Connection(self._link, self._driver, self._send, time.monotonic)
        self._flags = Flags.NONE
        self._odometry: Odometry | None = None

    async def run(self, rounds: int, *, move: bool) -> int:
        """Return the exit code: whether all that was tested is good."""
        await self._connection.connect(lambda: False)
        try:
            identity = self._driver.identity
            if identity is not None:
                self._write(f"robot '{identity.name}' on {self._config.link.port}, {identity.sensors} sensors\n")
            is_good = await self._test_sensors(rounds)
            if move:
                is_good = await self._test_motors() and is_good
        finally:
            await self._connection.shut_down()
            await self._link.stop()
        return DONE if is_good else FAILED

    async def _test_sensors(self, rounds: int) -> bool:
        mounts = self._config.ring.mounts
        ranges: list[list[float]] = [[] for _ in mounts]
        firings = 0
        deadline_s = time.monotonic() + rounds * len(mounts) * self._config.ring.firing.step_period_s + SLACK_S
        while firings < rounds * len(mounts) and time.monotonic() < deadline_s:
            for reported in await self._exchange():
                firings += 1
                for sensor, value in enumerate(reported.tolist()):
                    if not math.isnan(value):
                        ranges[sensor].append(value)
        findings = [judge_sensor(each, rounds) for each in ranges]
        for number, (mount, finding) in enumerate(zip(mounts, findings, strict=True)):
            self._write(f"sensor {number:2} at {math.degrees(mount.angle_rad):4.0f} degrees: {finding.text}\n")
        return all(finding.is_good for finding in findings)

    async def _test_motors(self) -> bool:
        self._write(
            f"WARNING: the wheels turn in {WARNING_S:g} s. Put the robot on a block, wheels free; Ctrl-C ends.\n"
        )
        sys.stdout.flush()
        await self._pass(WARNING_S, None)
        self._driver.release()
        await self._pass(SETTLE_S, None)
        for name, twist in MOTIONS:
            self._flags, before = Flags.NONE, self._odometry
            await self._pass(MOVE_S, twist)
            await self._pass(SETTLE_S, Twist(0.0, 0.0))
            if before is None or self._odometry is None:
                raise UserError("the robot sends no odometry: see `echolocate check`, and its firmware", FAILED)
            finding = judge_motion(twist, before, self._odometry, self._flags, MOVE_S)
            self._write(f"motors {name}: {finding.text}\n")
            if not finding.is_good:
                return False
        self._write("If the robot did otherwise, left and right are swapped, or each motor and its encoder.\n")
        return True

    async def _pass(self, seconds: float, twist: Twist | None) -> None:
        """Let time pass, at a velocity unless it is None."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            if twist is not None:
                self._driver.drive(twist)
            await self._exchange()

    async def _exchange(self) -> list[Floats]:
        """Let the line work for a moment; return the ranges of each firing received."""
        await asyncio.sleep(POLL_S if self._driver.firings_waiting else 4 * POLL_S)
        self._driver.tick(time.monotonic())
        self._send()
        if not self._link.is_open:
            raise UserError(self._link.last_error or "the line to the robot is lost", FAILED)
        if self._driver.problem is not None and self._driver.state is LineState.DOWN:
            raise UserError(self._driver.problem, FAILED)
        received = self._driver.take_received()
        for note in received.notes:
            self._write(f"note: {note}\n")
        self._flags |= received.flags
        self._odometry = received.odometry or self._odometry
        return [firing.ranges_m for firing in received.firings]

    def _opened(self) -> None:
        self._driver.line_opened(time.monotonic())
        self._send()

    def _received(self, data: bytes) -> None:
        self._driver.receive(data, time.monotonic())

    def _send(self) -> None:
        link = self._link
        link.set_baud(self._driver.line_baud)
        if link.is_open and (data := self._driver.outgoing(writable=link.writable)):
            link.send(data)
