"""One test of a ring, sensor by sensor, and of its motors, on one line."""

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
from config.robot import FiringConfig, RingConfig, RobotConfig
from drivers.base_model import stop_s
from drivers.driver import LineState
from drivers.firing_pattern import FiringError, firing_pattern
from drivers.link import Link
from drivers.messages import Flags, Floats, Odometry, Twist
from drivers.registry import line_options, make_driver
from runtime.cli.commands.robots.crosstalk_trial import crosstalk
from runtime.cli.commands.robots.hand_trial import HandWatch, judge_hands, side_of
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
UNSTEADY_M: Final = 0.1
"""Ranges of a robot that stands still do not spread farther than this, m, apart from a tenth of them at each end."""
ANSWERS_MIN: Final = 0.8
"""Share of the firings that a good sensor answers; no more than the rest may be ranges that it cannot measure."""
REPEATS_MIN: Final = 5
"""Fewest equal ranges that count as always the same."""
FINE_M: Final = 1e-3
STEPS_MIN: Final = 3.0
"""The others' spread must be so many steps of the ranges, of 1 mm at least, that rounding does not explain a sensor
that always says the same."""
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

    Period and window stay; listeners and sets are left out. `config` is returned unchanged if its driver cannot fire
    that way.
    """
    own = config.ring.firing
    firing = FiringConfig(preset="single", step_period_s=own.step_period_s, window_m=own.window_m)
    single = config.model_copy(update={"ring": config.ring.model_copy(update={"firing": firing})})
    try:
        make_driver(single)
    except FiringError:
        return config
    return single


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


def judge_sensor(ranges: list[float], rounds: int, ring: RingConfig, unsteadiness: float = 0.0) -> Finding:
    """Return the finding about a sensor.

    Parameters
    ----------
    ranges
        What it reported in so many firings: m, +inf no echo, no faults.
    rounds
        Number of firings.
    ring
        The ring, for what its sensors can measure.
    unsteadiness
        Spread of the ranges of the other sensors, as a share of the range.
    """
    heard = sorted(value for value in ranges if math.isfinite(value))
    if not ranges:
        return Finding(
            is_good=False,
            text="NO ANSWER within its window: check its supply, and its trigger and echo wires; hold something flat "
            "in front of it: if it answers then, it must report no echo where it hears nothing, and not its maximum",
        )
    if len(ranges) < ANSWERS_MIN * rounds:
        return Finding(is_good=False, text=f"answers {len(ranges)} times of {rounds}: check for a loose wire")
    if not heard:
        return Finding(is_good=True, text="hears nothing: --hand shows whether it does")
    if (wrong := impossible(heard, len(ranges), ring)) is not None:
        return Finding(is_good=False, text=wrong)
    median_m, tenth = statistics.median(heard), len(heard) // 10
    spread_m = heard[-1 - tenth] - heard[tenth]
    text = f"{median_m:.3f} m, {len(heard)} echoes of {len(ranges)}"
    if heard[0] == heard[-1] and len(heard) >= REPEATS_MIN:
        if unsteadiness * median_m > STEPS_MIN * max(ring.resolution_m, FINE_M):
            text = f"STUCK at {median_m:.4f} m, while the ranges of the others vary: check its wires, then replace it"
            return Finding(is_good=False, text=text)
        return Finding(is_good=True, text=f"{text}, always the same: see that it changes with a hand in front of it")
    if spread_m > UNSTEADY_M:
        text += f", unsteady by {spread_m:.2f} m: does something move, or does it receive its neighbours?"
        return Finding(is_good=True, text=text)
    return Finding(is_good=True, text=f"{text}, within {spread_m * 1e3:.0f} mm")


def impossible(heard: list[float], count: int, ring: RingConfig) -> str | None:
    """Return the text about ranges that the sensors cannot measure; None if at most a fifth of the firings has any.

    Parameters
    ----------
    heard
        The finite ranges, m, sorted.
    count
        Number of firings.
    ring
        The ring.
    """
    few, half_step_m = (1.0 - ANSWERS_MIN) * count, max(0.5 * ring.resolution_m, 1e-6)
    zeros = sum(value <= 0.0 for value in heard)
    below = sum(value < ring.range_min_m + half_step_m for value in heard)
    beyond = sum(value > ring.range_max_m - half_step_m for value in heard)
    if zeros > few:
        return (
            f"ZERO in {zeros} of {count} firings: check the wire of its echo pin; if the sensor reports 0 where it "
            f"hears nothing, its driver must report that as no echo"
        )
    if below > few:
        return (
            f"TOO SHORT, {heard[0]:.4f} m, in {below} of {count} firings, and ring.range_min_m is "
            f"{ring.range_min_m:g}: check that nothing touches it; a waterproof module needs a trigger of 20 µs or "
            f"more: make TRIGGER_US in robot_config.py longer; then check its echo wire"
        )
    if beyond > few:
        return (
            f"AT ITS MAXIMUM, {heard[-1]:.3f} m, in {beyond} of {count} firings: it hears nothing and must report "
            f"that as no echo; hold something flat in front of it to see that it hears at all"
        )
    return None


def unsteadiness_of(ranges: list[list[float]], number: int) -> float:
    """Return the median spread of the ranges of all sensors but one, as a share of the range; 0 without any."""
    others = (sorted(filter(math.isfinite, each)) for other, each in enumerate(ranges) if other != number)
    shares = [(each[-1] - each[0]) / each[0] for each in others if len(each) >= REPEATS_MIN and each[0] > 0.0]
    return statistics.median(shares) if shares else 0.0


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
        """Test the sensors, and what else is asked for; return the exit code, `DONE` if all is good. Once.

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
                self._write(f"robot '{identity.name}' on {self._config.link.port}, {identity.sensors} sensors\n")
            ranges = await self._listen(self._config.ring, rounds)
            together = await self._together(rounds)
            is_good = self._judge(ranges, rounds, together)
            if hand:
                is_good = await self._test_places(ranges) and is_good
            if move:
                is_good = await self._test_motors() and is_good
        finally:
            await self._connection.shut_down()
            await self._link.stop()
        return DONE if is_good else FAILED

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

    def _judge(self, ranges: list[list[float]], rounds: int, together: list[list[float]] | None) -> bool:
        """Write what is found of each sensor; return whether all are good."""
        ring = self._config.ring
        disturbed = {} if together is None or self._own is None else crosstalk(ranges, together, self._own)
        findings = [
            judge_sensor(each, rounds, ring, unsteadiness_of(ranges, number)) for number, each in enumerate(ranges)
        ]
        stuck = stuck_servos(ring, [statistics.median(each) if each else math.inf for each in ranges])
        for number, (mount, finding) in enumerate(zip(ring.mounts, findings, strict=True)):
            text = disturbed.get(number, finding.text) if finding.is_good else finding.text
            self._write(f"sensor {number:2} at {math.degrees(mount.angle_rad):4.0f} degrees: {text}\n")
        for sensor, text in stuck.items():
            self._write(f"sensor {sensor} on its servo: {text}\n")
        return all(finding.is_good for finding in findings) and not disturbed and not stuck

    async def _test_places(self, ranges: list[list[float]]) -> bool:
        """Ask for a hand before each sensor, and write which of them does not answer in its place."""
        ring = self._config.ring
        watch = HandWatch([statistics.median(each) if each else math.inf for each in ranges])
        answered, heard = list[int | None](), list[frozenset[int]]()
        for sensor, angle_rad in hands_before(ring):
            # A sensor beside one on a servo may hear a hand sooner than the bearing that looks there.
            own = {k for k, of in enumerate(ring.sensor_of) if of == sensor or not ring.has_servo}
            self._write(f"hold something flat 10 to 30 cm from the robot, {side_of(angle_rad)} …\n")
            sys.stdout.flush()
            watch.ask()
            found, answering, deadline_s = None, frozenset[int](), self._clock() + HAND_S
            while found not in own and self._clock() < deadline_s:
                for reported in await self._exchange():
                    if found not in own and (now := watch.take(reported.tolist(), own)) is not None:
                        found, answering = now, watch.answering
            answered.append(found)
            heard.append(answering)
        wrong = judge_servo_hands(ring, heard) if ring.has_servo else judge_hands(ring, answered)
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
