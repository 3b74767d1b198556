"""One test of a ring, sensor by sensor, and of its motors, on one line."""

from __future__ import annotations

import asyncio
import math
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from serial.tools.list_ports import comports

from config.errors import DONE, FAILED, NOT_SHOWN, WRONG_CALL, UserError
from config.robot import SOUND_SPEED_M_S, FiringConfig, RingConfig, RobotConfig
from drivers.base_model import stop_s
from drivers.driver import LineState
from drivers.firing_pattern import FiringError, firing_pattern
from drivers.link import Link
from drivers.messages import Flags, Floats, Odometry, Twist
from drivers.registry import line_options, make_driver
from runtime.cli.commands.robots.crosstalk_trial import crosstalk
from runtime.cli.commands.robots.hand_trial import HandWatch, held_m, judge_hands, side_of
from runtime.cli.commands.robots.sensor_trial import Finding, judge_sensor, not_shown, sensor_lines, unsteadiness_of
from runtime.cli.commands.robots.servo_trial import hands_before, judge_servo_hands, not_shown_by_hands, stuck_servos
from runtime.cycle.connection import POLL_S, Connection

SLACK_S: Final = 2.0
"""How much longer than its firings need the test of the sensors may take, s."""
WARNING_S: Final = 3.0
"""Time from the warning to the first motion, s."""
MOVE_S: Final = 1.0
"""Time of each motion, s."""
SETTLE_S: Final = 0.5
"""Time to wait after a base stands again by its file, s."""
HAND_S: Final = 15.0
"""So long a hand before a sensor is waited for, s."""
DRIVE_S: Final = 0.05
"""Time from one velocity to the next, s, as of a run: a line that is full of them carries no request."""
LISTEN_M: Final = 7.0
"""Longest window of the test, m: modules that hold their echo pin for 38 ms where they hear nothing say 6.5 m."""
MOTIONS: Final = (
    ("forward", Twist(0.1, 0.0)),
    ("backward", Twist(-0.1, 0.0)),
    ("left (counter-clockwise from above)", Twist(0.0, 0.6)),
    ("right", Twist(0.0, -0.6)),
)
WAY_MIN, WAY_MAX = 0.4, 1.6
"""Least and greatest way by the odometry, of what was asked for; a base also has to speed up and to stop."""


def with_single_firing(config: RobotConfig) -> RobotConfig:
    """Return the robot with the preset `single`: one sensor at a time, or one of each of its arrays.

    The period stays, and the window becomes as long as it allows, or also stays: a maximum in place of nothing may
    lie beyond what the sensor measures. Listeners and sets are left out. `config` is returned unchanged if its driver
    cannot fire that way.
    """
    ring, own = config.ring, config.ring.firing
    longest_m = min(LISTEN_M, 0.5 * SOUND_SPEED_M_S * own.step_period_s)
    for window_m in (max(ring.window_m, longest_m), own.window_m):
        firing = FiringConfig(preset="single", step_period_s=own.step_period_s, window_m=window_m)
        single = config.model_copy(update={"ring": ring.model_copy(update={"firing": firing})})
        with suppress(FiringError):
            make_driver(single)
            return single
    return config


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
    """One test of a robot: connects, tests, and closes the line.

    Parameters
    ----------
    config
        The robot, whose firing pattern fires each sensor by itself.
    write
        Prints text.
    clock
        Monotonic, s.
    own
        The ring with the robot's own firing pattern, in which crosstalk is looked for; None to leave that out.
    """

    def __init__(
        self,
        config: RobotConfig,
        write: Callable[[str], object],
        clock: Callable[[], float] = time.monotonic,
        own: RingConfig | None = None,
    ) -> None:
        self._own = own
        self._clock = clock
        self._config = config
        self._write = write
        self._driver = make_driver(config)
        handlers = (self._opened, self._received, lambda _reason: self._driver.line_closed())
        self._link = Link(config.link, *handlers, **line_options(config))
        self._connection = Connection(self._link, self._driver, self._send, clock, config.body)
        self._flags = Flags.NONE
        self._odometry: Odometry | None = None

    async def run(self, rounds: int, *, move: bool, hand: bool = False) -> int:
        """Test the sensors, and what else is asked for; return the exit code. Once.

        It is `FAILED` if a fault was found, `NOT_SHOWN` if none was but a sensor may be deaf, else `DONE`.

        Parameters
        ----------
        rounds
            Firings of each sensor.
        move
            Test the motors, too: the wheels turn.
        hand
            Ask for a hand before each sensor, too.

        Raises
        ------
        UserError
            The robot does not answer, or is lost.
        """
        await self._connection.connect(lambda: False)
        try:
            identity = self._driver.identity
            if identity is not None:
                name, count = self._config.robot.name or identity.name, identity.sensors
                self._write(f"robot '{name}' on {self._config.link.port}, {count} sensor{'s' * (count != 1)}\n")
            ranges = await self._listen(self._config.ring, rounds)
            together = await self._together(rounds)
            is_good, unshown = self._judge(ranges, rounds, together)
            if hand:
                is_good = await self._test_places(ranges) and is_good
                unshown = []
            else:
                one = len(unshown) == 1
                which = f"sensor{'s' * (not one)} {', '.join(map(str, unshown))} hear{'s' * one}"
                hears = f"whether {which}, and " if unshown else ""
                self._write(f"not shown: {hears}where each sensor looks: run with --hand\n")
            if move:
                is_good = await self._test_motors() and is_good
        finally:
            await self._connection.shut_down()
            await self._link.stop()
        return (NOT_SHOWN if unshown else DONE) if is_good else FAILED

    async def _listen(self, ring: RingConfig, rounds: int) -> list[list[float]]:
        """Return what each sensor reports in so many firings: m, +inf no echo."""
        mounts, pattern = ring.mounts, firing_pattern(ring)
        ranges: list[list[float]] = [[] for _ in mounts]
        if ring is self._config.ring and len(pattern.masks) < len(mounts):
            self._write("this robot does not fire its sensors one by one: sensors that fire together may disturb\n")
        deadline_s = self._clock() + rounds * pattern.cycle_s + SLACK_S
        while any(len(each) < rounds for each in ranges) and self._clock() < deadline_s:
            for reported in await self._exchange():
                for sensor, value in enumerate(reported.tolist()):
                    if not math.isnan(value) and len(ranges[sensor]) < rounds:
                        ranges[sensor].append(value)
        return ranges

    async def _together(self, rounds: int) -> list[list[float]] | None:
        """Listen as `_listen` does in the robot's own pattern, then return to that of the test.

        None where as many sensors fire at once in either.
        """
        if self._own is None or firing_pattern(self._own).set_size == firing_pattern(self._config.ring).set_size:
            return None
        self._driver.set_firing(self._own)
        await self._pass(SETTLE_S, None)
        ranges = await self._listen(self._own, rounds)
        self._driver.set_firing(self._config.ring)
        await self._pass(SETTLE_S, None)
        return ranges

    def _judge(
        self, ranges: list[list[float]], rounds: int, together: list[list[float]] | None
    ) -> tuple[bool, list[int]]:
        """Write the finding about each sensor; return whether all are good, and those not shown to hear."""
        ring = self._config.ring
        disturbed = {} if together is None or self._own is None else crosstalk(ranges, together, self._own)
        findings = [
            judge_sensor(each, rounds, ring, unsteadiness_of(ranges, number)) for number, each in enumerate(ranges)
        ]
        medians = [statistics.median(each) if each else math.inf for each in ranges]
        # A range that no sensor measures has causes of its own.
        stuck = stuck_servos(ring, medians) if all(one.is_good for one in findings) else {}
        texts = [disturbed.get(i, one.text) if one.is_good else one.text for i, one in enumerate(findings)]
        for line in sensor_lines(ring, texts):
            self._write(f"{line}\n")
        for sensor, text in stuck.items():
            self._write(f"sensor {sensor} on its servo: {text}\n")
        is_good = all(finding.is_good for finding in findings) and not disturbed and not stuck
        return is_good, not_shown(ring, findings)

    async def _test_places(self, ranges: list[list[float]]) -> bool:
        """Ask for a hand before each sensor, and write which of them does not answer in its place."""
        ring = self._config.ring
        before, (near_m, far_m) = [statistics.median(each) if each else math.inf for each in ranges], held_m(ring)
        watch, distance = HandWatch(before, far_m), f"{100 * near_m:.0f} to {100 * far_m:.0f}"
        answered, heard = list[int | None](), list[frozenset[int]]()
        for sensor, angle_rad in hands_before(ring):
            # A sensor beside one on a servo may hear a hand sooner than the bearing that looks there.
            own = {k for k, of in enumerate(ring.sensor_of) if of == sensor or not ring.has_servo}
            self._write(f"hold something flat {distance} cm from the sensor, {side_of(angle_rad)} …\n")
            sys.stdout.flush()
            watch.ask()
            found, answering, deadline_s = None, frozenset[int](), self._clock() + HAND_S
            while found not in own and self._clock() < deadline_s:
                for reported in await self._exchange():
                    if found not in own and (now := watch.take(reported.tolist(), own)) is not None:
                        found, answering = now, watch.answering
            answered.append(found)
            heard.append(answering)
        wrong = judge_servo_hands(ring, heard, before) if ring.has_servo else judge_hands(ring, answered, before)
        for line in [*(wrong or ["each sensor answers in its place"]), *not_shown_by_hands(ring)]:
            self._write(f"{line}\n")
        return not wrong

    async def _test_motors(self) -> bool:
        """Drive each of `MOTIONS`, and write whether odometry shows it; return whether all are good."""
        self._write(
            f"WARNING: the wheels turn in {WARNING_S:g} s. Put the robot on a block, wheels free; Ctrl-C ends.\n"
        )
        sys.stdout.flush()
        await self._pass(WARNING_S, None)
        self._driver.release()
        await self._pass(SETTLE_S, None)
        for name, twist in MOTIONS:
            self._flags, before = Flags.NONE, self._odometry
            # A base that is slow to speed up drives as much longer, and then brakes on as far as it lacked.
            move_s = max(MOVE_S, stop_s(twist, self._config.body))
            await self._pass(move_s, twist)
            await self._pass(SETTLE_S + stop_s(twist, self._config.body), Twist(0.0, 0.0))
            if before is None or self._odometry is None:
                raise UserError("the robot sends no odometry: see `echolocate check`, and its firmware", FAILED)
            finding = judge_motion(twist, before, self._odometry, self._flags, move_s)
            self._write(f"motors {name}: {finding.text}\n")
            if not finding.is_good:
                return False
        self._write("If the robot did otherwise, left and right are swapped, or each motor and its encoder.\n")
        return True

    async def _pass(self, seconds: float, twist: Twist | None) -> None:
        """Let time pass, at a velocity unless it is None."""
        until_s, drive_s = self._clock() + seconds, -math.inf
        while self._clock() < until_s:
            if twist is not None and self._clock() - drive_s >= DRIVE_S:
                drive_s = self._clock()
                self._driver.drive(twist)
            await self._exchange()

    async def _exchange(self) -> list[Floats]:
        """Let the line work for a moment; return the ranges of each firing received."""
        await asyncio.sleep(POLL_S if self._driver.firings_waiting else 4 * POLL_S)
        self._driver.tick(self._clock())
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
        self._driver.line_opened(self._clock())
        self._send()

    def _received(self, data: bytes) -> None:
        self._driver.receive(data, self._clock())

    def _send(self) -> None:
        link = self._link
        link.set_baud(self._driver.line_baud)
        if link.is_open and (data := self._driver.outgoing(writable=link.writable)):
            link.send(data)
