"""The files that a board needs, and the robot file that matches its pins and geometry."""

from __future__ import annotations

import ast
import itertools
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

from pydantic import ValidationError

from config.errors import WRONG_CALL, UserError
from config.robot import RobotConfig
from config.robot_file import start_turn
from drivers.firing_pattern import firing_pattern, sensor_masks, sensors

Board: TypeAlias = Literal["pico", "esp32"]
CONFIG_NAME: Final = "robot_config.py"
_SOURCES: Final = Path(__file__).parent / "board"
_ON_I2C: Final = ("srf08", "srf10")
_PULSED: Final = ("hc-sr04", "mb10xx", "mb12xx")
_MACHINES: Final = 8
"""State machines of the RP2040, each of which times one echo pin."""
_SPEED_SHARE: Final = 0.9
"""Below the base's own limit, so that its control has something left."""


class FirmwareError(UserError):
    """The robot's configuration is wrong; the text says where and what to do."""

    exit_code = WRONG_CALL


def board_files(board: Board) -> dict[str, str]:
    """Return the files of the firmware for a board, by their path on it."""
    files = {CONFIG_NAME: (_SOURCES / f"robot_config_{board}.py").read_text("utf-8")}
    for source in sorted([_SOURCES / "main.py", *(_SOURCES / "ring").glob("*.py")]):
        files[source.relative_to(_SOURCES).as_posix()] = source.read_text("utf-8")
    return files


def read_config(text: str, place: str) -> dict[str, Any]:
    """Return the values of a robot_config.py, which is read and not executed.

    Raises
    ------
    FirmwareError
        It is no Python, or a value is no constant.
    """
    values: dict[str, Any] = {}
    try:
        for statement in ast.parse(text).body:
            match statement:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    values[name] = ast.literal_eval(value)
                case ast.Expr(value=ast.Constant()):
                    pass
                case _:
                    raise FirmwareError(
                        f"{place}:{statement.lineno}: only NAME = value is understood; remove the line"
                    )
    except SyntaxError as error:
        raise FirmwareError(f"{place}:{error.lineno}: {error.msg}; correct the line") from error
    except ValueError as error:
        raise FirmwareError(f"{place}: a value is no constant ({error}); write it out") from error
    return values


def robot_file(values: Mapping[str, Any], place: str) -> str:
    """Return the text of the robot file for a board's configuration.

    `values` are as of `read_config`; `place` names the configuration's file in messages.

    Raises
    ------
    FirmwareError
        A value is missing or out of its range.
    """
    try:
        text = _render(values)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        missing = f"{error.args[0]} is missing" if isinstance(error, KeyError) else f"a value is malformed ({error})"
        raise FirmwareError(
            f"{place}: {missing}; compare it with the one that --out in a new folder writes"
        ) from error
    try:
        RobotConfig.model_validate(tomllib.loads(text))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise FirmwareError(f"{place}: gives {where} = {first['input']!r}: {first['msg']}; correct it") from error
    except tomllib.TOMLDecodeError as error:  # a text with line ends, or None for a number, stands in it as it is
        raise FirmwareError(f"{place}: a value is neither a number nor a plain text ({error}); correct it") from error
    return text


def check_pins(values: Mapping[str, Any], board: Board, place: str) -> None:
    """Check that the board can time the echoes of each set of sensors that fire together.

    Raises
    ------
    FirmwareError
        It cannot; the message says what to change.
    """
    if values.get("ECHO_TIMING") not in ("irq", "pio") or (values["ECHO_TIMING"] == "pio" and board != "pico"):
        possible = '"pio" or "irq"' if board == "pico" else '"irq"'
        raise FirmwareError(f"{place}: ECHO_TIMING = {values.get('ECHO_TIMING')!r}: on this board it is {possible}")
    ring = RobotConfig.model_validate(tomllib.loads(robot_file(values, place))).ring
    wires = {i: sensor[1:] for i, sensor in enumerate(values["SENSORS"]) if sensor[0] not in _ON_I2C}
    if values["ECHO_TIMING"] == "pio" and (echoes := len({echo for _, echo in wires.values()})) > _MACHINES:
        raise FirmwareError(
            f'{place}: SENSORS have {echoes} echo pins, and ECHO_TIMING = "pio" times {_MACHINES}; let sensors that '
            f'do not fire together share echo pins through diodes, or set ECHO_TIMING = "irq"'
        )
    firing_pattern(ring)  # refuses steps in which sound does not come back
    for mask in sensor_masks(ring):
        triggers = {wires[i][0] for i in sensors(mask) if i in wires}
        firing = [i for i, (trigger, _) in wires.items() if trigger in triggers]
        for i, j in itertools.combinations(firing, 2):
            if wires[i][1] == wires[j][1]:
                raise FirmwareError(
                    f"{place}: sensors {i} and {j} share echo pin {wires[i][1]}, and FIRING or a shared trigger "
                    f"fires them together; give one of them another pin, or change FIRING"
                )


def _scan(servo: Sequence[float] | None) -> str:
    """Return the keys of a sensor on a servo, given its bearings and sweep; none without."""
    return "" if servo is None else f", servo = true, bearings = {servo[0]}, sweep_deg = {servo[1]:g}"


def _render(values: Mapping[str, Any]) -> str:
    """Return the robot file of a robot_config.py's values.

    Raises
    ------
    ValueError
        They contradict each other.
    """
    for i, (kind, *wires) in enumerate(values["SENSORS"]):
        if kind not in (*_ON_I2C, *_PULSED) or len(wires) != (1 if kind in _ON_I2C else 2):
            raise ValueError(
                f"SENSORS: sensor {i} is {(kind, *wires)!r}; give {', '.join(_PULSED)} with trigger and echo pin, "
                f"or {', '.join(_ON_I2C)} with an address"
            )
    mounts, count = values["MOUNTS"], len(values["SENSORS"])
    if mounts is not None and len(mounts) != count:
        raise ValueError(f"MOUNTS has {len(mounts)} places and SENSORS {count} sensors")
    if values["SERVOS"] and mounts is None:
        raise ValueError("SERVOS without MOUNTS: give the place of each sensor, of one on a servo its axis")
    if mounts is None:
        ring = f"count = {count}\nradius_m = {values['RING_RADIUS_MM'] / 1e3:g}"
    else:
        servos = {servo[0]: servo[4:] for servo in values["SERVOS"]}
        places = ",\n".join(
            f"  {{x_m = {x / 1e3:g}, y_m = {y / 1e3:g}, angle_deg = {angle:g}{_scan(servos.get(i))}}}"
            for i, (x, y, angle) in enumerate(mounts)
        )
        ring = f"sensors = [\n{places},\n]"
    firing = values["FIRING"]
    pattern = f'preset = "{firing}"' if isinstance(firing, str) else f"sets = {[list(numbers) for numbers in firing]}"
    return f"""\
# {values["NAME"]}: made by `echolocate firmware` from {CONFIG_NAME}; change it there and run the command again.

[robot]
driver = "denning"  # the ring-and-base protocol
protocol = 2

[ring]
{ring}
beam_half_angle_deg = {values["BEAM_HALF_ANGLE_DEG"]}
resolution_m = {values["RESOLUTION_M"]}
range_min_m = {values["RANGE_MIN_M"]}
range_max_m = {values["RANGE_MAX_M"]}

[ring.firing]
{pattern}
step_period_s = {values["STEP_PERIOD_S"]}

[body]
radius_m = {values["BODY_RADIUS_MM"] / 1e3:g}
speed_max_m_s = {_SPEED_SHARE * values["SPEED_MAX_MM_S"] / 1e3:g}
turn_max_rad_s = {_SPEED_SHARE * values["TURN_MAX_MRAD_S"] / 1e3:g}
acceleration_max_m_s2 = {values["ACCELERATION_MM_S2"] / 1e3:g}
turn_acceleration_max_rad_s2 = {values["TURN_ACCELERATION_MRAD_S2"] / 1e3:g}
{"" if values["SERVOS"] else start_turn(count)}
[link]
baud = {115200 if values["LINE"] is None else values["LINE"][3]}
"""
