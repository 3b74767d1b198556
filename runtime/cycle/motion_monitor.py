"""Whether the base moves as it is commanded, by its odometry: an acknowledgement alone moves and stops nothing.

**More than commanded.** In each of four directions (forward, backward, left, right) the commands explain a velocity.
It is the greatest one commanded within the last `AGE_S`, as the newest odometry may still show a command so old. From
there on it falls by the base's deceleration: the base brakes. What the odometry moves beyond `GAIN` times that
velocity plus `NOISE` is summed up, never below zero, and reported above `EXCESS`. A base that brakes, that is a
quarter too fast, or whose odometry trembles or leaps once therefore moves as commanded.

**Not at all.** A model of the base follows the commands within the limits of its file. While the odometry has not
moved by `MOVED`, the model's motion in the direction of the command is summed up. The base does not move if that
reaches `ASKED` and the command has lasted for `STALL_S`. Velocities below `CRAWL` do not count, as wheels may stick:
pulses that are too short for the base's acceleration move no base. A command below it, or in the opposite direction,
starts the sum anew.

A base that moves without a command may be pushed by hand. Odometry cannot tell that from a base that runs away,
unless the base was commanded to move and has not stood since: then it was never stopped.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from config.bounded import Coordinate, Seconds, Speed
from config.robot import BodyConfig
from drivers.base_model import obeyed
from drivers.messages import Odometry, Pose, Twist


@dataclass(frozen=True, slots=True)
class Amount:
    """A distance and an angle, m and rad, or their rates, m/s and rad/s."""

    along: Coordinate
    turned: Coordinate


AGE_S: Final = 0.2
"""Greatest age of a command that the newest odometry shows: a cycle, the way there and back, odometry's period, s."""
GAIN: Final = 1.25
"""A base may be faster than commanded by this factor: a controller overshoots, an odometer has a scale."""
NOISE: Final = Amount(0.005, 0.03)
"""Velocities that are none: the heading of an odometry drifts."""
EXCESS: Final = Amount(0.15, 0.2)
"""Unexplained motion that is reported; more than one leap."""
LEAP: Final = Amount(0.1, 0.1)
"""The odometry leapt, and the base did not move, if it moved by more than this beyond its top speed."""
GAP_MAX_S: Final = 1.0
"""Samples of the odometry that are farther apart, as after a lost line, say nothing about what lies between."""

STOOD_S: Final = 0.3
"""After this time in which the odometry has not moved by `MOVED`, the base stands, s."""

STALL_S: Final = 1.0
"""Least time in which a base moves, s."""
ASKED: Final = Amount(0.02, 0.05)
"""Least motion of the model after which a base has moved."""
MOVED: Final = Amount(0.005, 0.01)
"""Motion of the odometry that counts as such."""
CRAWL: Final = Amount(0.03, 0.05)
"""Velocities below which real wheels may stick."""


DIRECTIONS: Final = 4
NOTHING: Final = Amount(0.0, 0.0)
STANDSTILL: Final = Twist(0.0, 0.0)


class Movement(Enum):
    """How the base moves, compared with its commands."""

    AS_COMMANDED = "as commanded"
    MISSING = "missing"
    """It does not move although it is commanded to."""
    UNCOMMANDED = "uncommanded"
    """It moves more than commanded, and stood before: it may be pushed."""
    UNSTOPPED = "unstopped"
    """It moves more than commanded, and has not stood since it was commanded to move."""


@dataclass(frozen=True, slots=True)
class Command:
    """A velocity and when it was commanded, by the run's clock."""

    run_s: Seconds
    twist: Twist


@dataclass(frozen=True, slots=True)
class Direction:
    """One of the four directions in which the base moves."""

    explained: Speed
    """Velocity that the commands explain, m/s or rad/s."""
    excess: Coordinate = 0.0
    """Motion that they do not, m or rad."""


@dataclass(frozen=True, slots=True)
class MotionMonitor:
    """Compares the odometry with the commands; immutable, as keyframes hold it."""

    movement: Movement = Movement.AS_COMMANDED
    """As of the newest cycle."""
    commands: tuple[Command, ...] = ()
    """Of the last `AGE_S`, and the newest one in any case."""
    odometry: Odometry | None = None
    """The newest sample."""
    directions: tuple[Direction, ...] = ()
    """Forward, backward, left, right; empty before the first sample."""
    still: Pose | None = None
    """The pose from which the odometry has not moved by `MOVED`."""
    still_s: Seconds = 0.0
    """For how long it has not, by the robot's clock."""
    has_stood: bool = True
    """Whether the base has stood since it was last commanded to move."""
    asked_s: Seconds = 0.0
    """For how long the base has been commanded to drive one way without having moved."""
    asked: Amount = NOTHING
    """How far the model has moved in `asked_s`."""
    asked_turn_s: Seconds = 0.0
    """For how long the base has been commanded to turn one way without having moved, s."""
    modelled: Twist = STANDSTILL
    """Velocity of a base that obeys within the limits of its file."""
    modelled_run_s: Seconds | None = None
    """When it had that, by the run's clock; None before the first cycle."""

    def contradiction(self) -> str | None:
        """Return why directions and odometry do not belong together; None if they do."""
        expected = 0 if self.odometry is None else DIRECTIONS
        found = len(self.directions)
        return None if found == expected else f"{found} directions of motion, expected {DIRECTIONS} beside odometry"

    def observe(self, odometry: Odometry | None, run_s: float, body: BodyConfig) -> MotionMonitor:
        """Return the monitor after the newest odometry.

        Odometry is the newest sample since the cycle before, None if there was none; `run_s` is the beginning of this
        one.
        """
        commands = self.commands
        while len(commands) > 1 and run_s - commands[0].run_s > AGE_S:
            commands = commands[1:]
        last, fine = self.odometry, Movement.AS_COMMANDED
        modelled, lasted_s = self._model(run_s, body)
        asked_s, asked_turn_s, asked = self._ask(modelled, lasted_s)
        if odometry is None:
            return replace(
                self,
                movement=fine,
                commands=commands,
                modelled=modelled,
                modelled_run_s=run_s,
                asked_s=asked_s,
                asked_turn_s=asked_turn_s,
                asked=asked,
            )
        if last is None:  # it may be moving by commands of before
            limits = (body.speed_max_m_s,) * 2 + (body.turn_max_rad_s,) * 2
            directions = tuple(map(Direction, limits))
            return replace(
                self,
                commands=commands,
                odometry=odometry,
                directions=directions,
                modelled=modelled,
                modelled_run_s=run_s,
            )
        passed_s, (along, turned) = odometry.robot_s - last.robot_s, _between(last.pose, odometry.pose)
        if _has_leapt(along, turned, passed_s, body) or not 0.0 < passed_s <= GAP_MAX_S:
            return MotionMonitor(
                fine,
                commands,
                odometry,
                self.directions,
                has_stood=self.has_stood,
                modelled=modelled,
                modelled_run_s=run_s,
            )
        directions, is_excessive = self._explain(commands, along, turned, passed_s, body)
        is_still = self.still is not None and not _reaches(_between(self.still, odometry.pose), MOVED)
        still_s = self.still_s + passed_s if is_still else 0.0
        has_stood = self.has_stood or still_s >= STOOD_S
        is_stalled = is_still and (
            (asked_s >= STALL_S and abs(asked.along) >= ASKED.along)
            or (asked_turn_s >= STALL_S and abs(asked.turned) >= ASKED.turned)
        )
        if is_stalled or not is_still:
            asked_s, asked_turn_s, asked = 0.0, 0.0, NOTHING
        if is_excessive:
            movement = Movement.UNCOMMANDED if has_stood else Movement.UNSTOPPED
        else:
            movement = Movement.MISSING if is_stalled else fine
        still = self.still if is_still else odometry.pose
        return MotionMonitor(
            movement,
            commands,
            odometry,
            directions,
            still,
            still_s,
            has_stood,
            asked_s,
            asked,
            asked_turn_s,
            modelled,
            run_s,
        )

    def command(self, twist: Twist | None, run_s: float) -> MotionMonitor:
        """Return the monitor after a command that reached the base; None commands no velocity: it ends any motion."""
        twist = STANDSTILL if twist is None else twist
        has_stood = self.has_stood and twist.v == 0.0 and twist.w == 0.0
        # As `replace` does, in a fifth of its time: this is called in each cycle.
        return MotionMonitor(
            self.movement,
            (*self.commands, Command(run_s, twist)),
            self.odometry,
            self.directions,
            self.still,
            self.still_s,
            has_stood,
            self.asked_s,
            self.asked,
            self.asked_turn_s,
            self.modelled,
            self.modelled_run_s,
        )

    def _explain(
        self, commands: tuple[Command, ...], along: float, turned: float, passed_s: float, body: BodyConfig
    ) -> tuple[tuple[Direction, ...], bool]:
        """Return the directions after a motion, and whether too much is unexplained; the sum then starts anew."""
        v_max = v_min = w_max = w_min = 0.0  # a velocity explains nothing in the direction opposite to its own
        for command in commands:
            v, w = command.twist.v, command.twist.w
            if v > v_max:
                v_max = v
            elif v < v_min:
                v_min = v
            if w > w_max:
                w_max = w
            elif w < w_min:
                w_min = w
        braked, slowed = body.acceleration_max_m_s2 * passed_s, body.turn_acceleration_max_rad_s2 * passed_s
        ahead, back, left, right = self.directions
        directions = (
            _direction(ahead, v_max, along, braked, passed_s, NOISE.along),
            _direction(back, 0.0 - v_min, -along, braked, passed_s, NOISE.along),
            _direction(left, w_max, turned, slowed, passed_s, NOISE.turned),
            _direction(right, 0.0 - w_min, -turned, slowed, passed_s, NOISE.turned),
        )
        ahead, back, left, right = directions
        is_excessive = (
            ahead.excess > EXCESS.along
            or back.excess > EXCESS.along
            or left.excess > EXCESS.turned
            or right.excess > EXCESS.turned
        )
        return tuple(Direction(d.explained) for d in directions) if is_excessive else directions, is_excessive

    def _model(self, run_s: float, body: BodyConfig) -> tuple[Twist, float]:
        """Return the velocity of a base that obeys within its limits, and how long it has had to reach it, s."""
        if self.modelled_run_s is None or not self.commands:
            return self.modelled, 0.0
        before, target = self.modelled, self.commands[-1].twist
        lasted_s = min(max(0.0, run_s - self.modelled_run_s), GAP_MAX_S)
        if before == target:
            return before, lasted_s
        return obeyed(before, target, body, lasted_s), lasted_s

    def _ask(self, modelled: Twist, lasted_s: float) -> tuple[float, float, Amount]:
        """Return for how long a base that stands has been commanded to drive and to turn, and the model's motion."""
        if not self.commands:
            return 0.0, 0.0, NOTHING
        now, before = self.commands[-1].twist, self.commands[-2 if len(self.commands) > 1 else -1].twist
        drive_s = 0.0 if now.v * before.v < 0.0 else self.asked_s
        turn_s = 0.0 if now.w * before.w < 0.0 else self.asked_turn_s
        along_s, along = _asked(drive_s, self.asked.along, lasted_s, modelled.v, now.v, CRAWL.along)
        turn_s, turned = _asked(turn_s, self.asked.turned, lasted_s, modelled.w, now.w, CRAWL.turned)
        return along_s, turn_s, Amount(along, turned)


def _asked(
    before_s: float, before: float, lasted_s: float, modelled: float, commanded: float, crawl: float
) -> tuple[float, float]:
    """Return for how long a motion has been commanded, and how far the model has moved, after `lasted_s` more."""
    if abs(commanded) < crawl:
        return 0.0, 0.0
    if before * commanded < 0.0 or before_s == 0.0:
        before_s, before = 0.0, 0.0
    moves = abs(modelled) >= crawl and modelled * commanded > 0.0
    return before_s + lasted_s, before + (lasted_s * modelled if moves else 0.0)


def _direction(
    before: Direction, fastest: float, moved: float, braked: float, passed_s: float, noise: float
) -> Direction:
    """Return a direction after `passed_s`, in which the base moved by `moved` in it.

    Parameters
    ----------
    before
        The direction before.
    fastest
        Greatest velocity commanded in it, not below zero.
    moved
        Motion, m or rad.
    braked
        By how much a base that brakes has become slower.
    passed_s
        Time since `before`.
    noise
        Velocity that is none.
    """
    # Comparisons, as calls of `max` would take longer, a dozen in each cycle.
    explained = before.explained - braked
    if explained < fastest:
        explained = fastest
    greatest = explained if explained > before.explained else before.explained
    excess = before.excess + moved - (GAIN * greatest + noise) * passed_s
    return Direction(explained, excess if excess > 0.0 else 0.0)


def _has_leapt(along: float, turned: float, passed_s: float, body: BodyConfig) -> bool:
    """Return whether no base of these limits moves so far in the time."""
    return (
        abs(along) >= GAIN * body.speed_max_m_s * passed_s + LEAP.along
        or abs(turned) >= GAIN * body.turn_max_rad_s * passed_s + LEAP.turned
    )


def _between(before: Pose, after: Pose) -> tuple[float, float]:
    """Return by how much the base moved along its heading, and turned, from one pose to another: m, rad."""
    turned = after.theta - before.theta
    heading = before.theta + 0.5 * turned
    dx, dy = after.x - before.x, after.y - before.y
    return math.cos(heading) * dx + math.sin(heading) * dy, turned


def _reaches(moved: tuple[float, float], least: Amount) -> bool:
    along, turned = moved
    return abs(along) >= least.along or abs(turned) >= least.turned
