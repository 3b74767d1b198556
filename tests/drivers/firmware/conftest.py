"""Firmware that ends with its test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

import pytest

from tests.drivers.firmware.board import BoardRobot

Boards: TypeAlias = Callable[..., BoardRobot]


@pytest.fixture
def boards(tmp_path: Path) -> Iterator[Boards]:
    """Return a function that starts firmware: its arguments are those of `BoardRobot` after the folder."""
    started: list[BoardRobot] = []

    def start(*args: object, **settings: object) -> BoardRobot:
        folder = tmp_path / str(len(started))
        folder.mkdir()
        started.append(BoardRobot(folder, *args, **settings))  # type: ignore[arg-type]
        started[-1].wait_until_ready()
        return started[-1]

    yield start
    for robot in started:
        robot.close()
