"""The protocol's constants and frame types, which every robot of this family shares."""

from __future__ import annotations

import dataclasses
from typing import get_args

import pytest

from drivers.denning import frames
from drivers.denning.codec import FRAME_MAX
from drivers.denning.frames import Halt, Hello, HostFrame, NakCode, RobotFrame


def test_the_numbers_of_the_protocol() -> None:
    """A robot elsewhere has them too."""
    assert [(code.name, int(code)) for code in NakCode] == [
        ("UNKNOWN_TYPE", 1), ("WRONG_LENGTH", 2), ("VALUE_OUT_OF_RANGE", 3), ("LATCHED", 4),
    ]  # fmt: skip
    assert (frames.VERSION, frames.SENSORS_MAX, frames.MASKS_MAX) == (2, 24, 24)
    assert (frames.WINDOW_MIN, frames.WINDOW_MAX) == (5, 255)
    assert (frames.FAULT, frames.TENTHS_MIN, frames.TENTHS_MAX, frames.NO_ECHO) == (0, 5, 254, 255)
    assert frames.TENTH_FT_M == 0.03048
    assert FRAME_MAX == 128


def test_every_frame_starts_with_its_sequence_number_and_cannot_be_changed() -> None:
    kinds = [*get_args(HostFrame), *get_args(RobotFrame)]
    assert len(kinds) == 14
    assert all(dataclasses.fields(kind)[0].name == "seq" for kind in kinds)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Halt(1).seq = 2  # type: ignore[misc]


def test_a_hello_asks_for_what_every_robot_speaks() -> None:
    assert Hello(3) == Hello(3, 1)
