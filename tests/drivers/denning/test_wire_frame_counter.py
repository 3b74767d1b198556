"""Counting of whole echoes and drive commands in bytes that are split anywhere."""

from __future__ import annotations

from drivers.denning.codec import encode
from drivers.denning.frames import Ack, Drive, Echo, Echo2, Echo3, Halt
from drivers.denning.wire_frame_counter import WireFrameCounter

ECHO = encode(Echo(0, 1000, 0, 0b11, (20, 255)))
DRIVE = encode(Drive(1, 100, 0))


def test_a_frame_counts_when_its_last_byte_arrives() -> None:
    counter = WireFrameCounter()
    data = encode(Ack(0, 1)) + ECHO + ECHO
    assert [counter.echoes(data[k : k + 1]) for k in range(len(data))].count(1) == 2
    assert counter.drives(DRIVE + encode(Halt(2)) + DRIVE[:3]) == 1
    assert counter.drives(DRIVE[3:]) == 1


def test_the_echoes_of_every_version_count() -> None:
    finer = encode(Echo2(1, 1000, 0, 0b1, 0b10, (900, 1000))) + encode(Echo3(2, 1000, 0, 0b1, 0b1, (900,), (5,)))
    assert WireFrameCounter().echoes(b"\0" + ECHO + finer) == 3


def test_a_line_in_use_is_joined_in_the_middle_of_a_frame() -> None:
    counter = WireFrameCounter()
    assert counter.echoes(ECHO[5:] + ECHO) == 1
    assert counter.drives(DRIVE[2:] + DRIVE) == 1


def test_each_direction_has_its_own_frames() -> None:
    counter = WireFrameCounter()
    assert counter.echoes(DRIVE) == 0
    assert counter.drives(ECHO) == 0
