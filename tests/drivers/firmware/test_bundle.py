"""The files for a board, and the robot file made from its configuration."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, get_args

import pytest

from config.errors import DONE
from config.load import load_robot, load_settings
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
from runtime.cli.app import run_command
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import Run

BOARDS: tuple[Board, ...] = get_args(Board)
PAGE = (Path(__file__).parents[3] / "docs/build-a-ring.md").read_text("utf-8")
OF_THE_PAGE = dict(re.findall(r"```python\n# (\w+)\n(.*?)```", PAGE, re.DOTALL))


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
        ({"SENSORS": (("hcsr04", 0, 4),)}, "SENSORS: sensor 0 is .'hcsr04', 0, 4.; give hc-sr04, "),
        ({"SENSORS": (("hc-sr04", 0, 4), ("hc-sr04", 0))}, "sensor 1 is .'hc-sr04', 0."),
        ({"SENSORS": (("srf8", 112),)}, "or srf08, srf10 with an address"),
        ({"SENSORS": ((),)}, "a value is malformed"),
        ({"LINE": (1, 2, 3)}, "a value is malformed"),
        ({"RESOLUTION_M": None}, "a value is neither a number nor a plain text"),
        ({"NAME": "my\nring"}, "a value is neither a number nor a plain text"),
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


@pytest.mark.parametrize("name", ["hobby3", "hobby8", "parking12"])
def test_the_robots_of_the_page_are_the_shipped_ones(name: str) -> None:
    """Wired as docs/build-a-ring.md says, each gives the ring, the pattern and the base of its robot file."""
    changes = read_config(OF_THE_PAGE[name], "the page")
    check_pins(values(**changes), "pico", CONFIG_NAME)
    built, shipped = config(**changes), load_robot(name)
    assert built.body == shipped.body
    assert built.ring == shipped.ring


@pytest.mark.parametrize("board", BOARDS)
def test_the_wiring_of_three_sensors_is_that_of_either_board(board: Board) -> None:
    rows = re.findall(r"\| (\d) \| [\w° ]+ \| GP(\d+), (\d+) \| GP(\d+), (\d+) \|", PAGE)
    at = BOARDS.index(board)
    sensors = tuple(("hc-sr04", int(row[1 + at]), int(row[3 + at])) for row in rows)
    assert [int(row[0]) for row in rows] == [0, 1, 2]
    changes = read_config(OF_THE_PAGE["hobby3"], "the page")
    check_pins(values(board, **changes | {"SENSORS": sensors}), board, CONFIG_NAME)
    assert board == "esp32" or sensors == changes["SENSORS"]


def test_the_commands_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From parts to driving: write the firmware, put the page's lines in, write it again, check, run (emulated)."""
    monkeypatch.chdir(tmp_path)
    words = next(line.split("`")[1] for line in PAGE.splitlines() if "echolocate firmware" in line).split()[1:]
    assert words == ["firmware", "--board", "pico", "--out", "my-ring"]
    assert run_command(words) == DONE
    place = tmp_path / "my-ring" / CONFIG_NAME
    lines = place.read_text("utf-8")
    place.write_text(f"{lines}\n{OF_THE_PAGE['hobby3']}", encoding="utf-8")
    assert run_command(words) == DONE
    assert run_command(["check", "my-ring/robot.toml"]) == DONE
    assert load_robot("my-ring/robot.toml").ring == load_robot("hobby3").ring
    settings = load_settings("room", ["perception.method=paper"], robot="my-ring/robot.toml")
    assert settings.world is not None
    run = Run(settings, settings.world, 0)
    run.until_true(lambda: run.mode is Mode.DRIVE, 4.0)


def test_a_sensor_on_a_servo_is_in_the_robot_file_and_needs_its_place() -> None:
    one: dict[str, Any] = {
        "SENSORS": (("hc-sr04", 0, 4),),
        "SERVOS": ((0, 26, 1500, 2400, 13, 180),),
        "FIRING": "single",
    }
    robot = config(**one, MOUNTS=((10, 0, 0),), STEP_PERIOD_S=0.06)
    (sensor,) = robot.ring.sensors or ()
    assert (sensor.servo, sensor.bearings, sensor.sweep_deg, sensor.x_m) == (True, 13, 180.0, 0.01)
    check_pins(values(**one, MOUNTS=((10, 0, 0),)), "pico", CONFIG_NAME)
    with pytest.raises(FirmwareError, match="SERVOS without MOUNTS"):
        config(**one)


@pytest.mark.parametrize("board", BOARDS)
def test_a_trigger_has_20_us_as_shipped(board: Board) -> None:
    assert values(board)["TRIGGER_US"] == 20
