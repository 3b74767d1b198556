"""Tests of the comparison of odometry with commands: what is reported, how soon, and what is not."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from config.robot import BodyConfig
from drivers.messages import Flags, Odometry, Pose, Twist
from drivers.se2 import exp
from runtime.cycle.motion_monitor import AGE_S, EXCESS, GAIN, STALL_S, STANDSTILL, MotionMonitor, Movement

pytestmark = pytest.mark.promise("P25")

BODY = BodyConfig(radius_m=0.381, speed_max_m_s=0.5, turn_max_rad_s=1.0, synchro=True)
TICK_S = 0.01
FORWARD, HALTED = Twist(0.3, 0.0), None
HERE = Pose(0.0, 0.0, 0.0)


def approach(speed: float, target: float, most: float) -> float:
    return speed + max(-most, min(most, target - speed))


@dataclass
class Base:
    """A base with limited acceleration, commanded and observed in cycles."""

    body: BodyConfig = BODY
    cycle_s: float = 0.05
    delay_s: float = 0.1
    """From a command until the wheels know it."""
    braking: float = 1.0
    """Its true acceleration as a share of the configured one."""
    gain: float = 1.0
    """Its true velocity as a share of the commanded one."""
    obeys: bool = True
    blocked: bool = False
    pushed: Twist = STANDSTILL
    """Velocity by which a hand moves it beside what its wheels do."""
    noise: Callable[[], tuple[float, float]] = lambda: (0.0, 0.0)
    """Error of the odometry's x and heading at each sample, m and rad."""
    now_s: float = 0.0
    pose: Pose = HERE
    twist: Twist = STANDSTILL
    commands: list[tuple[float, Twist]] = field(default_factory=list)
    monitor: MotionMonitor = field(default_factory=MotionMonitor)
    found: list[tuple[float, Movement]] = field(default_factory=list)

    def _tick(self) -> None:
        self.now_s += TICK_S
        known = next((twist for at_s, twist in reversed(self.commands) if at_s + self.delay_s <= self.now_s), None)
        if known is not None and self.obeys:
            most, turn_most = self.body.acceleration_max_m_s2, self.body.turn_acceleration_max_rad_s2
            target = STANDSTILL if self.blocked else Twist(self.gain * known.v, self.gain * known.w)
            share = self.braking * TICK_S
            self.twist = Twist(
                approach(self.twist.v, target.v, share * most), approach(self.twist.w, target.w, share * turn_most)
            )
        v, w = self.twist.v + self.pushed.v, self.twist.w + self.pushed.w
        self.pose = self.pose.compose(exp(v * TICK_S, 0.0, w * TICK_S))

    def cycle(self, command: Twist | None, *, odometry: bool = True, is_sent: bool = True) -> Movement:
        """Run a cycle: what the base has done since the last one, and then a command unless the line is lost."""
        due_s = self.now_s + self.cycle_s
        while self.now_s < due_s - 1e-9:
            self._tick()
        off_m, off_rad = self.noise()
        seen = replace(self.pose, x=self.pose.x + off_m, theta=self.pose.theta + off_rad)
        sample = Odometry(self.now_s, seen, 0.0, self.twist, Flags.NONE, 0) if odometry else None
        self.monitor = self.monitor.observe(sample, self.now_s, self.body)
        if self.monitor.movement is not Movement.AS_COMMANDED:
            self.found.append((self.now_s, self.monitor.movement))
        if not is_sent:
            return self.monitor.movement
        self.monitor = self.monitor.command(command, self.now_s)
        self.commands = [*self.commands[-20:], (self.now_s, STANDSTILL if command is None else command)]
        return self.monitor.movement

    def run(self, command: Twist | None, seconds: float) -> Base:
        for _ in range(round(seconds / self.cycle_s)):
            self.cycle(command)
        return self

    def until_found(self, command: Twist | None, seconds: float) -> tuple[Movement, float]:
        """Run until something is reported; return it, and after how long."""
        began_s = self.now_s
        for _ in range(round(seconds / self.cycle_s)):
            if self.cycle(command) is not Movement.AS_COMMANDED:
                return self.monitor.movement, self.now_s - began_s
        raise AssertionError("nothing was reported")


def driving(base: Base, command: Twist = FORWARD, seconds: float = 3.0) -> Base:
    base.run(STANDSTILL, 2.0).run(command, seconds)
    assert base.found == []
    return base


@pytest.mark.parametrize(
    ("acceleration", "cycle_s"), [(0.1, 0.05), (0.5, 0.01), (0.5, 0.05), (0.5, 0.2), (3.0, 0.05), (50.0, 0.05)]
)
@pytest.mark.parametrize("command", [Twist(0.5, 0.0), Twist(-0.5, 1.0)], ids=str)
def test_a_base_that_brakes_is_not_reported(acceleration: float, cycle_s: float, command: Twist) -> None:
    """From its top speed, a tenth too fast, and as late as a command may be."""
    update = {"acceleration_max_m_s2": acceleration, "turn_acceleration_max_rad_s2": 4.0 * acceleration}
    base = Base(BODY.model_copy(update=update), cycle_s, AGE_S - cycle_s if cycle_s < AGE_S else 0.0, gain=1.1)
    driving(base, command, 6.0).run(HALTED, 7.0)
    assert base.found == []


@pytest.mark.parametrize(("speed", "braking"), [(0.1, 0.5), (0.3, 0.5), (0.5, 0.7)])
def test_a_base_that_brakes_less_than_configured_is_not_reported(speed: float, braking: float) -> None:
    base = driving(Base(braking=braking), Twist(speed, 0.0), 4.0).run(HALTED, 5.0)
    assert base.found == []


@pytest.mark.parametrize("seed", range(100, 104))
def test_any_drive_is_as_commanded(seed: int) -> None:
    """Random commands, some to and fro and some for long; odometry that trembles, drifts, and is sometimes lost."""
    rng = random.Random(seed)
    drift = [0.0]

    def noise() -> tuple[float, float]:
        drift[0] += rng.gauss(0.0, 0.002)
        return rng.choice((-0.001, 0.0, 0.001)), drift[0] + rng.choice((-0.002, 0.002))

    base = Base(
        delay_s=rng.uniform(0.0, 0.12), gain=rng.uniform(0.85, 1.15), braking=rng.uniform(0.7, 3.0), noise=noise
    )
    while base.now_s < 40.0:
        command = rng.choice((HALTED, STANDSTILL, Twist(rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0))))
        for _ in range(rng.choice((1, 2, 5, 40))):
            base.cycle(command, odometry=rng.random() < 0.8)
    assert base.found == []


@pytest.mark.parametrize(
    ("leap_m", "leap_rad"), [(0.09, 0.09), (0.3, 0.0), (5.0, 0.0), (1e5, 0.0), (0.0, 0.3), (0.0, 2.0)]
)
def test_a_leap_of_the_odometry_is_no_motion(leap_m: float, leap_rad: float) -> None:
    off = [(0.0, 0.0)]
    base = driving(Base(noise=lambda: off[0]))
    off[0] = leap_m, leap_rad
    base.run(HALTED, 2.0)
    assert base.found == []


@pytest.mark.parametrize(
    ("command", "most_s"),
    [
        (Twist(0.5, 0.0), 1.3),
        (FORWARD, 1.1),
        (Twist(-0.1, 0.0), 2.3),
        (Twist(0.03, 0.0), 6.5),
        (Twist(0.0, 0.3), 1.2),
    ],
    ids=str,
)
def test_a_base_that_goes_on_after_a_halt_was_not_stopped(
    command: Twist, most_s: float, measured: Callable[[str], None]
) -> None:
    base = driving(Base(), command)
    base.obeys = False
    movement, after_s = base.until_found(HALTED, 10.0)
    assert movement is Movement.UNSTOPPED
    assert after_s <= most_s
    way = EXCESS.along + GAIN * abs(command.v) * (AGE_S + 0.5 * abs(command.v) / BODY.acceleration_max_m_s2)
    if command.v:
        assert abs(command.v) * after_s <= 1.25 * way + 2.0 * base.cycle_s * abs(command.v)
    again, _ = base.until_found(HALTED, 10.0)
    assert again is Movement.UNSTOPPED, "as often as it moves so far again"
    measured(f"HALT ignored at {command.v:g} m/s and {command.w:g} rad/s: reported {after_s:.2f} s later")


@pytest.mark.parametrize("pushed", [Twist(0.4, 0.0), Twist(-0.05, 0.0), Twist(0.0, 0.5)], ids=str)
@pytest.mark.parametrize("command", [HALTED, STANDSTILL], ids=str)
def test_a_base_that_stood_before_may_be_pushed(pushed: Twist, command: Twist | None) -> None:
    """Never called one that does not stop, however long and by what pauses it is pushed."""
    base = driving(Base()).run(command, 2.0)
    base.pushed = pushed
    base.run(command, 6.0)
    base.pushed = STANDSTILL
    base.run(command, 0.1)
    base.pushed = pushed
    base.run(command, 6.0)
    assert {movement for _, movement in base.found} == {Movement.UNCOMMANDED}


def test_a_push_of_a_hand_s_breadth_is_not_reported() -> None:
    base = driving(Base()).run(HALTED, 2.0)
    base.pushed = Twist(0.2, 0.0)
    base.run(HALTED, 0.6)
    base.pushed = STANDSTILL
    base.run(HALTED, 2.0)
    assert base.found == []


@pytest.mark.parametrize("truly", [Twist(0.5, 0.0), Twist(-0.2, 0.0), Twist(0.2, 0.5)], ids=str)
def test_a_base_that_moves_otherwise_than_commanded(truly: Twist) -> None:
    """Too fast, the wrong way as with motors wired in reverse, or turning."""
    base = driving(Base(), Twist(0.2, 0.0))
    base.obeys, base.twist = False, truly
    movement, after_s = base.until_found(Twist(0.2, 0.0), 3.0)
    assert movement is Movement.UNSTOPPED
    assert after_s <= 1.0


def test_a_base_that_moves_when_it_is_first_seen_has_time_to_brake() -> None:
    """By commands of another program, say."""
    base = Base(twist=Twist(0.5, 0.0), pose=Pose(100.0, 3.0, 1.0)).run(STANDSTILL, 5.0)
    assert base.found == []


@pytest.mark.parametrize("command", [FORWARD, Twist(-0.03, 0.0), Twist(0.0, 0.3)], ids=str)
def test_a_base_that_does_not_move_is_reported_after_a_second(command: Twist) -> None:
    base = driving(Base(blocked=True), STANDSTILL)
    movement, after_s = base.until_found(command, 3.0)
    assert movement is Movement.MISSING
    assert STALL_S <= after_s <= STALL_S + 2.1 * base.cycle_s


def test_a_base_that_is_held_for_less_than_a_second_is_not() -> None:
    base = driving(Base())
    for _ in range(3):
        base.blocked = True
        base.twist = STANDSTILL
        base.run(FORWARD, 0.8)
        base.blocked = False
        base.run(FORWARD, 0.5)
    assert base.found == []


def to_and_fro(k: int) -> Twist:
    return Twist(0.0, 0.3 if k % 2 else -0.3)


@pytest.mark.parametrize(
    "command",
    [lambda _: Twist(0.02, 0.04), to_and_fro, lambda k: FORWARD if k % 16 else STANDSTILL],
    ids=["too slow for its wheels", "to and fro", "with pauses"],
)
def test_commands_that_need_not_move_it(command: Callable[[int], Twist]) -> None:
    base = Base(blocked=True).run(STANDSTILL, 1.0)
    for k in range(400):
        base.cycle(command(k))
    assert base.found == []


def random_base(seed: int) -> tuple[Base, random.Random]:
    """Return a base with limits of its own, which obeys within them, late and not exactly."""
    rng = random.Random(seed)
    limits = {
        "speed_max_m_s": rng.uniform(0.1, 1.5), "turn_max_rad_s": rng.uniform(0.3, 4.0),
        "acceleration_max_m_s2": 10.0 ** rng.uniform(-1.3, 1.0),
        "turn_acceleration_max_rad_s2": 10.0 ** rng.uniform(-0.5, 1.3),
    }  # fmt: skip
    base = Base(
        BODY.model_copy(update=limits), rng.choice((0.025, 0.05, 0.1)), rng.uniform(0.0, 0.1),
        braking=rng.uniform(0.8, 1.2), gain=rng.uniform(0.85, 1.1),
    )  # fmt: skip
    return base, rng


def command_at_random(base: Base, rng: random.Random, seconds: float) -> None:
    """Command in every manner: pulses of one cycle, creeping, to and fro, trembling about standstill, full stick."""
    fastest, turn = base.body.speed_max_m_s, base.body.turn_max_rad_s
    while base.now_s < seconds:
        v, w = rng.uniform(-fastest, fastest), rng.uniform(-turn, turn)
        creep = Twist(rng.choice((0.0, 4e-4, -0.01)), rng.choice((0.0, 1e-3, -0.02)))
        pattern = rng.choice((
            (Twist(v, 0.0), STANDSTILL, STANDSTILL), (Twist(v, w), creep, STANDSTILL, creep), (creep,),
            (Twist(v, w),), (Twist(0.0, w), Twist(0.0, -w)), (Twist(v, 0.0), creep), (HALTED,),
        ))  # fmt: skip
        for k in range(rng.choice((3, 20, 80))):
            base.cycle(pattern[k % len(pattern)], odometry=rng.random() < 0.9)


def assert_obedient(seeds: range, seconds: float) -> str:
    for seed in seeds:
        base, rng = random_base(seed)
        command_at_random(base, rng, seconds)
        missing = [at_s for at_s, movement in base.found if movement is Movement.MISSING]
        assert missing == [], f"seed {seed}"
    return f"{len(seeds)} random bases, {len(seeds) * seconds / 3600.0:.2f} h: none is said not to move"


def test_no_base_that_obeys_within_its_limits_is_said_not_to_move(measured: Callable[[str], None]) -> None:
    measured(assert_obedient(range(12), 30.0))


@pytest.mark.soak
def test_no_base_that_obeys_is_said_not_to_move_in_ten_hours(measured: Callable[[str], None]) -> None:
    measured(assert_obedient(range(100, 220), 300.0))


@pytest.mark.parametrize("seed", range(12))
def test_any_base_with_blocked_wheels_is_reported(seed: int) -> None:
    """Once a base with its limits would have moved, and after a second at least."""
    base, rng = random_base(seed)
    command_at_random(base, rng, 5.0)
    base.run(STANDSTILL, 1.0 + base.body.speed_max_m_s / base.body.acceleration_max_m_s2 * 1.3)
    base.blocked, base.found = True, []
    base.run(STANDSTILL, 1.0)
    movement, after_s = base.until_found(Twist(rng.choice((-1.0, 1.0)) * base.body.speed_max_m_s, 0.0), 10.0)
    assert movement is Movement.MISSING
    assert STALL_S <= after_s <= STALL_S + 2.1 * base.cycle_s + 0.03 / base.body.acceleration_max_m_s2


def test_full_stick_after_a_creep_has_its_own_second() -> None:
    """A creep of .4 mm/s moves no base by an amount that shows, and says nothing of what follows."""
    base = Base(blocked=True).run(STANDSTILL, 1.0).run(Twist(4e-4, 0.0), 20.0)
    movement, after_s = base.until_found(Twist(0.5, 0.0), 3.0)
    assert movement is Movement.MISSING
    assert after_s >= STALL_S


@pytest.mark.parametrize("gap_s", [0.39, 0.9, 1.5, 5.0])
def test_odometry_that_is_missing_for_a_while_says_nothing_of_what_lies_between(gap_s: float) -> None:
    base = driving(Base())
    for _ in range(round(gap_s / base.cycle_s)):
        base.cycle(FORWARD, odometry=False)
    base.run(FORWARD, 1.0).run(HALTED, 3.0)
    assert base.found == []
    base = driving(Base())
    base.obeys = False
    for _ in range(round(gap_s / base.cycle_s)):
        base.cycle(HALTED, odometry=False)
    movement, after_s = base.until_found(HALTED, 5.0)
    assert movement is Movement.UNSTOPPED
    assert after_s <= 1.2


def test_a_pose_is_compared_along_its_heading() -> None:
    """Driving in circles brings it back, and turns by the command alone."""
    base = driving(Base(), Twist(0.3, 0.6), 4.0 * math.pi)
    assert base.run(HALTED, 3.0).found == []


@pytest.mark.parametrize("lost_s", [0.2, 0.5, 0.95, 3.0])
def test_a_base_goes_on_by_its_last_command_while_the_line_is_lost(lost_s: float) -> None:
    """And brakes once the line is back and HALT reaches it."""
    base = driving(Base(), Twist(0.5, 0.0))
    for _ in range(round(lost_s / base.cycle_s)):
        base.cycle(HALTED, odometry=False, is_sent=False)
    base.run(HALTED, 3.0)
    assert base.found == []


def test_the_velocity_that_commands_explain() -> None:
    """Held for as long as the newest odometry may still show it, then falling by the base's deceleration."""
    monitor, explained = MotionMonitor(), []
    for k in range(40):
        at_s = 0.09 * k
        sample = Odometry(at_s, HERE, 0.0, STANDSTILL, Flags.NONE, 0)
        monitor = monitor.observe(sample, at_s, BODY)
        explained.append(tuple(direction.explained for direction in monitor.directions))
        monitor = monitor.command(Twist(0.3, -0.4) if k == 19 else Twist(0.1, -0.4) if k == 20 else None, at_s)
    fastest, turn = BODY.speed_max_m_s, BODY.turn_max_rad_s
    assert explained[0] == (fastest, fastest, turn, turn), "unknown at first"
    assert explained[1] == pytest.approx((0.455, 0.455, 0.82, 0.82))
    assert explained[19] == (0.0,) * 4
    assert [row[0] for row in explained[20:]] == pytest.approx(
        [0.3, 0.3, 0.255, 0.21, 0.165, 0.12, 0.075, 0.03] + [0.0] * 12
    )
    assert {row[1:3] for row in explained[20:]} == {(0.0, 0.0)}, "forward and right explain no backward and left"
    assert [row[3] for row in explained[20:]] == pytest.approx([0.4, 0.4, 0.4, 0.22, 0.04] + [0.0] * 15)


def test_without_any_command_no_motion_is_explained() -> None:
    """As before the first cycle of a robot that is connected."""
    monitor, found = MotionMonitor(), set()
    for k in range(100):
        pose = Pose(0.02 * max(0, k - 40), 0.0, 0.0)
        monitor = monitor.observe(Odometry(0.05 * k, pose, 0.0, STANDSTILL, Flags.NONE, 0), 0.05 * k, BODY)
        found.add(monitor.movement)
    assert found == {Movement.AS_COMMANDED, Movement.UNCOMMANDED}
