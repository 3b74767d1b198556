"""Lines in any pieces; what the robot's end says is what the host's end reads."""

from __future__ import annotations

import math

import pytest

from drivers.firing_pattern import FiringPattern
from drivers.lines.wire import NOISE, LineReader, Ranges, Sample
from drivers.messages import Pose, Twist
from tests.drivers.lines.json_robot import wire

LINES = b"one\n\ntwo\r\nthree\n"


@pytest.mark.parametrize("size", [1, 3, 100])
def test_lines_are_whole_however_bytes_are_split(size: int) -> None:
    reader, found = LineReader(), list[bytes]()
    for k in range(0, len(LINES), size):
        found += reader.feed(LINES[k : k + size])
    assert found == [b"one", b"two\r", b"three"]
    assert reader.feed(b"x" * 3 * LineReader.LINE_MAX) == []
    assert len(reader._rest) <= LineReader.LINE_MAX


def test_what_one_end_says_the_other_reads_and_noise_is_one_of_a_few_errors() -> None:
    lines = wire()
    for said in (
        Sample(Pose(1.0, -2.0, 7.5), Twist(0.1, -0.2), 3.0),
        Ranges({0: 1.5, 3: math.inf}, 3.01),
    ):
        assert lines.read(lines.say(said)) == said
    assert lines.heard(lines.velocity(Twist(0.1, 0.5))) == Twist(0.1, 0.5)
    pattern = FiringPattern((1, 6), 0.05, 4.0)
    assert lines.heard(lines.pattern(pattern)) == pattern
    for noise in (b"", b"{", b"7", b"[]", b'{"r": 1}', b'{"t": 1}', b"\xff\xfe", b"[" * 1999):
        for read in (lines.read, lines.heard):
            with pytest.raises(NOISE):
                read(noise)
