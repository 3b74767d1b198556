"""SI to commands and back: firing patterns as polling sequences, limits, velocities, the base's status."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from config.families.arcos import ArcosConfig
from config.load import load_robot
from config.robot import FiringConfig, RobotConfig
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import SipFlags
from drivers.arcos.wire_units import (
    Limits,
    discs_of,
    drive_commands,
    flags_of,
    limit_commands,
    limits_of,
    polling_of,
)
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError
from drivers.messages import Flags, Twist
from tests.drivers.arcos.vectors import P3DX, TAIL

N = CommandNumber


def with_firing(name: str, firing: FiringConfig) -> RobotConfig:
    robot = load_robot(name)
    return robot.model_copy(update={"ring": robot.ring.model_copy(update={"firing": firing})})


def sequence(robot: RobotConfig) -> list[int]:
    return list(polling_of(robot, discs_of(robot)).sequence)


def test_the_factory_sequence_is_opposite_pairs() -> None:
    robot = load_robot("p3dx")
    polling = polling_of(robot, discs_of(robot))
    assert list(polling.sequence)[0::2] == list(range(1, 9))
    assert list(polling.sequence)[1::2] == list(range(9, 17))
    assert polling.commands == (Command(N.SONARCYCLE, 41), Command(N.POLLING, polling.sequence))
    assert polling.arrays == SipFlags.SONAR_1 | SipFlags.SONAR_2


@pytest.mark.parametrize(
    ("name", "array", "first"),
    [("amigo", 8, [1, 2]), ("powerbot", 7, [1, 9, 17, 25, 2]), ("peoplebot", 8, [1, 9, 21, 29])],
)
def test_every_shipped_pattern_fires_each_disc_once(name: str, array: int, first: list[int]) -> None:
    robot = load_robot(name)
    fired = sequence(robot)
    assert fired[: len(first)] == first
    assert sorted(disc - 1 for disc in fired) == list(discs_of(robot))
    assert len(fired) % array == 0


def test_a_pattern_of_ones_own() -> None:
    firing = FiringConfig(sets=((3, 11), (4, 12), (3, 8)), step_period_s=0.0351)
    robot = with_firing("p3dx", firing)
    assert sequence(robot) == [4, 12, 5, 13, 4, 9]
    assert polling_of(robot, discs_of(robot)).cycle_ms == 36


@pytest.mark.parametrize(
    "firing",
    [
        FiringConfig(preset="single", step_period_s=0.04),
        FiringConfig(preset="octets", step_period_s=0.04),
        FiringConfig(sets=((0, 8), (1,)), step_period_s=0.04),
        FiringConfig(sets=((0, 1),), step_period_s=0.04),
    ],
)
def test_a_pattern_that_the_arrays_cannot_fire_is_refused(firing: FiringConfig) -> None:
    with pytest.raises(FiringError, match="one sensor of each array of 8 at a time"):
        sequence(with_firing("p3dx", firing))


def test_a_pattern_that_is_too_long_or_too_slow_is_refused() -> None:
    with pytest.raises(FiringError, match="17 firings before the pattern repeats"):
        sequence(with_firing("p3dx", FiringConfig(sets=((0, 8),) * 17, step_period_s=0.04)))
    with pytest.raises(FiringError, match="sonar cycle is"):
        sequence(with_firing("p3dx", FiringConfig(preset="opposite_pairs", step_period_s=0.121)))


@pytest.mark.parametrize("discs", [(0, 1), (0,) * 16, tuple(range(17))])
def test_each_sensor_has_one_disc(discs: tuple[int, ...]) -> None:
    with pytest.raises(DriverError, match=r"arcos.discs: \d+ different numbers for the 16 sensors"):
        discs_of(load_robot("p3dx").model_copy(update={"arcos": ArcosConfig(discs=discs)}))


def test_the_lower_limits_apply() -> None:
    body = load_robot("p3dx").body
    assert limits_of(body, None) == Limits(500, 57)
    assert limits_of(body, P3DX) == Limits(500, 57)
    assert limits_of(body, replace(P3DX, speed_max=400, turn_top=30)) == Limits(400, 30)
    assert limits_of(body, replace(P3DX, speed_max=0, turn_max=None)) == Limits(500, 57), "not known"


def test_the_base_gets_the_robot_files_accelerations() -> None:
    body = load_robot("p3dx").body
    commands = limit_commands(body, replace(P3DX, acceleration_top=200, turn_acceleration_top=0), Limits(500, 57))
    assert commands == (
        Command(N.SETV, 500),
        Command(N.SETA, 200),
        Command(N.SETA, -200),
        Command(N.SETRV, 57),
        Command(N.SETRA, 97),
        Command(N.SETRA, -228),
    )


def test_it_stops_within_a_quarter_of_a_second_once_its_watchdog_has_run_out() -> None:
    body = load_robot("p3dx").body
    assert Command(N.SETA, -2000) in limit_commands(body, P3DX, Limits(500, 57))


@pytest.mark.parametrize(
    ("twist", "v", "w"),
    [
        (Twist(0.2, 0.0), 200, 0),
        (Twist(-0.15, -0.5), -150, -29),
        (Twist(9.0, -9.0), 500, -57),
        (Twist(1e300, -1e300), 500, -57),
    ],
)
def test_velocities_are_clamped(twist: Twist, v: int, w: int) -> None:
    assert drive_commands(twist, Limits(500, 57)) == (Command(N.VEL, v), Command(N.RVEL, w))


@pytest.mark.parametrize(
    ("fields", "flags"),
    [
        ({"flags": 0x1F}, Flags.NONE),
        ({"flags": 0x1E}, Flags.LATCHED),
        ({"flags": 0x3F}, Flags.LATCHED),
        ({"flags": 0x5F}, Flags.LATCHED),
        ({"flags": 0x1F, "stall_left": 0x08}, Flags.BUMPER),
        ({"flags": 0x1F, "stall_right": 0x80}, Flags.BUMPER),
        ({"flags": 0x1F, "stall_left": 0x01}, Flags.MOTOR_FAULT),
        ({"flags": 0x21, "stall_left": 0x09, "stall_right": 0x05}, Flags.LATCHED | Flags.BUMPER | Flags.MOTOR_FAULT),
        ({"flags": 0x1F, "battery": 109, "battery_10": None}, Flags.BATTERY_LOW),
        ({"flags": 0x1F, "battery": 255, "battery_10": 230}, Flags.NONE),
        ({"flags": 0x1F, "battery": 120, "battery_10": 0}, Flags.NONE),
        ({"flags": 0x1F, "battery": 120, "battery_10": 100}, Flags.BATTERY_LOW),
    ],
)
def test_the_status_is_that_of_the_flags_and_stall_bytes(fields: dict[str, int], flags: Flags) -> None:
    assert flags_of(replace(TAIL, **fields), 110) == flags  # type: ignore[arg-type]


def test_a_turn_of_one_radian_per_second_is_57_degrees() -> None:
    assert drive_commands(Twist(0.0, math.radians(30.0)), Limits(500, 57))[1].argument == 30
