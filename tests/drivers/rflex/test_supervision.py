"""The brake is set once the base stands, and released until that is reported; a base that does not follow."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_robot
from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.body import Body
from drivers.emulator.scene import compile_scene
from drivers.messages import Pose, Twist
from drivers.rflex.codec import BRAKE_RELEASE, BRAKE_SET, MOTOR_SET_DIR, STATUS_REQUEST, Frame, direction_of
from drivers.rflex.supervision import Brake, Mode, StallMonitor

B21R = load_robot("b21r")
STILL = Twist(0.0, 0.0)


def sent(brake: Brake, from_s: float, to_s: float) -> list[Frame]:
    steps = range(round(100 * from_s), round(100 * to_s))
    return [frame for k in steps if (frame := brake.due(0.01 * k)) is not None]


def mode(brake: Brake) -> Mode:
    return brake.mode


def stalled(stall: StallMonitor) -> bool:
    return stall.is_stalled


def test_a_halt_stops_and_then_brakes() -> None:
    brake = Brake(B21R)
    brake.halt()
    brake.observe_speed(Twist(0.3, 0.0))
    first = sent(brake, 0.0, 0.05)
    assert [frame.opcode for frame in first] == [MOTOR_SET_DIR, MOTOR_SET_DIR, 1]
    brake.observe_speed(STILL)
    assert BRAKE_SET in sent(brake, 0.05, 0.1)
    brake.observe_status(0.06, on=True)
    assert mode(brake) is Mode.HALTING, "that may be from before"
    brake.observe_status(0.12, on=True)
    assert mode(brake) is Mode.HELD
    assert set(sent(brake, 0.2, 0.5)) == {STATUS_REQUEST}
    brake.observe_status(0.5, on=False)
    assert mode(brake) is Mode.HALTING, "something else released it"


def test_a_base_that_does_not_obey_is_braked_in_motion() -> None:
    brake = Brake(B21R)
    brake.halt()
    moving = sent(brake, 0.0, 1.0)
    assert BRAKE_SET not in moving
    assert {direction_of(frame)[1] for frame in moving if frame.opcode == MOTOR_SET_DIR} == {0, 1}
    assert BRAKE_SET in sent(brake, 1.0, 1.2)
    assert brake.halting_s(1.2) == 1.2


def test_a_release_is_repeated_until_it_is_reported() -> None:
    brake = Brake(B21R)
    brake.release()
    assert sent(brake, 0.0, 0.3).count(BRAKE_RELEASE) == 3
    assert (brake.tries, brake.may_drive) == (3, False)
    brake.observe_status(0.3, on=False)
    assert mode(brake) is Mode.RELEASED
    assert brake.may_drive
    brake.observe_status(0.4, on=True)
    assert mode(brake) is Mode.HELD, "an emergency stop"
    brake.release()
    brake.forget()
    assert mode(brake) is Mode.HELD
    brake.halt()
    brake.forget()
    assert mode(brake) is Mode.HALTING


def test_a_base_that_does_not_follow_is_stalled() -> None:
    stall = StallMonitor(B21R)
    stall.command(Twist(-0.3, 0.0), 0.0)
    stall.observe(STILL, 0.3)
    assert not stalled(stall), "it accelerates"
    stall.observe(Twist(-0.2, 0.0), 0.8)
    assert not stalled(stall)
    stall.observe(STILL, 1.1)
    assert stalled(stall)
    stall.stop()
    stall.observe(STILL, 2.0)
    assert not stalled(stall)
    stall.command(Twist(0.0, 0.5), 2.0)
    for k in range(8):
        stall.observe(STILL, 2.0 + 0.1 * k)
    assert stalled(stall)
    stall.command(Twist(0.01, 0.1), 2.7)
    for k in range(8):
        stall.observe(STILL, 2.8 + 0.1 * k)
    assert not stalled(stall), "too slow to judge by"


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.soak) for k in range(4, 40))])
def test_a_base_that_obeys_within_its_limits_is_never_stalled_and_one_that_fails_is(seed: int) -> None:
    """Commands of all lengths, that grow, leap, stop and reverse; then the wheels do not turn."""
    rng = np.random.default_rng(seed)
    config = replace_limits(B21R, *rng.uniform((0.15, 0.3), (2.0, 4.0)).tolist())
    world = compile_scene(WorldConfig())
    body = Body(config.body, world, Pose(0.0, 0.0, 0.0), WorldConfig().odometry, rng)
    stall, wanted = StallMonitor(config), STILL
    for k in range(4000):
        if rng.random() < rng.choice((0.02, 0.5)):
            grows = Twist(wanted.v + rng.normal(0.0, 0.03), wanted.w + rng.normal(0.0, 0.1))
            leaps = Twist(rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0))
            wanted = (grows, leaps, STILL)[rng.integers(3)]
        stall.command(wanted, 0.05 * k)
        reported = body.twist
        body.step(0.05, wanted)
        stall.observe(reported if k % 2 else body.twist, 0.05 * (k + 1))
        assert not stalled(stall), f"after {0.05 * k:.2f} s: {wanted} wanted, {reported} reported"
    for k in range(4000, 4080):
        stall.command(Twist(0.3, 0.0), 0.05 * k)
        stall.observe(STILL, 0.05 * (k + 1))
    assert stalled(stall)


def replace_limits(config: RobotConfig, acceleration: float, turn_acceleration: float) -> RobotConfig:
    limits = {"acceleration_max_m_s2": acceleration, "turn_acceleration_max_rad_s2": turn_acceleration}
    return config.model_copy(update={"body": config.body.model_copy(update=limits)})
