"""The files for a board, and the robot file made from its configuration."""

from __future__ import annotations

import tomllib
from typing import Any, get_args

import pytest

from config.robot import RobotConfig
from drivers.denning.wire_units import wire_pattern
from drivers.firmware.bundle import (
    CONFIG_NAME,
    Board,
    FirmwareError,
    board_files,
    check_pins,
    read_config,
    robot_file,
)

BOARDS: tuple[Board, ...] = get_args(Board)


def values(board: Board = "pico", **changes: Any) -> dict[str, Any]:
    return read_config(board_files(board)[CONFIG_NAME], CONFIG_NAME) | changes


def config(board: Board = "pico", **changes: Any) -> RobotConfig:
    return RobotConfig.model_validate(tomllib.loads(robot_file(values(board, **changes), CONFIG_NAME)))


@pytest.mark.parametrize("board", BOARDS)
def test_the_files_of_a_board(board: Board) -> None:
    files = board_files(board)
    assert {"main.py", CONFIG_NAME, "ring/__init__.py", "ring/robot.py", "ring/wire.py"} <= files.keys()
    assert all(text.startswith('"""') for text in files.values())
    assert ("state machines, for up to 8" in files[CONFIG_NAME]) is (board == "pico")


@pytest.mark.parametrize("board", BOARDS)
def test_the_shipped_configurations_use_each_pin_once(board: Board) -> None:
    v = values(board)
    pins = [pin for pair in (*v["MOTORS"], *v["ENCODERS"]) for pin in pair]
    pins += [*{sensor[2] for sensor in v["SENSORS"]}, *{sensor[1] for sensor in v["SENSORS"]}]
    assert len(set(pins)) == len(pins)
    forbidden = {"pico": {23, 24, 25, 29}, "esp32": {0, 1, 3, *range(6, 12)}}[board]
    assert not forbidden & set(pins)
    outputs = {pin for motor in v["MOTORS"] for pin in motor} | {sensor[1] for sensor in v["SENSORS"]}
    assert board == "pico" or not outputs & {34, 35, 36, 39}, "these are inputs only"


@pytest.mark.parametrize("board", BOARDS)
def test_the_robot_file_matches_the_configuration(board: Board) -> None:
    v, robot = values(board), config(board)
    check_pins(v, board, CONFIG_NAME)
    assert (robot.robot.driver, robot.robot.protocol) == ("denning", 2)
    assert len(robot.ring.mounts) == len(v["SENSORS"])
    assert robot.ring.radius_m == 0.09
    assert robot.body.speed_max_m_s < v["SPEED_MAX_MM_S"] * 1e-3
    assert not robot.body.synchro
    pattern = wire_pattern(robot.ring)
    for mask in pattern.masks:
        fired = [i for i in range(24) if mask >> i & 1]
        assert len({v["SENSORS"][i][2] for i in fired}) == len(fired), "each with its own echo pin"
        assert len({v["SENSORS"][i][1] for i in fired}) == 1, "those that fire together share a trigger"


def test_a_ring_that_is_no_circle_and_sets_of_ones_own() -> None:
    sensors = (("hc-sr04", 0, 4), ("hc-sr04", 1, 5))
    robot = config(SENSORS=sensors, MOUNTS=((80, 0, 0), (-70, 10, 180.5)), FIRING=((0,), (1,)), LINE=(0, 0, 1, 57600))
    assert [(m.x_m, m.y_m) for m in robot.ring.mounts] == [(0.08, 0.0), (-0.07, 0.01)]
    assert robot.ring.firing.sets == ((0,), (1,))
    assert robot.link.baud == 57600


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("A = (", "robot_config.py:1: .*; correct the line"),
        ("A = 1\nimport os", "robot_config.py:2: only NAME = value"),
        ("A = open('x')", "a value is no constant"),
    ],
)
def test_what_is_no_list_of_constants_is_refused(text: str, said: str) -> None:
    with pytest.raises(FirmwareError, match=said):
        read_config(text, CONFIG_NAME)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"RANGE_MAX_M": -1.0}, "gives ring.range_max_m = -1.0: Input should be greater than 0"),
        ({"MOUNTS": ((1, 2, 3),)}, "MOUNTS has 1 places and SENSORS 12 sensors"),
        ({"FIRING": "octet"}, "gives ring.firing"),
        ({"SPEED_MAX_MM_S": "fast"}, "a value is malformed"),
    ],
)
def test_wrong_values_are_named(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(FirmwareError, match=said):
        config(**changes)


def test_a_missing_value_is_named() -> None:
    v = values()
    del v["STEP_PERIOD_S"]
    with pytest.raises(FirmwareError, match="STEP_PERIOD_S is missing"):
        robot_file(v, CONFIG_NAME)


def test_nine_echo_pins_are_more_than_there_are_state_machines() -> None:
    nine = tuple(("hc-sr04", 0, 4 + i) for i in range(9))
    with pytest.raises(FirmwareError, match='9 echo pins, and ECHO_TIMING = "pio" times 8'):
        check_pins(values(SENSORS=nine, FIRING="single"), "pico", CONFIG_NAME)
    check_pins(values(SENSORS=nine, FIRING="single", ECHO_TIMING="irq"), "pico", CONFIG_NAME)
