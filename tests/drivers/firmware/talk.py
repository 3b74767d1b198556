"""A host that talks to the firmware step by step, and the rings of its tests."""

from __future__ import annotations

from typing import cast

from drivers.denning.device import DenningDevice
from tests.drivers.device_host import Host
from tests.drivers.firmware.board import BoardRobot

UNIT_UM = 172
WINDOW = 131
PAIRS = (0b10001, 0b100010, 0b1000100, 0b10001000)
EIGHT = "SENSORS = (" + "".join(f'("hc-sr04", {i % 4}, {4 + i}), ' for i in range(8)) + ')\nFIRING = "opposite_pairs"'
"""Opposite ones of 8 sensors share a trigger pin; each has its own echo pin."""
MATRIX = "SENSORS = (" + "".join(f'("hc-sr04", {i % 3}, {4 + i // 3}), ' for i in range(24)) + ')\nFIRING = "octets"'
"""24 sensors: 3 trigger pins, 8 echo pins."""
OK, DEAD, HANGS = 0, 1, 2
STEP_S = 0.01
DEADMAN_S = 0.4


def host(robot: BoardRobot) -> Host:
    return Host(cast("DenningDevice", robot))  # of which it uses what both have


def run(h: Host, seconds: float, drive: tuple[int, int] | None = None) -> None:
    h.run(seconds, STEP_S, drive)
